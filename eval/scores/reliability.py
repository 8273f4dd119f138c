"""The reliability diagram: how often a planner's answers are right, given how sure they were.

The bins are those of `eval.scores.metrics.ece`, which is the mean distance of the diagram from its diagonal.
"""

from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from eval.scores.metrics import CALIBRATION_BINS


class Reliability(NamedTuple):
    """A reliability diagram of `CALIBRATION_BINS` equal bins; NaN where a bin is empty.

    Args:
        confidence: (15,) mean probability of the predicted class.
        accuracy: (15,) share of right answers.
        share: (15,) of all answers that are in the bin; sums to 1.
    """

    confidence: FloatArray
    accuracy: FloatArray
    share: FloatArray


def reliability(top_probability: FloatArray, correct: BoolArray) -> Reliability:
    """Return the diagram over all episodes and frames (Guo et al., ICML 2017).

    Args:
        top_probability: (N, L), the probability of the predicted class.
        correct: (N, L), whether the predicted class is the true one.
    """
    confidence = top_probability.ravel()
    bins = np.minimum((confidence * CALIBRATION_BINS).astype(np.int64), CALIBRATION_BINS - 1)
    count, sure, right = (
        np.bincount(bins, weights=weights, minlength=CALIBRATION_BINS)
        for weights in (np.ones(len(bins)), confidence, correct.ravel())
    )
    held = np.where(count > 0, count, np.nan)
    return Reliability(sure / held, right / held, count / len(bins))
