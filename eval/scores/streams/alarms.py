"""How soon activities are recognised for good, and answers that name what is not shown. -1 is no activity."""

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.data.streams.data import NO_ACTIVITY
from eval.scores.streams.activities import activity_frames


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


def alarms_per_minute(labels: IntArray, predicted: IntArray, fps: float) -> float:
    """Return the false alarms a minute of answers (N, L), at so many frames per second."""
    return false_alarms(labels, predicted) / (labels.size / fps / 60)
