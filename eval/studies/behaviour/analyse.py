"""The paper's analyses of a finished run: Table 3, Table 4, Fig. 6 and Fig. 7, as numbers, tables and pictures."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ehar.errors import UsageError
from ehar.files import json_text, write_text
from eval.running.progress import ConsoleReporter, Reporter
from eval.running.run import Run, class_names, read_run
from eval.scores.behaviour import (
    level_share,
    move_shares,
    position_histograms,
    recover_moves,
)
from eval.scores.planner_summary import NO_ACT
from eval.scores.predictability import predictability
from eval.scores.seed_accuracy import TABLE_3, accuracy_over_seeds, pool_seeds, seeds_of
from eval.studies.behaviour.agent_states import (
    MOST,
    AgentLoader,
    agent_states,
    load_agent,
    map_states,
    neighbour_purity,
)
from eval.studies.behaviour.analysis import (
    MOVES_MADE,
    POSITIONS,
    STATES,
    Analysis,
    Positions,
    StateMap,
    analysis_markdown,
)

DEFAULTS = ("il-ppo", "nbv")  # the first that ran
ANALYSIS, TABLES = "analysis.json", "analysis.md"
FOLDER = "analysis"  # in the run's folder


def analyse(
    run: str | Path,
    *,
    planners: Sequence[str] = (),
    states: str | None = None,
    out: str | Path | None = None,
    load: AgentLoader = load_agent,
    reporter: Reporter | None = None,
) -> Analysis:
    """Analyse a finished run as the paper does, and write the results.

    Args:
        run: folder of a finished run.
        planners: planners to show beside no-act, each with all its training seeds; none takes il-ppo, or else nbv.
        states: record name of the learned planner whose states are mapped; it runs its episodes again.
        out: folder for analysis.json, analysis.md and the pictures; None takes `analysis` in the folder of the run.
        load: makes the learned planner.
        reporter: receives progress; None reports on standard error.

    Raises:
        EharError: one line that says what was got and what was expected.
    """
    from eval.studies.behaviour.figure import (  # matplotlib takes a second to import
        draw_moves,
        draw_positions,
        draw_states,
    )

    reporter = reporter or ConsoleReporter()
    finished = read_run(run)
    if states is not None and finished.of_streams:
        raise UsageError(f"{finished.directory}: expected no --states, as states of streams are not mapped")
    chosen = choose(finished, planners)
    names = class_names(finished, reporter.note)
    folder = finished.folder / FOLDER if out is None else Path(out)
    analysis = _analysis(finished, chosen, names, states, load, reporter)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{folder}: expected a folder that can be written to: {error.strerror}") from error
    write_text(folder / ANALYSIS, [json_text(analysis.to_json())])
    title = finished.config.title
    histograms = {name: positions.histograms for name, positions in analysis.positions.items()}
    draw_positions(histograms, title, folder / POSITIONS)
    if analysis.moves is not None:
        draw_moves(analysis.moves, title, folder / MOVES_MADE)
    if analysis.states is not None:
        found = analysis.states
        heading = f"{title}: states of {found.planner}"
        draw_states(found.mapped, found.states.label, names, heading, found.purity, folder / STATES)
    write_text(folder / TABLES, [analysis_markdown(analysis)])
    reporter.note(f"written to {folder}")
    return analysis


def choose(run: Run, planners: Sequence[str]) -> tuple[str, ...]:
    """Return the planners to analyse: the named ones without no-act; without names il-ppo, or else nbv.

    Raises:
        UsageError: a named planner did not run, no-act alone is named, or neither il-ppo nor nbv ran.
    """
    ran = tuple(seeds_of(run.records))
    if planners:
        run.check_planners(planners)
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
    scored = pool_seeds(run.scored)
    seeds = seeds_of(run.scored)
    shown = {name: run.episodes(name) for name in (*(NO_ACT,) * (NO_ACT in seeds), *chosen)}
    workspace = run.config.world.workspace
    if run.flown:
        reporter.note(f"{run.directory}: a run on track {run.conditions.track} has no grid moves to analyse")
    return Analysis(
        config=run.config,
        episodes=len(next(iter(run.records.values()))),
        class_names=names,
        seed_accuracy=tuple(accuracy_over_seeds(name, seeds[name]) for name in TABLE_3 if name in seeds),
        predictable={name: predictability(scored[name], len(names)) for name in shown},
        positions={
            name: Positions(position_histograms(records, workspace), level_share(records))
            for name, records in shown.items()
        },
        moves=None if run.flown else {name: move_shares(recover_moves(shown[name], workspace)) for name in chosen},
        states=None if states is None else _map(run, states, load, reporter),
    )


def _map(run: Run, name: str, load: AgentLoader, reporter: Reporter) -> StateMap:
    """Return the map of a planner's states."""
    if name not in run.records:
        raise UsageError(f"{run.directory}: no planner {name!r}; expected one of: {', '.join(run.records)}")
    found = agent_states(run, name, load(run, name), reporter=reporter)
    drawn = found.sample(np.random.default_rng(0), MOST)
    return StateMap(name, drawn, map_states(drawn.state), neighbour_purity(drawn))
