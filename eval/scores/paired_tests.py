"""Tests of paired answers: exact McNemar for two planners, and Holm where several pairs are tested.

McNemar counts every episode as independent. Windows and starts of one sequence are not, so its p-values are too small
where a sequence has many episodes; the bootstrap resamples whole sequences, and its intervals are the safer claim.
"""

from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray


class McNemar(NamedTuple):
    """The result of McNemar's exact test.

    Args:
        wins: episodes in which the first planner is right more often than the second.
        losses: episodes in which it is right less often; ties do not count.
        p: the two-sided p-value of wins and losses being equally likely.
    """

    wins: int
    losses: int
    p: float


def mcnemar(right: FloatArray, other: FloatArray) -> McNemar:
    """Test whether two planners are right equally often: p = min(1, 2 P(X <= min(b, c))), X of Binomial(b + c, 1/2).

    McNemar, Note on the sampling error of the difference between correlated proportions, Psychometrika 1947, in its
    exact form. For planners with several training seeds it compares the shares of trainings that are right. It is then
    a sign test, which holds for these trainings and not for others; with one training each it is McNemar's test.

    Args:
        right: (N,), 0 to 1, the share of the first planner's trainings that are right in each episode.
        other: (N,), the same share of the second planner.
    """
    from scipy.special import bdtr  # imported here: it takes a third of a second, too long for `ehar --help`

    wins, losses = int((right > other).sum()), int((right < other).sum())
    return McNemar(wins, losses, min(1.0, 2 * float(bdtr(min(wins, losses), wins + losses, 0.5))))


def holm(p: FloatArray) -> FloatArray:
    """Return p-values (n,) adjusted so that the level bounds the chance of any false claim among all n.

    Holm, A simple sequentially rejective multiple test procedure, Scandinavian Journal of Statistics 1979: the k-th
    smallest is multiplied by n - k + 1, and is never less than the ones before it.
    """
    order = np.argsort(p, kind="stable")
    adjusted = np.empty(len(p))
    adjusted[order] = np.minimum(np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)), 1)
    return adjusted
