"""Point-level mean average precision: are activities' starts detected, and how near to where they are."""

from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.data.streams.data import NO_ACTIVITY
from eval.records.episodes import EpisodeRecords

OFFSETS = tuple(range(1, 11))  # [s] that a start may lie off, as in Shou et al.


class Starts(NamedTuple):
    """The starts of activities, in order."""

    episode: IntArray  # (M,)
    frame: IntArray  # (M,)
    label: IntArray  # (M,)

    @staticmethod
    def of(labels: IntArray) -> "Starts":
        """Return where classes (N, L) are others than in the frame before, and are activities.

        The first frame counts: what is shown there begins for those who watch.
        """
        new = np.ones(labels.shape, dtype=bool)
        new[:, 1:] = labels[:, 1:] != labels[:, :-1]
        episode, frame = np.nonzero(new & (labels != NO_ACTIVITY))
        return Starts(episode, frame, labels[episode, frame])


def point_map(records: EpisodeRecords, fps: float) -> dict[int, float]:
    """Return the point-level mean average precision [0 to 1] for each of the `OFFSETS`.

    Shou et al., Online Detection of Action Start in Untrimmed, Streaming Videos, ECCV 2018: an activity is detected to
    start where the most probable class is another one than in the frame before, and is no background; its score is
    that class's probability. A detection is right if the start of its class that is nearest to it in its episode lies
    within the offset, and no detection of a higher score has that start. The average precision of a class is the area
    under its precision, made to fall with recall; the mean is over the classes that are shown.

    Args:
        records: records of streams.
        fps: frames per second.
    """
    shown, found = Starts.of(records.label), Starts.of(records.predicted)
    scores = records.top_probability[found.episode, found.frame]
    precisions = np.array(
        [_precisions(shown, found, scores, label, fps) for label in np.unique(shown.label)]
    )  # (classes, offsets)
    return dict(zip(OFFSETS, precisions.mean(axis=0).tolist(), strict=True)) if len(precisions) else {}


def _precisions(shown: Starts, found: Starts, scores: FloatArray, label: int, fps: float) -> FloatArray:
    """Return the average precision of a class at each offset, (10,)."""
    true = np.flatnonzero(shown.label == label)
    of_class = np.flatnonzero(found.label == label)
    ranked = of_class[np.argsort(-scores[of_class], kind="stable")]
    if not len(ranked):
        return np.zeros(len(OFFSETS))
    away = np.abs(found.frame[ranked, None] - shown.frame[true]).astype(np.float64)
    away[found.episode[ranked, None] != shown.episode[true]] = np.inf
    nearest = away.argmin(axis=1)
    distance = away[np.arange(len(ranked)), nearest]
    return np.array([_area(_first(nearest, distance <= offset * fps), len(true)) for offset in OFFSETS])


def _first(nearest: IntArray, within: BoolArray) -> BoolArray:
    """Return which detections, by falling score, are within the offset and the first one at their start."""
    candidates = np.flatnonzero(within)
    right = np.zeros(len(nearest), dtype=bool)
    right[candidates[np.unique(nearest[candidates], return_index=True)[1]]] = True
    return right


def _area(right: BoolArray, starts: int) -> float:
    """Return the area under precision over recall, of detections by falling score."""
    precision = np.cumsum(right) / np.arange(1, len(right) + 1)
    falling = np.maximum.accumulate(precision[::-1])[::-1]
    return float(falling[right].sum() / starts)
