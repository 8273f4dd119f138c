"""Bootstrap over people and their sequences: what is alike is resampled as a whole.

Windows and starts of one sequence are alike, so are sequences of the same people. One set of resamples is shared by all
planners, which makes every comparison between them a paired one.
"""

from collections.abc import Sequence
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray

RESAMPLES = 10_000  # R
LEVEL = 95.0  # of the interval [%]
POWER = 80.0  # the chance of showing the smallest difference [%]
BOOTSTRAP_SEED = 0  # intervals are properties of the records, not of a run

_UPPER = 0.5 + LEVEL / 200  # 0.975
_NORMAL = NormalDist().inv_cdf(_UPPER)  # 1.96
_POWER = NormalDist().inv_cdf(POWER / 100)  # 0.84
ROUNDING = 1e-12  # values that differ by less are equal
_TIE = 1e-9  # distances in standard errors that differ by less are equal: another machine may round differently

Interval = tuple[float, float]


class Variance(NamedTuple):
    """The variance of a statistic that one kind of unit causes alone, such as people."""

    values: FloatArray  # (...), the variance of the statistic when only these units are resampled
    units: int  # number of units, at least 2


class Widening(NamedTuple):
    """How much wider than a bootstrap's an interval has to be, because some units are few."""

    factor: FloatArray  # (...), by which the standard error of the bootstrap is too small
    freedom: FloatArray  # (...), degrees of freedom of that standard error; infinite if no units are few

    @property
    def of_interval(self) -> FloatArray:
        """By how much a single 95 % interval is stretched, (...)."""
        from scipy.special import stdtrit  # imported here: it takes a third of a second, too long for `ehar --help`

        stretched: FloatArray = self.factor * stdtrit(self.freedom, _UPPER) / _NORMAL
        return stretched


class Simultaneous(NamedTuple):
    """Intervals and p-values of m differences that are corrected together."""

    ends: FloatArray  # (m, 2); the chance that all of these intervals cover is 95 %
    p: FloatArray  # (m,) adjusted p-values: 5 % bounds the chance of any false claim among the m
    p_alone: FloatArray  # (m,) p-values of each difference by itself
    # (m,) the true difference whose interval would exclude zero in 80 of 100 such runs; NaN without variation
    smallest: FloatArray


def resample_counts(rng: np.random.Generator, clusters: int, resamples: int = RESAMPLES) -> IntArray:
    """Return how often each of S clusters is drawn in each resample, (R, S): S draws with replacement."""
    return rng.multinomial(clusters, np.full(clusters, 1 / clusters), size=resamples)


def two_stage_counts(rng: np.random.Generator, groups: IntArray, resamples: int = RESAMPLES) -> IntArray:
    """Return how often each sequence is drawn if people are drawn first, (R, S).

    G groups are drawn with replacement. Each time that a group is drawn, as many sequences as it has are drawn from it
    with replacement: the two-stage bootstrap of Davison & Hinkley, Bootstrap Methods and their Application, 1997,
    Sec. 3.8.

    Args:
        rng: generator of the draws.
        groups: (S,), the group of each sequence, 0 to G - 1.
        resamples: R.
    """
    drawn = resample_counts(rng, int(groups.max()) + 1, resamples)
    counts = np.empty((resamples, len(groups)), dtype=np.int64)
    for group, times in enumerate(drawn.T):
        members = np.flatnonzero(groups == group)
        counts[:, members] = rng.multinomial(times * len(members), np.full(len(members), 1 / len(members)))
    return counts


def resampled_means(values: FloatArray, clusters: IntArray, counts: IntArray) -> FloatArray:
    """Return the mean over episodes in every resample, (..., R).

    Args:
        values: (..., N), one number an episode; for several planners the episodes are the same.
        clusters: (N,), the cluster of each episode, 0 to S - 1.
        counts: (R, S) from `resample_counts` or `two_stage_counts`.
    """
    size = counts.shape[1]
    rows = values.reshape(-1, len(clusters))
    of_cluster = np.stack([np.bincount(clusters, weights=row, minlength=size) for row in rows])
    weights = counts.astype(np.float64).T
    drawn = np.bincount(clusters, minlength=size).astype(np.float64) @ weights
    means: FloatArray = (of_cluster.reshape(*values.shape[:-1], size) @ weights) / drawn
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


