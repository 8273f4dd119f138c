"""Paired differences: how much more accurate a planner of interest is than each of the others."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from eval.scores.planner_accuracy import PlannerAccuracy
from eval.scores.planner_summary import NO_ACT
from eval.scores.resampling.resamples import Resamples
from eval.scores.resampling.statistics import Interval, pair
from eval.scores.sequence_scores import probability_of_improvement, resampled_improvements, wins

NBV = "nbv"
SUBJECTS = ("il-ppo", "dagger", NBV, "il", "ppo")  # compared with every other planner; the earlier one is the minuend


@dataclass(frozen=True)
class Difference:
    """A paired difference: the same episodes, the same resamples.

    Args:
        planner: the one whose accuracy is the minuend.
        other: the one whose accuracy is taken away.
        acc_mean: the difference of their accuracies, the mean over all frames [percentage points].
        ci95: its 95 % interval by itself; bootstrap over people, sequences and, of planners with several, training
            seeds. None without resamples, like every other number that needs them.
        ci95_corrected: its interval among all differences that are compared together: the chance that every one of
            them covers is 95 %.
        p: two-sided p-value of no difference, by itself.
        p_corrected: that p-value among all differences that are compared together: 5 % bounds the chance of any false
            claim.
        smallest: the smallest true difference whose corrected interval would exclude zero in 80 of 100 such runs
            [percentage points]; None where their difference is the same in every resample.
        improvement: the probability that a training of the planner is more accurate in a sequence than one of the
            other, 0 to 1; ties count half.
        improvement_ci95: its 95 % interval.
    """

    planner: str
    other: str
    acc_mean: float
    ci95: Interval | None
    ci95_corrected: Interval | None
    p: float | None
    p_corrected: float | None
    smallest: float | None
    improvement: float
    improvement_ci95: Interval | None

    @property
    def is_clear(self) -> bool:
        """Whether the corrected interval excludes zero."""
        return self.ci95_corrected is not None and excludes_zero(self.ci95_corrected)


def excludes_zero(ends: Interval) -> bool:
    """Return whether an interval lies on one side of zero."""
    return ends[0] > 0 or ends[1] < 0


def differences(
    planners: Sequence[PlannerAccuracy],
    privileged: Mapping[str, bool],
    resamples: Resamples,
    own: Collection[str] = (),
) -> tuple[Difference, ...]:
    """Return the differences between each planner of interest and each other one without the truth, each pair once.

    Of interest are a user's own planners and `SUBJECTS`; where none of them ran, a camera that stays is.

    Args:
        planners: all planners of the run.
        privileged: whether each was handed the truth, by name.
        resamples: the resamples that all planners share.
        own: names of a user's own planners.
    """
    unprivileged = {planner.name: planner for planner in planners if not privileged[planner.name]}
    subjects = [name for name in unprivileged if name in own]
    subjects += [name for name in SUBJECTS if name in unprivileged and name not in own]
    if not subjects and NO_ACT in unprivileged:
        stays = unprivileged[NO_ACT]
        return compare_pairs([(one, stays) for one in unprivileged.values() if one is not stays], resamples)
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
    """Return how much more accurate the first planner of each pair is; all pairs are corrected together."""
    if not pairs:
        return ()
    estimates = 100 * np.array([planner.mean - other.mean for planner, other in pairs])
    resampled = 100 * np.stack([planner.resampled - other.resampled for planner, other in pairs])
    ends = resamples.interval(estimates, resampled)
    together = resamples.together(estimates, resampled) if resamples.full else None
    found = []
    for row, (planner, other) in enumerate(pairs):
        won = wins(planner.by_sequence, other.by_sequence)
        improvement = probability_of_improvement(won)
        improvements = resampled_improvements(won, resamples.counts, planner.draws, other.draws)
        found.append(
            Difference(
                planner=planner.name,
                other=other.name,
                acc_mean=float(estimates[row]),
                ci95=pair(ends[row]),
                ci95_corrected=None if together is None else pair(together.ends[row]),
                p=None if together is None else float(together.p_alone[row]),
                p_corrected=None if together is None else float(together.p[row]),
                smallest=None
                if together is None or np.isnan(together.smallest[row])
                else float(together.smallest[row]),
                improvement=improvement,
                improvement_ci95=pair(resamples.interval(improvement, improvements, bounds=(0, 1))),
            )
        )
    return tuple(found)
