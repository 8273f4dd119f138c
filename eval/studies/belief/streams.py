"""The belief in streams against the recogniser's own words, on people whom nobody has met, and without each part."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.scenario import split_parts, strangers
from ehar.data.streams.data import NO_ACTIVITY, StreamData
from ehar.errors import UsageError
from ehar.files import json_text, write_text
from ehar.planner import Planner
from ehar.rollout import Record
from eval.records.config import planner_config, run_config
from eval.records.episodes import EpisodeRecords, record_episodes
from eval.records.run_files import BELIEF_JSON, check_out
from eval.running.episodes import Episodes, check_scored, cut_scenarios, random_starts
from eval.running.jobs import Workload
from eval.running.progress import Reporter
from eval.studies.belief.stream_report import BELIEF, OF, RECOGNISER, StreamBeliefReport, read_report, write_report
from planners.heuristic import NoAct, Random
from planners.value.belief.filters import read_streams
from planners.value.belief.streams import StreamBeliefModel
from planners.value.belief.streams_fit import fit_evidence, learn_chain
from planners.value.view_basis import DistanceRange
from recognition.setting import Setting


class StreamRollouts(NamedTuple):
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
    heard = np.concatenate([parts.policy, parts.validation])
    heard = heard[streams.lengths[heard] >= setting.conditions.frames]
    unknown = strangers(streams, heard if len(heard) else parts.policy)
    learned, tested = (_episodes(setting, some, reporter) for some in (unknown, parts.test))
    check_scored(tested.scenarios)
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
        write_text(Path(out) / BELIEF_JSON, [json_text(asdict(beliefs[BELIEF]))])
        write_report(Path(out), report)
    return report


def _fitted(
    chain: StreamBeliefModel, rolled: list[StreamRollouts], fps: float, span: DistanceRange
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


def _rolled(setting: Setting, episodes: Episodes, planner: Planner, reporter: Reporter) -> StreamRollouts:
    """Run a planner over all episodes, and keep the probabilities of all classes."""
    workload, records = Workload(setting.runner, episodes), []
    for chunk in range(episodes.chunks):
        motion = setting.runner.new_motion()
        records.append(workload.roll(planner, workload.followed.batch(chunk), chunk, motion))
        reporter.advance(planner.name)
    log_probs, viewpoints = (
        np.concatenate([getattr(record, name) for record in records]) for name in ("log_probs", "viewpoints")
    )
    return StreamRollouts(episodes, log_probs, viewpoints)


def _said(rolled: StreamRollouts, beliefs: Mapping[str, StreamBeliefModel], fps: float) -> dict[str, EpisodeRecords]:
    """Return what the recogniser and each belief say of the same episodes, by name."""
    said = {RECOGNISER: rolled.log_probs.astype(np.float64)}
    for name, belief in beliefs.items():
        said[name] = np.log(np.maximum(read_streams(belief, rolled.log_probs, rolled.viewpoints, fps=fps), 1e-300))
    return {name: _records(rolled, log_probs) for name, log_probs in said.items()}


def _records(rolled: StreamRollouts, log_probs: FloatArray) -> EpisodeRecords:
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