def widening(total: FloatArray, few: Sequence[Variance]) -> Widening:
    """Return how much wider an interval has to be, because it rests on few units of some kind.

    A bootstrap of u units sees (u - 1) / u of the variance between them, and its percentiles take that for the true
    variance. Here the variance is corrected, and has the degrees of freedom of Satterthwaite, An Approximate
    Distribution of Estimates of Variance Components, Biometrics 1946: few if most of it lies between few units, many
    if these units are alike.

    Args:
        total: (...), variance of the statistic over full resamples.
        few: its parts that are due to units of which there may be few. The rest is taken as known.
    """
    between = sum((part.values for part in few), np.zeros_like(total))
    corrected = [part.values * part.units / (part.units - 1) for part in few]
    whole = sum(corrected, np.maximum(total - between, 0))
    squares = sum(
        (part**2 / (variance.units - 1) for part, variance in zip(corrected, few, strict=True)), np.zeros_like(total)
    )
    # A variance that is a rounding error has no parts.
    varies, has_few = total > ROUNDING**2, squares > ROUNDING**2 * whole**2
    factor = np.sqrt(np.where(varies, whole, 1) / np.where(varies, total, 1))
    freedom = np.where(varies & has_few, whole**2 / np.where(has_few, squares, 1), np.inf)
    return Widening(factor, freedom)


def simultaneous(estimates: FloatArray, resampled: FloatArray, wider: Widening) -> Simultaneous:
    """Return intervals and p-values of m differences, corrected for being looked at together.

    The single-step max-T method: Westfall & Young, Resampling-Based Multiple Testing, 1993, Sec. 2.3; its intervals
    as in Romano & Wolf, Exact and Approximate Stepdown Methods, JASA 2005. T is the distance of a resampled difference
    from the estimate in standard errors. One standard error serves for all resamples: one that is computed anew within
    each resample is unstable where people are few. The maximum over the m pairs says at what level each pair has to be
    tested; Student's t takes that level to the degrees of freedom of each pair. That level is never above the one of a
    pair alone: with two people, resampled differences lie at most about 1.4 standard errors from the estimate.

    Args:
        estimates: (m,) differences.
        resampled: (m, R) differences in shared resamples.
        wider: how much wider intervals have to be, (m,).
    """
    from scipy.special import ndtr, ndtri, stdtr, stdtrit  # imported here: too slow for `ehar --help`

    error = resampled.std(axis=1, ddof=1)
    varies: BoolArray = np.ptp(resampled, axis=1) > ROUNDING
    safe = np.where(varies, error, 1.0)
    distance = np.where(varies[:, None], np.abs(resampled - estimates[:, None]) / safe[:, None], 0.0)
    largest = np.sort(distance.max(axis=0))
    # The interval excludes zero if at most 5 % of the resamples, the data among them, have as large a maximum.
    beyond = int((1 - LEVEL / 100) * (len(largest) + 1) + ROUNDING) - 1
    alone = (1 - LEVEL / 100) / 2
    level = min(float(ndtr(-largest[min(len(largest) - beyond, len(largest)) - 1])), alone)  # one-sided, of each pair
    scale = np.where(varies, wider.factor * error, 0.0)
    half = np.where(varies, scale * stdtrit(wider.freedom, 1 - level), 0.0)
    tail = stdtr(wider.freedom, -np.abs(estimates) / np.where(varies, scale, 1.0))
    reached = len(largest) - np.searchsorted(largest, -ndtri(tail) - _TIE)
    one = 2 * tail
    # A difference that never varies is certain, or certainly none.
    known = np.where(np.abs(estimates) > ROUNDING, 0.0, 1.0)
    return Simultaneous(
        ends=np.stack([estimates - half, estimates + half], axis=-1),
        p=np.where(varies, np.maximum((1 + reached) / (1 + len(largest)), one), known),
        p_alone=np.where(varies, one, known),
        smallest=np.where(varies, half + _POWER * scale, np.nan),
    )


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
