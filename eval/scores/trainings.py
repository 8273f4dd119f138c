"""Several trainings of recogniser and gain field: runs of the same episodes with other weights, taken together.

All planners of a run share its weights, so a resample draws the same trainings for all planners.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.errors import UsageError
from eval.records.episodes import EpisodeRecords
from eval.scores.differences import Difference, compare_pairs
from eval.scores.metrics import gap_closed, mean_acc
from eval.scores.planner_accuracy import PlannerAccuracy, draw_resamples
from eval.scores.planner_summary import NO_ACT, ORACLE
from eval.scores.resampling.resamples import Basis, Resamples
from eval.scores.resampling.statistics import Interval, pair
from eval.scores.resampling.training_seeds import group_planners
from eval.scores.sequence_scores import accuracy_by_sequence


@dataclass(frozen=True)
class TrainedPlanner:
    """One planner over T trainings of recogniser and gain field.

    Args:
        name: name of the planner, without seeds of its own.
        privileged: whether it was handed the truth.
        acc_mean: accuracy [%] over all frames, the mean over trainings.
        acc_mean_ci95: its 95 % interval, bootstrap over people, sequences and trainings; None without resamples.
        acc_mean_sd: its standard deviation over trainings (ddof 1) [percentage points].
        gap_closed: the share of the way from no-act to the oracle, the mean over trainings; None if no-act or the
            oracle did not run, or the oracle was no better in some training.
        gap_closed_ci95: its 95 % interval.
        gap_closed_sd: its standard deviation over trainings.
    """

    name: str
    privileged: bool
    acc_mean: float
    acc_mean_ci95: Interval | None
    acc_mean_sd: float
    gap_closed: float | None
    gap_closed_ci95: Interval | None
    gap_closed_sd: float | None


@dataclass(frozen=True)
class TrainedDifference:
    """A difference of two planners over T trainings, and its standard deviation over them [percentage points]."""

    difference: Difference
    sd: float


@dataclass(frozen=True)
class TrainingsSummary:
    """The results of T trainings of recogniser and gain field on the same episodes.

    Args:
        trainings: T.
        episodes: number of episodes of each planner in each run.
        no_intervals: why there are no intervals; None if there are.
        basis: the people and sequences that intervals rest on.
        planners: results of the planners of all runs.
        differences: paired differences between one planner and each other one that is not privileged.
    """

    trainings: int
    episodes: int
    no_intervals: str | None
    basis: Basis
    planners: tuple[TrainedPlanner, ...]
    differences: tuple[TrainedDifference, ...]


def summarise_trainings(
    runs: Sequence[Mapping[str, EpisodeRecords]], privileged: Mapping[str, bool], planner: str
) -> TrainingsSummary:
    """Compute the results of several trainings.

    A planner that has training seeds of its own counts with the mean over them; they are not drawn.

    Args:
        runs: T runs of the same episodes, at least 2: records by record name.
        privileged: whether each planner was handed the truth, by its name without seeds.
        planner: the planner that is compared with each other one.

    Raises:
        UsageError: a planner did not run in all runs, or is privileged.
    """
    grouped = [{group.name: group.records for group in group_planners(run)} for run in runs]
    names = [name for name in grouped[0] if all(name in groups for groups in grouped)]
    able = [name for name in names if not privileged[name]]
    if planner not in able:
        raise UsageError(
            f"no planner {planner!r} without the truth in all {len(runs)} runs; expected one of: {', '.join(able)}"
        )
    resamples = draw_resamples([held for run in runs for held in run.values()]).with_trainings(len(runs))
    draws = resamples.trainings
    assert draws is not None
    correct = {
        name: [[run[record].correct for record in groups[name]] for run, groups in zip(runs, grouped, strict=True)]
        for name in names
    }
    # The accuracy of each planner in each training and episode, (T, N); with seeds of its own, the mean over them.
    accuracy = {
        name: np.stack([np.mean([mean_acc(seed) for seed in seeds], axis=0) for seeds in held])
        for name, held in correct.items()
    }
    rows = {name: resamples.means(values) for name, values in accuracy.items()}
    compared = {
        name: PlannerAccuracy(
            name=name,
            mean=float(values.mean()),
            resampled=_drawn(rows[name], draws),
            by_sequence=np.stack([_by_sequence(seeds, resamples) for seeds in correct[name]]),
            draws=draws,
        )
        for name, values in accuracy.items()
    }
    differences = compare_pairs([(compared[planner], compared[name]) for name in able if name != planner], resamples)
    return TrainingsSummary(
        trainings=len(runs),
        episodes=len(next(iter(runs[0].values()))),
        no_intervals=resamples.why_none,
        basis=resamples.basis,
        planners=tuple(
            _planner(compared[name], accuracy, rows, draws, resamples, privileged=privileged[name]) for name in names
        ),
        differences=tuple(
            TrainedDifference(of, _spread(100 * (accuracy[of.planner] - accuracy[of.other]).mean(axis=1)))
            for of in differences
        ),
    )


def _planner(
    held: PlannerAccuracy,
    accuracy: Mapping[str, FloatArray],
    rows: Mapping[str, FloatArray],
    draws: IntArray,
    resamples: Resamples,
    *,
    privileged: bool,
) -> TrainedPlanner:
    """Return the results of one planner.

    Args:
        held: its accuracy, over all trainings.
        accuracy: the accuracy of each planner, (T, N).
        rows: the same in every row of the resamples, (T, rows).
        draws: (rows, T), how often each training is drawn.
        resamples: the resamples.
        privileged: whether it was handed the truth.
    """
    shares, ends = np.full(1, np.nan), None
    if {NO_ACT, ORACLE} <= accuracy.keys():
        own, low, high = (accuracy[name].mean(axis=1) for name in (held.name, NO_ACT, ORACLE))
        shares = gap_closed(own, low, high)
        if np.isfinite(shares).all():
            of_own, of_low, of_high = (rows[name] for name in (held.name, NO_ACT, ORACLE))
            # To first order the share of a training varies as this does; see `summarise`.
            linear = shares[:, None] + (of_own - of_low - shares[:, None] * (of_high - of_low)) / (high - low)[:, None]
            resampled = _drawn(gap_closed(of_own, of_low, of_high), draws)
            ends = pair(resamples.interval(float(shares.mean()), resampled, linear=_drawn(linear, draws)))
    exist = bool(np.isfinite(shares).all())
    return TrainedPlanner(
        name=held.name,
        privileged=privileged,
        acc_mean=100 * held.mean,
        acc_mean_ci95=pair(100 * resamples.interval(held.mean, held.resampled, bounds=(0, 1))),
        acc_mean_sd=_spread(100 * accuracy[held.name].mean(axis=1)),
        gap_closed=float(shares.mean()) if exist else None,
        gap_closed_ci95=ends,
        gap_closed_sd=_spread(shares) if exist else None,
    )


def _drawn(values: FloatArray, draws: IntArray) -> FloatArray:
    """Return the mean over the drawn trainings in each row, (rows,) from (T, rows)."""
    drawn: FloatArray = np.where(draws.T > 0, draws.T * values, 0.0).sum(axis=0) / len(values)
    return drawn


def _by_sequence(seeds: Sequence[np.ndarray], resamples: Resamples) -> FloatArray:
    """Return the accuracy in each sequence, (S,), as the mean over a planner's own seeds."""
    found: FloatArray = np.mean([accuracy_by_sequence(correct, resamples.clusters) for correct in seeds], axis=0)
    return found


def _spread(values: FloatArray) -> float:
    return float(np.std(values, ddof=1))
