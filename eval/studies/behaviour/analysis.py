"""The results of an analysis of a finished run, and their tables for the terminal and in Markdown."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ehar.arrays import FloatArray
from ehar.viewpoint import MOVE_NAMES
from eval.records.config import RunConfig
from eval.render.tables import Table, markdown
from eval.scores.behaviour import LEVEL_FROM, STAGES, PositionHistogram
from eval.scores.planner_summary import NO_ACT
from eval.scores.predictability import LEVELS, NO_EPISODE, Predictability
from eval.scores.seed_accuracy import TABLE_3_AT, SeedAccuracy, Spread
from eval.studies.behaviour.agent_states import EVERY, AgentStates, Purity

POSITIONS, MOVES_MADE, STATES = "positions.png", "moves.png", "states.png"  # beside analysis.md, which links them

_LEVEL_NAMES = ("instantly (10 %)", "early (50 %)", "late (100 %)", "not by the end")
_NONE = "-"
_OF_CLASS = (
    "The level of a class is the first of 10, 50 and 100 % of the frames after which at least half of its episodes "
    "are classified correctly."
)
_OF_EPISODE = (
    "The level of an episode is the first of 10, 50 and 100 % of the frames from which on it is classified correctly "
    "at each of these."
)


RUN_KEYS = (  # keys of config.json that analysis.json repeats
    *("source", "data", "data_sha256", "models", "recogniser_sha256", "sensor", "views", "form", "track", "readout"),
    *("part", "starts", "seed", "length", "fps", "world"),
)


@dataclass(frozen=True, eq=False)
class Positions:
    """Where a planner's cameras were (Fig. 6): a histogram for each axis, and the share of level frames."""

    histograms: tuple[PositionHistogram, ...]
    level_share: float


@dataclass(frozen=True, eq=False)
class StateMap:
    """States of a learned planner in the plane (Fig. 7e), and how well they tell classes apart.

    Args:
        planner: record name of the planner.
        states: the M states that are drawn.
        mapped: (M, 2) states in the plane.
        purity: purity in the space of the states, not in the plane.
    """

    planner: str
    states: AgentStates
    mapped: FloatArray
    purity: Purity


@dataclass(frozen=True, eq=False)
class Analysis:
    """All analyses of a run.

    Args:
        config: configuration of the run.
        episodes: number of episodes of each training seed.
        class_names: K names.
        seed_accuracy: Table 3, with those of its planners that ran.
        predictable: Table 4, for each chosen planner, and for no-act if it ran.
        positions: Fig. 6, for the same planners.
        moves: Fig. 7a-d, (4, 7) for each chosen planner; None for a flight.
        states: Fig. 7e; None if no planner was named for it.
    """

    config: RunConfig
    episodes: int
    class_names: tuple[str, ...]
    seed_accuracy: tuple[SeedAccuracy, ...]
    predictable: Mapping[str, Predictability]
    positions: Mapping[str, Positions]
    moves: Mapping[str, FloatArray] | None
    states: StateMap | None

    def to_json(self) -> dict[str, Any]:
        """Return the content of analysis.json."""
        config = self.config.to_json()
        return {
            "run": {**{key: config[key] for key in RUN_KEYS}, "episodes": self.episodes},
            "table_3": [_seeds_json(row) for row in self.seed_accuracy],
            "table_4": {name: levels.to_json(self.class_names) for name, levels in self.predictable.items()},
            "figure_6": {name: _positions_json(positions) for name, positions in self.positions.items()},
            "figure_7": None if self.moves is None else {name: _moves_json(row) for name, row in self.moves.items()},
            "states": None if self.states is None else _states_json(self.states),
        }

    def tables(self) -> list[Table]:
        """Return the tables for a terminal."""
        return analysis_tables(self)


def _seeds_json(row: SeedAccuracy) -> dict[str, Any]:
    return {
        "name": row.name,
        "seeds": row.seeds,
        "acc": {percent: spread._asdict() for percent, spread in row.acc.items()},
        "acc_mean": row.acc_mean._asdict(),
    }


