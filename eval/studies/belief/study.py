"""The belief study: the belief against the recogniser on test episodes, and the worth of each part of the belief."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.conditions import Conditions
from ehar.data.scenario import split_parts, windows
from ehar.data.streams.data import StreamData
from ehar.errors import DataError
from ehar.files import json_text, write_text
from ehar.planner import Planner
from eval.records.config import CONFIG, RunConfig, planner_config, run_config
from eval.records.run_files import BELIEF_JSON, TABLE, check_out
from eval.render.tables import Table, markdown
from eval.running.choice import ModelPlace
from eval.running.episodes import cut_scenarios, random_starts
from eval.running.jobs import Workload
from eval.running.progress import ConsoleReporter, Reporter
from eval.scores.metrics import CALIBRATED_FROM, frame_at, late_ece, nll
from eval.studies.belief.stream_report import StreamBeliefReport
from eval.studies.belief.streams import stream_belief_report
from planners.heuristic import NoAct, Random
from planners.value.belief.clips_fit import ablate_belief
from planners.value.belief.recorded import read_belief
from recognition.setting import load_setting

NLL_AT = tuple(range(10, 101, 10))  # observation ratios [%]


@dataclass(frozen=True)
class BeliefRow:
    """How good the probabilities of one reader are.

    Args:
        rollouts: name of the planner that moved the camera.
        reader: recogniser, belief, or a belief without some of its parts.
        nll_at: mean negative log-likelihood [nat] of the true class after 10 to 100 % of the frames.
        nll: the same, mean over all frames.
        ece_late: expected calibration error, 0 to 1, of the frames from `CALIBRATED_FROM` on.
    """

    rollouts: str
    reader: str
    nll_at: dict[str, float]
    nll: float
    ece_late: float


@dataclass(frozen=True)
class BeliefReport:
    """The belief against the recogniser.

    Args:
        config: everything that decides the report.
        test: belief and recogniser on the test part.
        test_episodes: number of test episodes of each planner.
        parts: beliefs with and without each of their parts, fitted on one half of the policy part's sequences and
            scored on the other.
        parts_episodes: number of episodes that these beliefs are scored on.
    """

    config: RunConfig
    test: tuple[BeliefRow, ...]
    test_episodes: int
    parts: tuple[BeliefRow, ...]
    parts_episodes: int

    def to_json(self) -> dict[str, Any]:
        """Return the content of belief.json."""
        return {name: value for name, value in asdict(self).items() if name != "config"}

    def tables(self) -> list[Table]:
        """Return the tables of the study."""
        return belief_tables(self)


class Rollouts(NamedTuple):
    """The recognition in N episodes."""

    log_probs: FloatArray  # (N, L, K), of the recogniser
    viewpoints: FloatArray  # (N, L, 3)
    labels: IntArray  # (N,)
    sequences: IntArray  # (N,), indices of sequences in the data


def belief_report(
    conditions: Conditions | None = None, *, out: str | Path | None = None, reporter: Reporter | None = None
) -> BeliefReport | StreamBeliefReport:
    """Score the belief and the recogniser with cameras that stay, and with cameras that move at random.

    Streams have a belief of their own: see `eval.studies.belief.streams`.

    For example:
        ehar study belief --data duo --sensor estimator

    Args:
        conditions: conditions of the episodes; None takes the defaults.
        out: folder for config.json, belief.json and table.md.
        reporter: receives progress; None reports on standard error.

    Raises:
        EharError: one line that says what was got and what was expected.
    """
    conditions, reporter = conditions or Conditions(), reporter or ConsoleReporter()
    setting = load_setting(conditions)
    if isinstance(setting.recordings, StreamData):
        return stream_belief_report(setting, out=out, reporter=reporter)
    motion, parts = setting.data, split_parts(setting.data)
    model = ModelPlace.of(setting).load_gain_model()
    planners: list[Planner] = [NoAct(), Random()]
    config = run_config(
        setting,
        [planner_config(planner) for planner in planners],
        readout="belief",
        gain_model_sha256=model.sha256,
        lengths={"gain field": model.length},
    )
    for warning in config.warnings:
        reporter.note(f"warning: {warning}")
    if out is not None:
        check_out(Path(out), config.to_json())
    length, starts, seed = conditions.frames, conditions.starts, conditions.seed
    tested = random_starts(cut_scenarios(motion, parts.test, length, reporter.note), starts, seed, setting.world)
    policy = windows(motion, parts.policy, length, stride=length)
    if not len(policy):
        raise DataError(f"{motion.name}: expected policy sequences of at least {length} frames, got none")
    trained = random_starts(policy, starts, seed, setting.world)
    reporter.begin(len(planners) * (tested.chunks + trained.chunks))
    try:
        test = {planner.name: run_rollouts(Workload(setting.runner, tested), planner, reporter) for planner in planners}
        fitted = [run_rollouts(Workload(setting.runner, trained), planner, reporter) for planner in planners]
    finally:
        reporter.end()
    rows = []
    for name, rolled in test.items():
        believed = read_belief(model.belief, rolled.log_probs, rolled.viewpoints, fps=setting.data.fps)
        rows += [belief_row(name, "recogniser", rolled.log_probs, rolled.labels)]
        rows += [belief_row(name, "belief", believed, rolled.labels)]
    together = Rollouts(*(np.concatenate(arrays) for arrays in zip(*fitted, strict=True)))
    ablation = ablate_belief(*together, np.random.default_rng(seed), span=model.belief.span)
    report = BeliefReport(
        config=config,
        test=tuple(rows),
        test_episodes=len(tested),
        parts=tuple(
            belief_row(" and ".join(test), reader, log_probs, ablation.labels)
            for reader, log_probs in ablation.log_probs.items()
        ),
        parts_episodes=len(ablation.labels),
    )
    if out is not None:
        _write(Path(out), report)
    return report


def run_rollouts(workload: Workload, planner: Planner, reporter: Reporter) -> Rollouts:
    """Run a planner over all episodes, and keep the probabilities of all classes."""
    records, episodes = [], workload.episodes
    for chunk in range(episodes.chunks):
        motion = workload.runner.new_motion()
        records.append(workload.roll(planner, workload.followed.batch(chunk), chunk, motion))
        reporter.advance(planner.name)
    return Rollouts(
        log_probs=np.concatenate([record.log_probs for record in records]),
        viewpoints=np.concatenate([record.viewpoints for record in records]),
        labels=episodes.labels,
        sequences=episodes.scenarios.sequence[episodes.scenario],
    )


def belief_row(rollouts: str, reader: str, log_probs: FloatArray, labels: IntArray) -> BeliefRow:
    """Score log-probabilities (N, L, K) against true classes (N,)."""
    probabilities = np.exp(log_probs.astype(np.float64))
    true = np.take_along_axis(probabilities, labels[:, None, None], axis=-1)[..., 0]
    length = true.shape[1]
    frames = {percent: frame_at(percent, length) for percent in NLL_AT}
    return BeliefRow(
        rollouts=rollouts,
        reader=reader,
        nll_at={str(percent): nll(true[:, frames[percent]]) for percent in NLL_AT},
        nll=nll(true),
        ece_late=late_ece(probabilities.max(axis=-1), probabilities.argmax(axis=-1) == labels[:, None]),
    )


def belief_tables(report: BeliefReport) -> list[Table]:
    """Return two tables: the belief against the recogniser on test, and the worth of each part of the belief."""
    config = report.config
    return [
        _table(
            f"{config.data}: sensor {config.conditions.sensor}, views {config.conditions.views}, "
            f"{report.test_episodes} test episodes of {config.conditions.frames} frames for each planner",
            report.test,
            (f"NLL: of the true class [nat]. ECE: calibration error of the frames from {CALIBRATED_FROM} % on.",),
        ),
        _table(
            f"What each part of the belief is worth: {report.parts_episodes} episodes of policy sequences "
            "that it was not fitted on",
            report.parts,
            ('"+" adds one part to "difference" alone; "full" has them all.',),
        ),
    ]


def _table(title: str, rows: Sequence[BeliefRow], footnotes: tuple[str, ...]) -> Table:
    return Table(
        title=title,
        header=("reader", "planner", *(f"NLL@{percent}" for percent in NLL_AT), "mean NLL", "ECE"),
        rows=tuple(
            (
                row.reader,
                row.rollouts,
                *(f"{row.nll_at[str(percent)]:.3f}" for percent in NLL_AT),
                f"{row.nll:.3f}",
                f"{row.ece_late:.3f}",
            )
            for row in rows
        ),
        footnotes=footnotes,
    )


def _write(out: Path, report: BeliefReport) -> None:
    """Write the configuration, numbers and tables."""
    write_text(out / CONFIG, [json_text(report.config.to_json())])
    write_text(out / BELIEF_JSON, [json_text(report.to_json())])
    write_text(out / TABLE, [markdown(*belief_tables(report))])
