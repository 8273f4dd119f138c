"""Paired differences: how much more accurate a planner of interest is than each of the others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ehar.arrays import FloatArray
from eval.statistics import Interval, interval, pair

NBV = "nbv"
SUBJECTS = ("il-ppo", "dagger", NBV, "il", "ppo")  # compared with every other planner; the earlier one is the minuend


@dataclass(frozen=True)
class Difference:
    """A paired difference: the same episodes, the same resamples.

    Args:
        planner: the one whose accuracy is the minuend.
        other: the one whose accuracy is taken away.
        acc_mean: the difference of their accuracies, the mean over all frames [percentage points].
        ci95: its 95 % interval, bootstrap over sequences and, of planners with several, training seeds.
    """

    planner: str
    other: str
    acc_mean: float
    ci95: Interval

    @property
    def is_clear(self) -> bool:
        """Whether the interval excludes zero."""
        return self.ci95[0] > 0 or self.ci95[1] < 0


def differences(
    names: Sequence[str], privileged: Mapping[str, bool], acc: FloatArray, resampled: FloatArray
) -> tuple[Difference, ...]:
    """Return what each of `SUBJECTS` that was run has more than each other planner without the truth, each pair once.

    Args:
        names: of P planners.
        privileged: which of them were handed the truth.
        acc: (P,) accuracy, 0 to 1.
        resampled: (P, R), the same in resamples that they share.
    """
    rows = {name: row for row, name in enumerate(names) if not privileged[name]}
    subjects = [subject for subject in SUBJECTS if subject in rows]
    return tuple(
        Difference(
            planner=subject,
            other=other,
            acc_mean=100 * float(acc[rows[subject]] - acc[row]),
            ci95=pair(100 * interval(resampled[rows[subject]] - resampled[row])),
        )
        for rank, subject in enumerate(subjects)
        for other, row in rows.items()
        if other not in subjects[: rank + 1]
    )
