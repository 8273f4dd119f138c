"""The data of a report on a finished run, except its replay."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.streams.data import NO_ACTIVITY_NAME
from eval.records.episodes import EpisodeRecords, join_records
from eval.reports.delays import ClassDelays, class_delays
from eval.running.run import Run
from eval.scores.answers import answers_of, episodes_only
from eval.scores.behaviour import (
    PositionHistogram,
    SphereDensity,
    level_share,
    move_shares,
    position_histograms,
    recover_moves,
    sphere_density,
)
from eval.scores.confusion import ClassGains, class_gains, confusion
from eval.scores.metrics import Reliability, reliability
from eval.scores.planner_accuracy import accuracy_bands, draw_resamples
from eval.scores.planner_summary import NO_ACT
from eval.scores.predictability import Predictability, predictability
from eval.scores.resampling.training_seeds import curves, group_planners
from eval.scores.seed_accuracy import pool_seeds, seeds_of
from eval.scores.summary import Summary

STAGED_FROM = 4  # frames that an episode needs for three stages


@dataclass(frozen=True, eq=False)
class PlannerData:
    """The data of one planner, from the records of all its trainings together.

    Args:
        reliability: reliability diagram.
        confusion: (K, K) confusion of classes; in streams (K + 1, K + 1), the last one is no activity.
        gains: gains over no-act, by class; None for no-act itself, or if no-act did not run.
        positions: histograms of distance, azimuth and polar angle.
        level_share: share of frames about level with the people.
        sphere: density of camera directions, seen from above.
        moves: (4, 7), shares of moves by stage; None for flights and for episodes that are too short.
        predictability: predictability of classes.
        delays: of streams, how long the activities of each class take to be recognised; None for clips.
    """

    reliability: Reliability
    confusion: FloatArray
    gains: ClassGains | None
    positions: tuple[PositionHistogram, ...]
    level_share: float
    sphere: SphereDensity
    moves: FloatArray | None
    predictability: Predictability
    delays: ClassDelays | None = None


@dataclass(frozen=True, eq=False)
class ReportData:
    """The data of a report.

    Args:
        run: the run, with conditions and records.
        class_names: K class names.
        curves: (L,) accuracy after each frame, by planner; of streams (20,), after equal shares of activities.
        bands: (L, 2) 95 % interval of that accuracy, by planner; NaN without an interval.
        planners: data of each planner by name, in the order of the run.
        reference: the episodes, which all planners share; nothing of what happened in them.
    """

    run: Run
    class_names: tuple[str, ...]
    curves: Mapping[str, FloatArray]
    bands: Mapping[str, FloatArray]
    planners: Mapping[str, PlannerData]
    reference: EpisodeRecords

    @property
    def summary(self) -> Summary:
        """The run's summary."""
        return self.run.summary

    @property
    def of_streams(self) -> bool:
        """Whether the run is of streams."""
        return self.run.of_streams

    @property
    def watched(self) -> str:
        """What is observed share by share."""
        return "activity" if self.of_streams else "episode"

    @property
    def plural(self) -> str:
        """What is recognised, in the plural."""
        return "activities" if self.of_streams else "episodes"

    @property
    def recognised_names(self) -> tuple[str, ...]:
        """The names of all that is told apart; in streams, no activity comes last."""
        return (*self.class_names, NO_ACTIVITY_NAME) if self.of_streams else self.class_names

    @property
    def privileged(self) -> dict[str, bool]:
        """Whether each planner was handed the truth."""
        return {planner.name: planner.privileged for planner in self.summary.planners}

    @property
    def lead(self) -> str | None:
        """The planner that leads, see `Summary.lead`."""
        return self.summary.lead


def report_data(run: Run, class_names: tuple[str, ...]) -> ReportData:
    """Compute what a report shows; one planner's records are in memory at a time.

    Args:
        run: the run, with records, conditions and summary.
        class_names: K class names.
    """
    scored = answers_of(run.records)
    resamples = draw_resamples(list(scored.values()), group_planners(scored))
    pooled = pool_seeds(run.records)
    return ReportData(
        run=run,
        class_names=class_names,
        curves=curves(scored),
        bands=accuracy_bands(scored, resamples),
        planners={name: _planner(name, held, seeds_of(scored), len(class_names), run) for name, held in pooled.items()},
        reference=episodes_only(next(iter(run.records.values()))),
    )


def _planner(
    name: str,
    pooled: EpisodeRecords,
    trainings: Mapping[str, list[EpisodeRecords]],
    classes: int,
    run: Run,
) -> PlannerData:
    """Return the data of one planner.

    Args:
        name: its name.
        pooled: records of all its trainings.
        trainings: the answers that accuracies are taken of, by planner, one for each training.
        classes: K.
        run: the run.
    """
    workspace, of_streams = run.config.world.workspace, pooled.of_streams
    staged = not run.flown and pooled.predicted.shape[1] >= STAGED_FROM
    compared = NO_ACT in trainings and name != NO_ACT
    return PlannerData(
        reliability=reliability(pooled.top_probability, pooled.correct),
        confusion=confusion(pooled, classes + of_streams),
        gains=class_gains(trainings[name], trainings[NO_ACT], classes) if compared else None,
        positions=position_histograms(pooled, workspace),
        level_share=level_share(pooled),
        sphere=sphere_density(pooled.viewpoint, workspace),
        moves=move_shares(recover_moves(pooled, workspace)) if staged else None,
        predictability=predictability(join_records(trainings[name]), classes),
        delays=class_delays(pooled, classes) if of_streams else None,
    )


def finite(values: FloatArray, digits: int) -> list[Any]:
    """Return rounded numbers for JSON, with None in place of those that are not finite."""
    rounded = np.round(np.asarray(values, dtype=np.float64), digits)
    listed: list[Any] = np.where(np.isfinite(rounded), rounded.astype(object), np.array(None)).tolist()
    return listed
