"""Bootstrap over sequences: windows of one sequence are not independent, so whole sequences are resampled.

One set of resamples is shared by all planners, which makes every comparison between them a paired one.
"""

from statistics import NormalDist

import numpy as np

from ehar.arrays import FloatArray, IntArray

RESAMPLES = 10_000  # R
LEVEL = 95.0  # of the interval [%]
POWER = 80.0  # the chance of showing the smallest difference [%]
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

    NaN marks a resample in which the statistic does not exist; it is left out. If no resample is left, the interval is
    NaN.
    """
    if not resampled.shape[-1]:
        return np.full((*resampled.shape[:-1], 2), np.nan)
    tail = (100 - LEVEL) / 2
    exists = np.isfinite(resampled).any(axis=-1, keepdims=True)
    ends = np.nanpercentile(np.where(exists, resampled, 0.0), [tail, 100 - tail], axis=-1)
    return np.where(exists, np.moveaxis(ends, 0, -1), np.nan)


def pair(ends: FloatArray) -> Interval | None:
    """Return the two ends of one interval, (2,), as numbers; None where it is NaN."""
    return None if np.isnan(ends).any() else (float(ends[0]), float(ends[1]))


def smallest_difference(resampled: FloatArray) -> float | None:
    """Return the smallest true difference that would show, 95 % two-sided, in 80 of 100 such runs.

    (z(0.975) + z(0.8)) SE = 2.80 SE: Bloom, Minimum Detectable Effects, Evaluation Review 1995. SE is the bootstrap's,
    the standard deviation of resampled differences.

    Args:
        resampled: (R,), a paired difference in every resample.

    Returns:
        In the unit of the differences; None if they do not vary: then nothing says how much they could.
    """
    # Equal differences may differ by a rounding error.
    if not len(resampled) or np.ptp(resampled) < 1e-12:
        return None
    normal = NormalDist()
    return (normal.inv_cdf(0.5 + LEVEL / 200) + normal.inv_cdf(POWER / 100)) * float(resampled.std(ddof=1))


def why_no_intervals(sequences: int, classes: int) -> str | None:
    """Return why a bootstrap over sequences says nothing, or None if it says something.

    Args:
        sequences: number of sequences in the run.
        classes: number of classes among labels and predictions.
    """
    if sequences < 2:
        return "all episodes are windows of one sequence, so there is nothing to resample"
    if classes < 2:
        return "there is one class only, so every answer is right"
    return None
