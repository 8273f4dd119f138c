"""The belief in streams against the recogniser's own words, on people whom nobody has met, and without each part."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.scenario import Parts, split_parts
from ehar.data.streams.data import NO_ACTIVITY, StreamData
from ehar.errors import UsageError
from ehar.files import json_text, write_text
from ehar.planner import Planner
from ehar.rollout import Record
from eval.records.config import RunConfig, planner_config, run_config
from eval.records.episodes import EpisodeRecords, record_episodes
from eval.records.run_files import BELIEF_JSON, check_out
from eval.render.tables import Table, interval_text, markdown
from eval.running.episodes import Episodes, cut_scenarios, random_starts
from eval.running.jobs import Workload
from eval.running.progress import Reporter
from eval.running.run import write_records
from eval.scores.metrics import PROBABILITY_FLOOR
from eval.scores.planner_metrics import ECE, NLL
from eval.scores.resampling.resamples import Basis, Resamples, resample_episodes
from eval.scores.resampling.statistics import Interval, pair, why_no_intervals
from eval.scores.streams.activities import activities
from eval.scores.streams.alarms import alarms_per_minute
from eval.scores.streams.equal_alarms import restrained
from eval.scores.streams.table import STREAM_HEADER, STREAM_NOTES, stream_row
from eval.scores.summary_table import basis_lines
from planners.heuristic import NoAct, Random
from planners.value.belief.filters import read_streams
from planners.value.belief.streams import StreamBeliefModel
from planners.value.belief.streams_fit import fit_evidence, learn_chain
from planners.value.view_basis import DistanceRange
from recognition.setting import Setting

RECOGNISER, BELIEF = "recogniser", "belief"
OF = ": "  # between a planner and a reader, in names of records


@dataclass(frozen=True)
class Reader:
    """Whose probabilities are scored, for cameras that one planner moves.

    Args:
        rollouts: name of the planner.
        name: recogniser, belief, or a belief without one of its parts.
        records: what it says.
        better: how much lower its mean NLL is than the recogniser's [nat].
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
        readers: planner by planner, the recogniser first.
        model: the full belief; None of folds, each of which has its own.
        basis: the people that intervals rest on.
        no_intervals: why there are none; None if there are.
        fps: frames per second.
    """

    config: RunConfig
    readers: tuple[Reader, ...]
    model: StreamBeliefModel | None
    basis: Basis
    no_intervals: str | None
    fps: float

    def tables(self) -> list[Table]:
        """Return one row for each reader."""
        lines = basis_lines(self.basis, self.no_intervals)
        told = self.config.conditions
        return [
            Table(
                title=f"{self.config.data}: sensor {told.sensor}, {len(self.readers[0].records)} test episodes of "
                f"{told.frames / self.fps:g} s for each planner",
                header=(
                    *("planner", "reader", "NLL", "lower by [95 %]", "ECE", *STREAM_HEADER),
                    *("equal alarms: delay [s]", "sooner by [95 %]"),
                ),
                rows=tuple(
                    (
                        reader.rollouts,
                        reader.name,
                        f"{NLL.of_records(reader.records):.3f}",
                        ""
                        if reader.name == RECOGNISER
                        else f"{reader.better:+.3f} {interval_text(reader.better_ci95, digits=3)}",
                        f"{ECE.of_records(reader.records):.3f}",
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
            f"alarms a minute than whoever of recogniser and belief raises fewer ({rates}); sooner than the recogniser."
        )


class Rollouts(NamedTuple):
    """What the recogniser said in N episodes."""

    episodes: Episodes
    log_probs: FloatArray  # (N, L, K + 1)
    viewpoints: FloatArray  # (N, L, 3)

    @property
    def labels(self) -> IntArray:
        """The class of each frame, (N, L)."""
        labels, none = self.episodes.labels, self.log_probs.shape[-1] - 1
        return np.where(labels == none, NO_ACTIVITY, labels)


def stream_belief_report(setting: Setting, *, out: str | Path | None, reporter: Reporter) -> StreamBeliefReport:
    """Score the belief in streams and the recogniser, with cameras that stay and with cameras that move at random.

    How long activities last and what follows what is learned from the segments of the policy part. What a frame tells
    is learned from rollouts on people whom the recogniser does not know, as the recogniser is surer of those it knows.
    Nobody of either is in the test.

    Args:
        setting: the streams, and who sees them.
        out: folder for config.json, episodes.jsonl, belief.json, which `ehar live` takes, and table.md.
        reporter: receives progress.

    Raises:
        UsageError: the data are trimmed sequences, or `out` cannot be written to.
        DataError: the policy part lacks a class, or streams are too short.
    """
    streams = setting.recordings
    if not isinstance(streams, StreamData):
        raise UsageError(f"{streams.name}: expected streams, got trimmed sequences")
    planners: list[Planner] = [NoAct(), Random()]
    config = run_config(setting, [planner_config(planner) for planner in planners], readout="belief")
    for warning in config.warnings:
        reporter.note(f"warning: {warning}")
    if out is not None:
        check_out(Path(out), config.to_json())
    parts = split_parts(streams)
    chain = learn_chain(streams, parts.policy, parts.recogniser)
    unknown = strangers(streams, parts, setting.conditions.frames)
    learned, tested = (_episodes(setting, some, reporter) for some in (unknown, parts.test))
    reporter.begin(len(planners) * (learned.chunks + tested.chunks))
    try:
        fitting = [_rolled(setting, learned, planner, reporter) for planner in planners]
        test = {planner.name: _rolled(setting, tested, planner, reporter) for planner in planners}
    finally:
        reporter.end()
    span = DistanceRange.of(setting.world.workspace)
    beliefs = _fitted(chain, fitting, streams.fps, span)
    records = {
        f"{name}{OF}{reader}": held
        for name, rolled in test.items()
        for reader, held in _said(rolled, beliefs, streams.fps).items()
    }
    report = read_report(config, records, streams.fps, model=beliefs[BELIEF])
    if out is not None:
        write_report(Path(out), report)
        write_text(Path(out) / BELIEF_JSON, [json_text(asdict(beliefs[BELIEF]))])
    return report


def read_report(
    config: RunConfig, records: Mapping[str, EpisodeRecords], fps: float, *, model: StreamBeliefModel | None = None
) -> StreamBeliefReport:
    """Return the report of what readers said of the same episodes.

    Args:
        config: everything that decided them.
        records: what each says, by the planner that moved the cameras, `OF`, and its own name; of each planner the
            recogniser and the belief are among them.
        fps: frames per second.
        model: the full belief.
    """
    by_planner: dict[str, dict[str, EpisodeRecords]] = {}
    for name, held in records.items():
        planner, reader = name.split(OF)
        by_planner.setdefault(planner, {})[reader] = held
    any_reader = next(iter(records.values()))
    shown = np.unique(any_reader.label[any_reader.label != NO_ACTIVITY])
    resamples = resample_episodes(
        np.array(any_reader.sequence),
        any_reader.subjects,
        why_none=why_no_intervals(len(set(any_reader.sequence)), len(shown)),
    )
    return StreamBeliefReport(
        config=config,
        readers=tuple(
            reader for planner, held in by_planner.items() for reader in _scored(planner, held, fps, resamples)
        ),
        model=model,
        basis=resamples.basis,
        no_intervals=resamples.why_none,
        fps=fps,
    )


def write_report(out: Path, report: StreamBeliefReport) -> None:
    """Write config.json, episodes.jsonl with what every reader says, and table.md."""
    records = {f"{reader.rollouts}{OF}{reader.name}": reader.records for reader in report.readers}
    write_records(out, report.config, records, None)
    write_text(out / "table.md", [markdown(*report.tables())])


def strangers(data: StreamData, parts: Parts, length: int) -> IntArray:
    """Return the streams of the policy and validation parts of people whom the recogniser does not know.

    Where there are none of `length` frames, or the data do not say who performs, it is the policy part.
    """
    others = np.concatenate([parts.policy, parts.validation])
    known = np.isin(data.subjects[others], data.subjects[parts.recogniser]).any(axis=1)
    others = np.sort(others[~known & (data.lengths[others] >= length)])
    return others if len(others) else parts.policy


def _fitted(
    chain: StreamBeliefModel, rolled: list[Rollouts], fps: float, span: DistanceRange
) -> dict[str, StreamBeliefModel]:
    """Return the belief and what it is without each part, by name, each after it has learned what a frame tells."""
    log_probs, viewpoints, labels = (
        np.concatenate([getattr(one, name) for one in rolled]) for name in ("log_probs", "viewpoints", "labels")
    )

    def fitted(part: StreamBeliefModel, viewpoint: bool = True) -> StreamBeliefModel:
        return fit_evidence(part, log_probs, viewpoints, labels, fps=fps, viewpoint=viewpoint, span=span)

    return {
        BELIEF: fitted(chain),
        "without transitions": fitted(chain.without_transitions()),
        "without durations": fitted(chain.without_durations()),
        "without viewpoint": fitted(chain, viewpoint=False),
    }


def _episodes(setting: Setting, streams: IntArray, reporter: Reporter) -> Episodes:
    """Return the episodes of some streams."""
    told = setting.conditions
    scenarios = cut_scenarios(setting.recordings, streams, told.frames, reporter.note)
    return random_starts(scenarios, told.starts, told.seed, setting.world)


def _rolled(setting: Setting, episodes: Episodes, planner: Planner, reporter: Reporter) -> Rollouts:
    """Run a planner over all episodes, and keep the probabilities of all classes."""
    workload, records = Workload(setting.runner, episodes), []
    for chunk in range(episodes.chunks):
        motion = setting.runner.new_motion()
        records.append(workload.roll(planner, workload.followed.batch(chunk), chunk, motion))
        reporter.advance(planner.name)
    log_probs, viewpoints = (
        np.concatenate([getattr(record, name) for record in records]) for name in ("log_probs", "viewpoints")
    )
    return Rollouts(episodes, log_probs, viewpoints)


def _said(rolled: Rollouts, beliefs: Mapping[str, StreamBeliefModel], fps: float) -> dict[str, EpisodeRecords]:
    """Return what the recogniser and each belief say of the same episodes, by name."""
    said = {RECOGNISER: rolled.log_probs.astype(np.float64)}
    for name, belief in beliefs.items():
        said[name] = np.log(np.maximum(read_streams(belief, rolled.log_probs, rolled.viewpoints, fps=fps), 1e-300))
    return {name: _records(rolled, log_probs) for name, log_probs in said.items()}


def _scored(planner: str, records: Mapping[str, EpisodeRecords], fps: float, resamples: Resamples) -> list[Reader]:
    """Return how good the words of each reader are, for cameras that one planner moved."""
    losses = {name: _losses(held) for name, held in records.items()}
    alarms = min(alarms_per_minute(records[name].label, records[name].predicted, fps) for name in (RECOGNISER, BELIEF))
    waits = {name: restrained(held, fps, alarms).delays / fps for name, held in records.items()}
    shown = activities(records[RECOGNISER])
    of_activities = resample_episodes(np.array(shown.sequence), shown.subjects, why_none=resamples.why_none)
    readers = []
    for name, held in records.items():
        better, sooner = losses[RECOGNISER] - losses[name], waits[RECOGNISER] - waits[name]
        readers.append(
            Reader(
                rollouts=planner,
                name=name,
                records=held,
                better=float(better.mean()),
                better_ci95=_ends(better, resamples),
                alarms=alarms,
                delay_s=float(waits[name].mean()),
                sooner_s=float(sooner.mean()),
                sooner_ci95=_ends(sooner, of_activities),
            )
        )
    return readers


def _ends(values: FloatArray, resamples: Resamples) -> Interval | None:
    """Return the 95 % interval of a mean, or None where there can be none."""
    return pair(resamples.interval(values.mean(), resamples.means(values))) if resamples.full else None


def _records(rolled: Rollouts, log_probs: FloatArray) -> EpisodeRecords:
    """Return records in which a reader's words stand for the recogniser's."""
    episodes = rolled.episodes
    return record_episodes(
        Record(rolled.viewpoints, log_probs, 0.0),
        sequence=episodes.sequence_names,
        first=episodes.first,
        start=episodes.starts,
        label=episodes.labels,
        subjects=episodes.subjects,
    )


def _losses(records: EpisodeRecords) -> FloatArray:
    """Return the mean NLL of each episode, (N,) [nat]."""
    losses: FloatArray = -np.log(np.maximum(records.true_probability, PROBABILITY_FLOOR)).mean(axis=1)
    return losses
