"""Paired differences: how much more accurate a planner of interest is than each of the others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from eval.scores.paired_tests import holm, mcnemar
from eval.scores.planner_accuracy import PlannerAccuracy, Resamples
from eval.scores.sequence_scores import probability_of_improvement, resampled_improvements, wins
from eval.scores.statistics import Interval, interval, pair, smallest_difference

NBV = "nbv"
SUBJECTS = ("il-ppo", "dagger", NBV, "il", "ppo")  # compared with every other planner; the earlier one is the minuend


@dataclass(frozen=True)
class Difference:
    """A paired difference: the same episodes, the same resamples.

    Args:
        planner: the one whose accuracy is the minuend.
        other: the one whose accuracy is taken away.
        acc_mean: the difference of their accuracies, the mean over all frames [percentage points].
        ci95: its 95 % interval, bootstrap over sequences and, of planners with several, training seeds; None without
            resamples, like every other number that needs them.
        smallest: the smallest true difference that would have shown in 80 of 100 such runs [percentage points]; None
            where the two do not differ in any resample.
        improvement: the probability that a training of the planner is more accurate in a sequence than one of the
            other, 0 to 1; ties count half.
        improvement_ci95: its 95 % interval.
        mcnemar_wins: number of episodes in which the planner is right at acc@50 and the other is not; with several
            trainings, in which a larger share of its trainings is right.
        mcnemar_losses: number of episodes in which the other planner wins in this sense.
        mcnemar_p: p-value of McNemar's exact test, which takes episodes as independent.
        mcnemar_p_holm: that p-value after Holm's correction for all pairs that are compared together.
    """

    planner: str
    other: str
    acc_mean: float
    ci95: Interval | None
    smallest: float | None
    improvement: float
    improvement_ci95: Interval | None
    mcnemar_wins: int
    mcnemar_losses: int
    mcnemar_p: float
    mcnemar_p_holm: float

    @property
    def is_clear(self) -> bool:
        """Whether the interval excludes zero."""
        return self.ci95 is not None and (self.ci95[0] > 0 or self.ci95[1] < 0)


def differences(
    planners: Sequence[PlannerAccuracy], privileged: Mapping[str, bool], resamples: Resamples
) -> tuple[Difference, ...]:
    """Return the differences between each of `SUBJECTS` and each other planner without the truth, each pair once.

    Args:
        planners: all planners of the run.
        privileged: whether each was handed the truth, by name.
        resamples: the resamples that all planners share.
    """
    unprivileged = {planner.name: planner for planner in planners if not privileged[planner.name]}
    subjects = [subject for subject in SUBJECTS if subject in unprivileged]
    pairs = [
        (unprivileged[subject], planner)
        for rank, subject in enumerate(subjects)
        for other, planner in unprivileged.items()
        if other not in subjects[: rank + 1]
    ]
    return compare_pairs(pairs, resamples)


def compare_pairs(
    pairs: Sequence[tuple[PlannerAccuracy, PlannerAccuracy]], resamples: Resamples
) -> tuple[Difference, ...]:
    """Return how much more accurate the first planner of each pair is; Holm's correction covers all pairs."""
    tests = [mcnemar(planner.right, other.right) for planner, other in pairs]
    adjusted = holm(np.array([test.p for test in tests]))
    found = []
    for (planner, other), test, p_holm in zip(pairs, tests, adjusted, strict=True):
        resampled = 100 * (planner.resampled - other.resampled)
        won = wins(planner.by_sequence, other.by_sequence)
        improvements = resampled_improvements(won, resamples.counts, planner.draws, other.draws)
        found.append(
            Difference(
                planner=planner.name,
                other=other.name,
                acc_mean=100 * (planner.mean - other.mean),
                ci95=pair(interval(resampled)),
                smallest=smallest_difference(resampled),
                improvement=probability_of_improvement(won),
                improvement_ci95=pair(interval(improvements)),
                mcnemar_wins=test.wins,
                mcnemar_losses=test.losses,
                mcnemar_p=test.p,
                mcnemar_p_holm=float(p_holm),
            )
        )
    return tuple(found)
