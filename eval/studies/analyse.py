"""The paper's analyses of a finished run: Table 3, Table 4, Fig. 6 and Fig. 7, as numbers, tables and pictures."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import UsageError
from ehar.files import json_text, write_text
from ehar.viewpoint import MOVE_NAMES
from eval.running.progress import ConsoleReporter, Reporter
from eval.running.run import Run, RunConditions, class_names, read_run
from eval.scores.behaviour import (
    STAGES,
    PositionHistogram,
    level_share,
    move_shares,
    position_histograms,
    recover_moves,
)
from eval.scores.predictability import Predictability, predictability
from eval.scores.seed_accuracy import TABLE_3, SeedAccuracy, accuracy_over_seeds, seeds_of
from eval.scores.summary import NO_ACT
from eval.studies.agent_states import (
    MOST,
    AgentLoader,
    AgentStates,
    Purity,
    agent_states,
    load_agent,
    map_states,
    neighbour_purity,
)

DEFAULTS = ("il-ppo", "nbv")  # the first that ran
ANALYSIS, TABLES = "analysis.json", "analysis.md"
POSITIONS, MOVES_MADE, STATES = "positions.png", "moves.png", "states.png"
FOLDER = "analysis"  # in the run's folder


@dataclass(frozen=True, eq=False)
class Positions:
    """Where a planner's cameras were (Fig. 6): a histogram an axis, and the share of frames level with the people."""

    histograms: tuple[PositionHistogram, ...]
    level_share: float


@dataclass(frozen=True, eq=False)
class StateMap:
    """States of a learned planner in the plane (Fig. 7e), and how well classes are told apart in them.

    Args:
        planner: whose, by record name.
        states: (M, ...), those drawn.
        mapped: (M, 2).
        purity: in the space of the states, not in the plane.
    """

    planner: str
    states: AgentStates
    mapped: FloatArray
    purity: Purity


@dataclass(frozen=True, eq=False)
class Analysis:
    """All analyses of a run.

    Args:
        conditions: of the run.
        episodes: how many, of each training seed.
        class_names: K.
        seed_accuracy: Table 3, those of its planners that ran.
        predictable: Table 4: of no-act, where it ran, and of each planner chosen.
        positions: Fig. 6, of the same.
        moves: Fig. 7a-d, of each planner chosen, (4, 7); None for a run in flight.
        states: Fig. 7e; None where no planner was named.
    """

    conditions: RunConditions
    episodes: int
    class_names: tuple[str, ...]
    seed_accuracy: tuple[SeedAccuracy, ...]
    predictable: Mapping[str, Predictability]
    positions: Mapping[str, Positions]
    moves: Mapping[str, FloatArray] | None
    states: StateMap | None

    def to_json(self) -> dict[str, Any]:
        """Return what analysis.json holds."""
        return {
            "run": {**asdict(self.conditions), "episodes": self.episodes},
            "table_3": [_seeds_json(row) for row in self.seed_accuracy],
            "table_4": {name: of.to_json(self.class_names) for name, of in self.predictable.items()},
            "figure_6": {name: _positions_json(of) for name, of in self.positions.items()},
            "figure_7": None if self.moves is None else {name: _moves_json(of) for name, of in self.moves.items()},
            "states": None if self.states is None else _states_json(self.states),
        }


def analyse(
    directory: Path,
    *,
    planners: Sequence[str] = (),
    states: str | None = None,
    out: Path | None = None,
    load: AgentLoader = load_agent,
    reporter: Reporter | None = None,
) -> Analysis:
    """Analyse a finished run as the paper does, and write what was found.

    Args:
        directory: of the run.
        planners: whose behaviour is shown, beside that of no-act; none takes il-ppo, or else nbv. The training
            seeds of one planner are taken together.
        states: a learned planner, by record name, whose states are mapped: it runs its episodes once more.
        out: folder for analysis.json, analysis.md and the pictures; None is `analysis` in the run's.
        load: makes the learned planner.
        reporter: hears of progress; None reports on standard error.

    Raises:
        EharError: one line that says what was got and what was expected.
    """
    from eval.studies.analyse_figure import (  # matplotlib takes a second to import
        draw_moves,
        draw_positions,
        draw_states,
    )
    from eval.studies.analyse_tables import analysis_markdown

    reporter = reporter or ConsoleReporter()
    run = read_run(Path(directory))
    chosen = choose(run, planners)
    names = class_names(run, reporter.note)
    folder = Path(directory) / FOLDER if out is None else Path(out)
    analysis = _analysis(run, chosen, names, states, load, reporter)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder}: expected a folder that can be written to: {error.strerror}") from error
    write_text(folder / ANALYSIS, [json_text(analysis.to_json())])
    title = run.config.title
    draw_positions({name: of.histograms for name, of in analysis.positions.items()}, title, folder / POSITIONS)
    if analysis.moves is not None:
        draw_moves(analysis.moves, title, folder / MOVES_MADE)
    if analysis.states is not None:
        of = analysis.states
        draw_states(of.mapped, of.states.label, names, f"{title}: states of {of.planner}", of.purity, folder / STATES)
    write_text(folder / TABLES, [analysis_markdown(analysis)])
    return analysis


