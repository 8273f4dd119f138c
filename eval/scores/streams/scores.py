"""The scores of a planner in streams, as in summary.json: pure functions of its records."""

from dataclasses import dataclass

import numpy as np

from ehar.arrays import IntArray
from ehar.data.streams.data import NO_ACTIVITY
from eval.records.episodes import EpisodeRecords
from eval.scores.metrics import ACC_AT
from eval.scores.streams.activities import RATIOS, activities
from eval.scores.streams.alarms import alarms_per_minute, delays
from eval.scores.streams.starts import point_map


@dataclass(frozen=True)
class StreamScores:
    """The scores of streams, over all trainings of a planner.

    Args:
        frames_right: share of all frames [%].
        no_activity_right: share of the frames that show no activity [%]; None if there are none.
        delay_s: mean time from an onset until the answer is right and stays right [s].
        recognised: share of activities for which there is such a moment [%].
        false_alarms_per_min: answers a minute that name what is not shown.
        f1: macro F1 [%] after 10 to 100 % of an activity's frames.
        f1_mean: the mean over 20 equal steps [%].
        point_map: point-level mean average precision of starts [%], by the offset that is allowed [s].
        point_map_mean: the mean over the offsets [%].
    """

    frames_right: float
    no_activity_right: float | None
    delay_s: float
    recognised: float
    false_alarms_per_min: float
    f1: dict[str, float]
    f1_mean: float
    point_map: dict[str, float]
    point_map_mean: float


def stream_scores(records: EpisodeRecords, fps: float) -> StreamScores:
    """Return the scores of records of streams, at so many frames per second."""
    took, recognised = delays(records.label, records.predicted)
    still = records.label == NO_ACTIVITY
    within = activities(records)
    f1 = dict(zip(RATIOS, (macro_f1(within.label, answers) for answers in within.predicted.T), strict=True))
    starts = point_map(records, fps)
    return StreamScores(
        frames_right=100 * float(records.correct.mean()),
        no_activity_right=100 * float(records.correct[still].mean()) if still.any() else None,
        delay_s=float(took.mean()) / fps,
        recognised=100 * float(recognised.mean()),
        false_alarms_per_min=alarms_per_minute(records.label, records.predicted, fps),
        f1={str(percent): 100 * f1[percent] for percent in ACC_AT},
        f1_mean=100 * float(np.mean(list(f1.values()))),
        point_map={str(offset): 100 * precision for offset, precision in starts.items()},
        point_map_mean=100 * float(np.mean(list(starts.values()))),
    )


def macro_f1(labels: IntArray, answers: IntArray) -> float:
    """Return the F1 of M answers [0 to 1], the mean over the classes among the labels, each counting once.

    The F1 of a class is the harmonic mean of precision, the share of its answers that are right, and recall, the share
    of its activities that are found (macro-averaging: Sokolova and Lapalme, A systematic analysis of performance
    measures for classification tasks, 2009). Unlike accuracy it does not let frequent classes outvote rare ones.
    """
    of_class = [
        2 * np.sum((answers == one) & (labels == one)) / (np.sum(answers == one) + np.sum(labels == one))
        for one in np.unique(labels)
    ]
    return float(np.mean(of_class))
