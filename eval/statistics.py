"""Bootstrap over sequences: windows of one sequence are not independent, so whole sequences are resampled.

One set of resamples is shared by all planners, which makes every comparison between them a paired one.
"""

import numpy as np

from ehar.arrays import FloatArray, IntArray

RESAMPLES = 10_000  # R
LEVEL = 95.0  # of the interval [%]
BOOTSTRAP_SEED = 0  # intervals are properties of the records, not of a run

Interval = tuple[float, float]


def resample_counts(rng: np.random.Generator, clusters: int, resamples: int = RESAMPLES) -> IntArray:
    """Return how often each of S clusters is drawn in each resample, (R, S): S draws with replacement."""
    return rng.multinomial(clusters, np.full(clusters, 1 / clusters), size=resamples)


def resampled_means(values: FloatArray, clusters: IntArray, counts: IntArray) -> FloatArray:
    """Return the mean over episodes in every resample, (..., R).

    Args:
        values: (..., N), one number an episode; for several planners the episodes are the same.
        clusters: (N,), the cluster of each episode, 0 to S - 1.
        counts: (R, S) from `resample_counts`.
    """
    of_cluster = np.zeros((len(clusters), counts.shape[1]))
    of_cluster[np.arange(len(clusters)), clusters] = 1
    weights = counts.astype(np.float64).T
    means: FloatArray = (values @ of_cluster @ weights) / (of_cluster.sum(axis=0) @ weights)
    return means


def interval(resampled: FloatArray) -> FloatArray:
    """Return the percentile interval of resampled statistics, (..., 2) from (..., R).

    NaN, a resample in which the statistic does not exist, is left out; the interval is NaN where nothing is left.
    """
    tail = (100 - LEVEL) / 2
    exists = np.isfinite(resampled).any(axis=-1, keepdims=True)
    ends = np.nanpercentile(np.where(exists, resampled, 0.0), [tail, 100 - tail], axis=-1)
    return np.where(exists, np.moveaxis(ends, 0, -1), np.nan)


def pair(ends: FloatArray) -> Interval:
    """Return the two ends of one interval, (2,), as numbers."""
    return float(ends[0]), float(ends[1])