def choose(run: Run, planners: Sequence[str]) -> tuple[str, ...]:
    """Return the planners whose behaviour is analysed: those named, or il-ppo, or else nbv.

    Raises:
        UsageError: one did not run, no-act is among them, which is shown anyway, or there is no default.
    """
    ran = tuple(seeds_of(run.records))
    if planners:
        for name in planners:
            run.episodes(name)
        moving = tuple(dict.fromkeys(name for name in planners if name != NO_ACT))
        if not moving:
            raise UsageError(
                f"planners: expected some beside {NO_ACT}, which is always shown; the run has {', '.join(ran)}"
            )
        return moving
    for name in DEFAULTS:
        if name in ran:
            return (name,)
    raise UsageError(
        f"{run.directory}: neither {' nor '.join(DEFAULTS)} ran; expected --planners among {', '.join(ran)}"
    )


def _analysis(
    run: Run,
    chosen: Sequence[str],
    names: tuple[str, ...],
    states: str | None,
    load: AgentLoader,
    reporter: Reporter,
) -> Analysis:
    shown = {name: run.episodes(name) for name in (*(NO_ACT,) * (NO_ACT in run.records), *chosen)}
    seeds = seeds_of(run.records)
    if run.flown:
        reporter.note(f"{run.directory}: moves are those of the grid, a run on track {run.conditions.track} has none")
    return Analysis(
        conditions=run.conditions,
        episodes=len(next(iter(run.records.values()))),
        class_names=names,
        seed_accuracy=tuple(accuracy_over_seeds(name, seeds[name]) for name in TABLE_3 if name in seeds),
        predictable={name: predictability(of, len(names)) for name, of in shown.items()},
        positions={name: Positions(position_histograms(of), level_share(of)) for name, of in shown.items()},
        moves=None if run.flown else {name: move_shares(recover_moves(shown[name])) for name in chosen},
        states=None if states is None else _map(run, states, load, reporter),
    )


def _map(run: Run, name: str, load: AgentLoader, reporter: Reporter) -> StateMap:
    """Return the map of a planner's states."""
    if name not in run.records:
        raise UsageError(f"{run.directory}: no planner {name!r}; expected one of: {', '.join(run.records)}")
    found = agent_states(run, name, load(run.conditions, name), reporter=reporter)
    drawn = found.sample(np.random.default_rng(0), MOST)
    return StateMap(name, drawn, map_states(drawn.state), neighbour_purity(drawn))


def _seeds_json(row: SeedAccuracy) -> dict[str, Any]:
    return {
        "name": row.name,
        "seeds": row.seeds,
        "acc": {percent: of._asdict() for percent, of in row.acc.items()},
        "acc_mean": row.acc_mean._asdict(),
    }


def _positions_json(of: Positions) -> dict[str, Any]:
    axes = {
        histogram.axis.name: {
            "unit": histogram.axis.unit,
            "edges": histogram.axis.edges.tolist(),
            "density": histogram.density.tolist(),
            "mean": histogram.mean,
            "std": histogram.std,
            "from_uniform": histogram.from_uniform,
        }
        for histogram in of.histograms
    }
    return {**axes, "level_share": of.level_share}


def _moves_json(shares: FloatArray) -> dict[str, dict[str, float]]:
    return {stage: dict(zip(MOVE_NAMES, row.tolist(), strict=True)) for stage, row in zip(STAGES, shares, strict=True)}


def _states_json(of: StateMap) -> dict[str, Any]:
    return {"planner": of.planner, "states": len(of.mapped), "size": of.states.state.shape[1], **of.purity._asdict()}
