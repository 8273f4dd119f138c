"""Metrics of a batch of episodes: pure functions of arrays. Axes: N episodes, L frames."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.viewpoint import cartesian
from eval.records.episodes import EpisodeRecords

ACC_AT = (10, 30, 50, 70, 90, 100)  # Sec. 5.1: the observation ratios that the paper reports [%]
PROBABILITY_FLOOR = 1e-6  # the resolution of records; a smaller probability of the true class counts as this
ROUNDING = 1e-9  # accuracies that differ by less are equal; one frame of an episode makes a far larger difference
CALIBRATED_FROM = 50  # [%]: from half of an activity on, one may expect to know how sure to be
CALIBRATION_BINS = 15  # as in Guo et al., On Calibration of Modern Neural Networks, ICML 2017


@dataclass(frozen=True)
class Metric:
    """A number of one training of a planner; of several trainings tables show the mean.

    Args:
        key: in summary.json.
        header: of its column, with the unit.
        of_records: computes it.
        digits: behind the decimal point.
        lower_is_better: for sorting.
    """

    key: str
    header: str
    of_records: Callable[[EpisodeRecords], float]
    digits: int
    lower_is_better: bool = True


class Reliability(NamedTuple):
    """The share of right answers by their confidence, in `CALIBRATION_BINS` equal bins; NaN in empty bins.

    `ece` is the mean distance of this diagram from its diagonal.

    Attributes:
        confidence: (15,) mean probability of the predicted class.
        accuracy: (15,) share of right answers.
        share: (15,) share of all answers in the bin; sums to 1.
    """

    confidence: FloatArray
    accuracy: FloatArray
    share: FloatArray


def acc_at(correct: BoolArray, percent: int) -> float:
    """Return the share of episodes recognised after `percent` of the frames; the arguments are those of `right_at`."""
    return float(right_at(correct, percent).mean())


def right_at(correct: BoolArray, percent: int) -> BoolArray:
    """Return which episodes are recognised in the first frame that is not before `percent` of the frames, (N,).

    Args:
        correct: (N, L), whether the predicted class is the true one.
        percent: the observation ratio [%], 1 to 100.
    """
    right: BoolArray = correct[:, frame_at(percent, correct.shape[1])]
    return right


def frame_at(percent: int, length: int) -> int:
    """Return the first frame, from 0, that is not before an observation ratio.

    Args:
        percent: the ratio [%], 1 to 100.
        length: L, at least 1.
    """
    return max(-(-percent * length // 100), 1) - 1


def mean_acc(correct: BoolArray) -> FloatArray:
    """Return the accuracy of each episode, averaged over its frames, (N,) from (N, L)."""
    accuracy: FloatArray = correct.mean(axis=1)
    return accuracy


def gap_closed(acc: FloatArray, acc_noact: FloatArray, acc_oracle: FloatArray) -> FloatArray:
    """Return (acc - acc_noact) / (acc_oracle - acc_noact); NaN where the oracle is no better than no-act.

    A lead that is only a rounding error does not count: another machine may round differently.
    """
    gap = np.asarray(acc_oracle, dtype=np.float64) - acc_noact
    positive = gap > ROUNDING
    closed: FloatArray = np.where(positive, (acc - acc_noact) / np.where(positive, gap, 1.0), np.nan)
    return closed


def nll(true_probability: FloatArray) -> float:
    """Return the mean negative log-likelihood [nat] of the true class, over all episodes and frames (N, L)."""
    return float(-np.log(np.maximum(true_probability, PROBABILITY_FLOOR)).mean())


def ece(top_probability: FloatArray, correct: BoolArray) -> float:
    """Return the expected calibration error: the mean |accuracy - confidence| of equal-width bins (Guo et al., Eq. 3).

    Args:
        top_probability: (N, L), the probability of the predicted class.
        correct: (N, L), whether the predicted class is the true one.
    """
    confidence = top_probability.ravel()
    bins = _calibration_bins(confidence)
    excess = np.bincount(bins, weights=correct.ravel() - confidence, minlength=CALIBRATION_BINS)
    return float(np.abs(excess).sum() / len(confidence))


def late_ece(top_probability: FloatArray, correct: BoolArray) -> float:
    """Return the calibration error of the frames from `CALIBRATED_FROM` on; the arguments are those of `ece`."""
    late = slice(frame_at(CALIBRATED_FROM, correct.shape[1]), None)
    return ece(top_probability[:, late], correct[:, late])


def reliability(top_probability: FloatArray, correct: BoolArray) -> Reliability:
    """Return the diagram over all episodes and frames (Guo et al., ICML 2017).

    Args:
        top_probability: (N, L), the probability of the predicted class.
        correct: (N, L), whether the predicted class is the true one.
    """
    confidence = top_probability.ravel()
    bins = _calibration_bins(confidence)
    count, sure, right = (
        np.bincount(bins, weights=weights, minlength=CALIBRATION_BINS)
        for weights in (np.ones(len(bins)), confidence, correct.ravel())
    )
    held = np.where(count > 0, count, np.nan)
    return Reliability(sure / held, right / held, count / len(bins))


def _calibration_bins(confidence: FloatArray) -> IntArray:
    """Return the bin of each probability."""
    return np.minimum((confidence * CALIBRATION_BINS).astype(np.int64), CALIBRATION_BINS - 1)


def path_length(viewpoints: FloatArray) -> FloatArray:
    """Return how far cameras travelled [m], (...,) from viewpoints (..., L, 3): the sum of straight steps."""
    steps = np.diff(cartesian(viewpoints), axis=-2)
    length: FloatArray = np.linalg.norm(steps, axis=-1).sum(axis=-1)
    return length
