"""What readers of streams said, the recogniser and beliefs, as a report: how good it is, and how much better."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.streams.data import NO_ACTIVITY
from ehar.files import write_text
from eval.records.config import RunConfig
from eval.records.episodes import EpisodeRecords, join_records
from eval.records.run_files import TABLE
from eval.render.tables import Table, interval_text, markdown
from eval.running.run import write_records
from eval.scores.metrics import PROBABILITY_FLOOR
from eval.scores.planner_metrics import ECE, NLL
from eval.scores.resampling.resamples import Basis, Resamples, resample_episodes
from eval.scores.resampling.statistics import Interval, pair, why_no_intervals
from eval.scores.resampling.training_seeds import PlannerGroup, families, group_planners, resample_seeds
from eval.scores.streams.activities import activities
from eval.scores.streams.alarms import alarms_per_minute
from eval.scores.streams.equal_alarms import restrained
from eval.scores.streams.table import STREAM_HEADER, STREAM_NOTES, stream_row
from eval.scores.summary_table import basis_lines

if TYPE_CHECKING:
    from planners.value.belief.streams import StreamBeliefModel

RECOGNISER, BELIEF = "recogniser", "belief"
OF = ": "  # between a planner and a reader, in names of records


@dataclass(frozen=True)
class ScoredReader:
    """Whose probabilities are scored, for cameras that one planner moves.

    Args:
        rollouts: name of the planner.
        name: recogniser, belief, or a belief without one of its parts.
        records: what it says, training after training.
        nll: mean negative log-likelihood of the true class of each frame [nat].
        ece: expected calibration error, 0 to 1.
        better: how much lower its NLL is than the recogniser's [nat].
        better_ci95: the 95 % interval of that, over people; None where there can be none.
        alarms: false alarms a minute that all readers are granted for the two figures below: those of the recogniser
            or of the belief, whoever raises fewer.
        delay_s: mean delay [s] if it answers only from a probability on at which it raises no more.
        sooner_s: how much shorter that is than the recogniser's [s].
        sooner_ci95: the 95 % interval of that.
    """

    rollouts: str
    name: str
    records: EpisodeRecords
    nll: float
    ece: float
    better: float
    better_ci95: Interval | None
    alarms: float
    delay_s: float
    sooner_s: float
    sooner_ci95: Interval | None


@dataclass(frozen=True, repr=False)
class StreamBeliefReport:
    """The belief in streams against the recogniser.

    Args:
        config: everything that decides the report.
        records: what every reader says, by record name: the planner, `OF`, and the reader.
        readers: planner by planner, the recogniser first.
        model: the full belief; None of folds and trainings, each of which has its own.
        basis: the people that intervals rest on.
        no_intervals: why there are none; None if there are.
        fps: frames per second.
    """

    config: RunConfig
    records: Mapping[str, EpisodeRecords]
    readers: tuple[ScoredReader, ...]
    model: "StreamBeliefModel | None"
    basis: Basis
    no_intervals: str | None
    fps: float

    @property
    def episodes(self) -> int:
        """The number of episodes of each planner."""
        return len(next(iter(self.records.values())))

    def tables(self) -> list[Table]:
        """Return one row for each reader."""
        lines = basis_lines(self.basis, self.no_intervals)
        told = self.config.conditions
        return [
            Table(
                title=f"{self.config.data}: sensor {told.sensor}, {self.episodes} test episodes of "
                f"{told.frames / self.fps:g} s for each planner",
                header=(
                    *("planner", "reader", "NLL", "lower by [95 %]", "ECE", *STREAM_HEADER),
                    *("equal alarms: delay [s]", "sooner by [95 %]"),
                ),
                rows=tuple(
                    (
                        reader.rollouts,
                        reader.name,
                        f"{reader.nll:.3f}",
                        ""
                        if reader.name == RECOGNISER
                        else f"{reader.better:+.3f} {interval_text(reader.better_ci95, digits=3)}",
                        f"{reader.ece:.3f}",
                        *stream_row(reader.records, self.fps),
                        f"{reader.delay_s:.2f}",
                        ""
                        if reader.name == RECOGNISER
                        else f"{reader.sooner_s:+.2f} {interval_text(reader.sooner_ci95, digits=2)}",
                    )
                    for reader in self.readers
                ),
                footnotes=(
                    "NLL: of the true class of each frame [nat], no activity among them; lower than the recogniser's.",
                    *STREAM_NOTES,
                    self._alarms_told(),
                    "Intervals of lower by and sooner by are each for itself: they are not corrected together.",
                    *lines.footnotes,
                ),
                notice=lines.notice,
            )
        ]

    def _alarms_told(self) -> str:
        """Return the footnote on equal alarms."""
        granted = dict.fromkeys((reader.rollouts, reader.alarms) for reader in self.readers)
        rates = ", ".join(f"{alarms:.1f} with {planner}" for planner, alarms in granted)
        return (
            "Equal alarms: a reader names an activity only from a probability on at which it raises no more false "
            f"alarms a minute than whoever of recogniser and belief raises fewer ({rates}), chosen on these streams "
            "themselves; sooner than the recogniser."
        )


def read_report(
    config: RunConfig, records: Mapping[str, EpisodeRecords], fps: float, *, model: "StreamBeliefModel | None" = None
) -> StreamBeliefReport:
    """Return the report of what readers said of the same episodes.

    Args:
        config: everything that decided them.
        records: what each says, by the planner that moved the cameras, `OF`, and its own name; of each planner the
            recogniser and the belief are among them. Of several trainings `SHARED` and a number follow; a figure is
            the mean over them, and its interval draws trainings too.
        fps: frames per second.
        model: the full belief.
    """
    by_planner: dict[str, dict[str, PlannerGroup]] = {}
    for group in group_planners(records):
        planner, reader = group.name.split(OF)
        by_planner.setdefault(planner, {})[reader] = group
    any_reader = next(iter(records.values()))
    shown = np.unique(any_reader.label[any_reader.label != NO_ACTIVITY])
    resamples = _resamples(any_reader, why_no_intervals(len(set(any_reader.sequence)), len(shown)), records)
    return StreamBeliefReport(
        config=config,
        records=records,
        readers=tuple(
            reader
            for planner, groups in by_planner.items()
            for reader in _scored(planner, groups, records, fps, resamples)
        ),
        model=model,
        basis=resamples.basis,
        no_intervals=resamples.why_none,
        fps=fps,
    )


def write_report(out: Path, report: StreamBeliefReport) -> None:
    """Write config.json, episodes.jsonl with what every reader says, and table.md."""
    write_records(out, report.config, report.records, None)
    write_text(out / TABLE, [markdown(*report.tables())])


def _resamples(records: EpisodeRecords, why_none: str | None, names: Iterable[str]) -> Resamples:
    """Return the resamples of some episodes, with trainings if record names have some."""
    resamples = resample_episodes(np.array(records.sequence), records.subjects, why_none=why_none)
    return resamples.with_trainings(families(group_planners(names)))


def _scored(
    planner: str,
    groups: Mapping[str, PlannerGroup],
    records: Mapping[str, EpisodeRecords],
    fps: float,
    resamples: Resamples,
) -> list[ScoredReader]:
    """Return how good the words of each reader are, for cameras that one planner moved.

    Args:
        planner: name of the planner.
        groups: the trainings of each reader, by its name.
        records: what every reader says, by record name.
        fps: frames per second.
        resamples: resamples of the episodes.
    """
    held = {name: [records[record] for record in group.records] for name, group in groups.items()}
    losses = {name: np.stack([_losses(said) for said in trained]) for name, trained in held.items()}  # (T, N) each
    # In each training the readers are granted as many false alarms as whoever raises fewer there.
    alarms = [
        min(alarms_per_minute(said.label, said.predicted, fps) for said in of_training)
        for of_training in zip(held[RECOGNISER], held[BELIEF], strict=True)
    ]
    waits = {
        name: np.stack([restrained(said, fps, most).delays for said, most in zip(trained, alarms, strict=True)]) / fps
        for name, trained in held.items()
    }
    of_activities = _resamples(activities(held[RECOGNISER][0]), resamples.why_none, records)
    readers = []
    for name, trained in held.items():
        better, sooner = losses[RECOGNISER] - losses[name], waits[RECOGNISER] - waits[name]
        readers.append(
            ScoredReader(
                rollouts=planner,
                name=name,
                records=join_records(trained),
                nll=float(np.mean([NLL.of_records(said) for said in trained])),
                ece=float(np.mean([ECE.of_records(said) for said in trained])),
                better=float(better.mean()),
                better_ci95=_ends(better, groups[name], resamples),
                alarms=float(np.mean(alarms)),
                delay_s=float(waits[name].mean()),
                sooner_s=float(sooner.mean()),
                sooner_ci95=_ends(sooner, groups[name], of_activities),
            )
        )
    return readers


def _ends(values: FloatArray, group: PlannerGroup, resamples: Resamples) -> Interval | None:
    """Return the 95 % interval of the mean of values (T, N), or None where there can be none."""
    if not resamples.full:
        return None
    alone = replace(group, rows=tuple(range(len(values))))
    return pair(resamples.interval(values.mean(), resample_seeds(resamples.means(values), [alone], resamples)[0]))


def _losses(records: EpisodeRecords) -> FloatArray:
    """Return the mean NLL of each episode, (N,) [nat]."""
    losses: FloatArray = -np.log(np.maximum(records.true_probability, PROBABILITY_FLOOR)).mean(axis=1)
    return losses
