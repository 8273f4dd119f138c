"""Scores of streams, frame by frame: pure functions of arrays. Axes: N episodes, L frames; -1 is no activity."""

from collections.abc import Mapping

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.data.streams.data import NO_ACTIVITY
from eval.records.episodes import EpisodeRecords
from eval.render.tables import NONE, Table
from eval.scores.streams.activities import activity_frames

STREAM_HEADER = ("frames right %", "no activity right %", "delay [s]", "recognised %", "false alarms/min")
STREAM_NOTES = (
    "Delay: from the onset until the answer is right and stays right; an activity for which it never does counts in "
    "full. Recognised: the share of activities for which it does.",
    "A false alarm is an answer that names an activity that is not shown while it is given.",
)


def delays(labels: IntArray, predicted: IntArray) -> tuple[FloatArray, BoolArray]:
    """Return how long each activity takes to be recognised for good, and which ones are.

    Args:
        labels: (N, L), the true classes.
        predicted: (N, L), the most probable classes.

    Returns:
        frames from the onset to the first frame from which on the answer is right until the activity ends, (M,); all
        of its frames where there is no such frame. And whether there is one, (M,).
    """
    episode, begin, end = activity_frames(labels)
    wrong = labels != predicted
    # The last wrong frame up to each frame; an activity is recognised for good behind the last one before its end.
    last_wrong = np.maximum.accumulate(np.where(wrong, np.arange(labels.shape[1]), -1), axis=1)[episode, end - 1]
    settled = np.maximum(last_wrong + 1, begin)
    return (settled - begin).astype(np.float64), settled < end


def false_alarms(labels: IntArray, predicted: IntArray) -> int:
    """Return the number of alarms for activities that are not there.

    An alarm is a row of frames with one and the same answer, which is an activity. It is false if that activity is
    shown in none of these frames.
    """
    edge = np.ones((len(labels), 1), dtype=bool)
    begins = np.concatenate([edge, predicted[:, 1:] != predicted[:, :-1]], axis=1)
    row = np.cumsum(begins.ravel()) - 1
    alarms = int(row[-1]) + 1
    shown = np.bincount(row, weights=(predicted == labels).ravel(), minlength=alarms) > 0
    answer = predicted.ravel()[begins.ravel()]
    return int((~shown & (answer != NO_ACTIVITY)).sum())


def stream_table(records: Mapping[str, EpisodeRecords], fps: float) -> Table:
    """Return a table with one row per planner: how soon activities are recognised in streams, and how often wrongly.

    Args:
        records: records of streams, by planner.
        fps: frames per second.
    """
    whole = next(iter(records.values()))
    return Table(
        title=f"In streams: {len(whole)} episodes of {whole.label.shape[1] / fps:g} s",
        header=("planner", *STREAM_HEADER),
        rows=tuple((name, *stream_row(held, fps)) for name, held in records.items()),
        footnotes=STREAM_NOTES,
    )


def stream_row(records: EpisodeRecords, fps: float) -> tuple[str, ...]:
    """Return the scores of streams as texts, in the order of `STREAM_HEADER`."""
    took, recognised = delays(records.label, records.predicted)
    minutes, still = records.label.size / fps / 60, records.label == NO_ACTIVITY
    return (
        f"{100 * records.correct.mean():.1f}",
        f"{100 * records.correct[still].mean():.1f}" if still.any() else NONE,
        f"{took.mean() / fps:.2f}",
        f"{100 * recognised.mean():.1f}",
        f"{false_alarms(records.label, records.predicted) / minutes:.1f}",
    )