def _positions_json(positions: Positions) -> dict[str, Any]:
    axes = {
        histogram.axis.name: {
            "unit": histogram.axis.unit,
            "edges": histogram.axis.edges.tolist(),
            "density": histogram.density.tolist(),
            "mean": histogram.mean,
            "std": histogram.std,
            "from_uniform": histogram.from_uniform,
        }
        for histogram in positions.histograms
    }
    return {**axes, "level_share": positions.level_share}


def _moves_json(shares: FloatArray) -> dict[str, dict[str, float]]:
    return {stage: dict(zip(MOVE_NAMES, row.tolist(), strict=True)) for stage, row in zip(STAGES, shares, strict=True)}


def _states_json(found: StateMap) -> dict[str, Any]:
    count, size = found.states.state.shape
    return {"planner": found.planner, "states": count, "size": size, **found.purity._asdict()}


def analysis_tables(analysis: Analysis) -> list[Table]:
    """Return the tables that fit into a terminal: tables with a row or a cell for each class are left out."""
    tables = [counts_table(analysis), positions_table(analysis)]
    if analysis.seed_accuracy:
        tables.insert(0, seeds_table(analysis.seed_accuracy))
    if analysis.moves is not None:
        tables.append(moves_table(analysis))
    if analysis.states is not None:
        tables.append(states_table(analysis))
    return tables


def analysis_markdown(analysis: Analysis) -> str:
    """Return all tables and pictures of an analysis in Markdown."""
    pieces = [
        f"# {analysis.config.title}: {analysis.episodes} episodes of {analysis.config.conditions.frames} frames\n"
    ]
    if analysis.seed_accuracy:
        pieces.append(markdown(seeds_table(analysis.seed_accuracy)))
    pieces.append(markdown(counts_table(analysis), classes_table(analysis.predictable, analysis.class_names)))
    pieces += [markdown(table(analysis)) for table in (shares_table, positions_table)]
    pieces.append(f"![Where cameras were]({POSITIONS})\n")
    if analysis.moves is not None:
        pieces += [markdown(moves_table(analysis)), f"![Which moves were made]({MOVES_MADE})\n"]
    if analysis.states is not None:
        pieces += [markdown(states_table(analysis)), f"![States by class]({STATES})\n"]
    return "\n".join(pieces)


def seeds_table(seed_accuracy: Sequence[SeedAccuracy]) -> Table:
    """Return Table 3: accuracies over training seeds."""
    return Table(
        title="Parts of the learned agent (Table 3): accuracy over training seeds",
        header=("planner", "seeds", *(f"acc@{percent}" for percent in TABLE_3_AT), "mean acc"),
        rows=tuple(
            (row.name, str(row.seeds), *(spread_text(row.acc[str(at)]) for at in TABLE_3_AT), spread_text(row.acc_mean))
            for row in seed_accuracy
        ),
        footnotes=("Mean and standard deviation over training seeds, in percent.",),
    )


def counts_table(analysis: Analysis) -> Table:
    """Return the number of classes and the share of episodes at each level of predictability."""
    rows = []
    for name, found in analysis.predictable.items():
        cells = (f"{len(found.classes_at(level))} ({100 * share:.1f} %)" for level, share in enumerate(found.total))
        rows.append((_perception(name), *cells))
    return Table(
        title="Predictability (Table 4): classes, and in brackets episodes",
        header=("planner", *_LEVEL_NAMES),
        rows=tuple(rows),
        footnotes=(_OF_CLASS, _OF_EPISODE),
    )


def classes_table(predictable: Mapping[str, Predictability], names: tuple[str, ...]) -> Table:
    """Return Table 4: the classes at each level, by planner."""
    return Table(
        title="Passive and embodied predictability of activities (Table 4)",
        header=("planner", *_LEVEL_NAMES),
        rows=tuple(
            (
                _perception(name),
                *(
                    "; ".join(names[label] for label in found.classes_at(level)) or _NONE
                    for level in range(len(LEVELS))
                ),
            )
            for name, found in predictable.items()
        ),
        footnotes=(),
    )


def class_accuracy_table(predictable: Mapping[str, Predictability], names: tuple[str, ...]) -> Table:
    """Return the accuracies that Table 4 rests on: of each class, by planner."""
    held = next(iter(predictable.values())).class_level != NO_EPISODE
    return Table(
        title="Accuracy of each class after 10 / 50 / 100 % of the frames (behind Table 4), in percent",
        header=("class", *(_perception(name) for name in predictable)),
        rows=tuple(
            (
                name,
                *(
                    " / ".join(f"{100 * share:.0f}" for share in found.accuracy[label])
                    for found in predictable.values()
                ),
            )
            for label, name in enumerate(names)
            if held[label]
        ),
        footnotes=(_OF_CLASS,),
    )


def shares_table(analysis: Analysis) -> Table:
    """Return, for each class, the share of its episodes at each level."""
    shown = analysis.predictable
    held = next(iter(shown.values())).class_level != NO_EPISODE
    return Table(
        title="Episodes that are predictable instantly / early / late / not by the end, in percent",
        header=("class", *(_perception(name) for name in shown)),
        rows=tuple(
            (name, *(" / ".join(f"{100 * share:.0f}" for share in found.share[label]) for found in shown.values()))
            for label, name in enumerate(analysis.class_names)
            if held[label]
        ),
        footnotes=(_OF_EPISODE,),
    )


def positions_table(analysis: Analysis) -> Table:
    """Return Fig. 6 in numbers."""
    axes = [histogram.axis for histogram in next(iter(analysis.positions.values())).histograms]
    rows = []
    for name, positions in analysis.positions.items():
        histograms = positions.histograms
        spreads = [_mean_std(histogram.mean, histogram.std) for histogram in histograms if histogram.std is not None]
        uniform = [f"{histogram.from_uniform:.2f}" for histogram in histograms]
        rows.append((name, *spreads, f"{100 * positions.level_share:.1f}", *uniform))
    return Table(
        title="Where cameras were (Fig. 6), over all frames",
        header=(
            "planner",
            "distance [m]",
            "polar angle [deg]",
            f"at {LEVEL_FROM:.0f} deg or more [%]",
            *(f"{axis.name} from uniform" for axis in axes),
        ),
        rows=tuple(rows),
        footnotes=(
            "From uniform: the total variation distance between the histogram and the uniform distribution, 0 to 1. "
            "Starts are drawn from the uniform distribution; no-act stays at them. 90 deg is level with the people.",
        ),
    )


def moves_table(analysis: Analysis) -> Table:
    """Return Fig. 7a-d in numbers."""
    return Table(
        title="Moves (Fig. 7a-d), in percent",
        header=("planner", "stage", *MOVE_NAMES),
        rows=tuple(
            (name, stage, *(f"{100 * share:.1f}" for share in row))
            for name, shares in (analysis.moves or {}).items()
            for stage, row in zip(STAGES, shares, strict=True)
        ),
        footnotes=("A move that would have left the workspace was not made, and counts as hovering.",),
    )


def states_table(analysis: Analysis) -> Table:
    """Return how well the states of Fig. 7e tell classes apart."""
    assert analysis.states is not None
    purity = analysis.states.purity
    return Table(
        title="States of the learned agent (Fig. 7e)",
        header=("planner", "states", "neighbours of the same class [%]", "by chance [%]"),
        rows=(
            (
                analysis.states.planner,
                str(len(analysis.states.mapped)),
                f"{100 * purity.purity:.1f}",
                f"{100 * purity.chance:.1f}",
            ),
        ),
        footnotes=(
            f"Neighbours: the {purity.neighbours} nearest states of other sequences, in the space of the states. "
            f"By chance: the share among all states of other sequences. One state is taken every {EVERY} frames.",
        ),
    )


def _perception(name: str) -> str:
    """Return the planner with the paper's word for its perception."""
    return f"{name} ({'passive' if name == NO_ACT else 'embodied'})"


def spread_text(spread: Spread) -> str:
    """Return a mean and, with several trainings, its standard deviation."""
    return _mean_std(spread.mean, spread.std)


def _mean_std(mean: float | None, std: float | None) -> str:
    if mean is None:
        return _NONE
    return f"{mean:.1f}" if std is None else f"{mean:.1f} ± {std:.1f}"
