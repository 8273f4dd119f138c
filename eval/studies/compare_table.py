"""What a comparison of two runs found, and its table: one row a planner of run A beside one of run B."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from eval.render.tables import Table, html, interval_text, no_interval_footnotes, share_text
from eval.scores.differences import Difference
from eval.scores.planner_accuracy import TESTED_AT

_LEVEL = 0.05  # below which a p-value stands out
_DIFFERENCE, _P = 3, 7  # columns


@dataclass(frozen=True)
class ComparedPlanners:
    """A planner of run A and one of run B.

    Args:
        difference: A's accuracy minus B's, and how certain that is.
        acc: accuracies [%] of A's and B's, the mean over all frames.
        trainings: how many each has.
        privileged: which of the two was handed the truth.
        retrained: whether a training that goes by one name in both has other weights.
        rewritten: whether a planner of one's own that goes by one name in both has another file or other arguments.
    """

    difference: Difference
    acc: tuple[float, float]
    trainings: tuple[int, int]
    privileged: tuple[bool, bool]
    retrained: bool
    rewritten: bool


@dataclass(frozen=True, repr=False)
class Comparison:
    """Planners of run A against planners of run B on the same episodes. It prints as its table, in a notebook as HTML.

    Args:
        folders: of A and B.
        title: data, and what else is the same in both.
        episodes: how many both ran.
        sequences: of how many sequences.
        differing: what is not the same in both, with both values, as text.
        planners: what was compared.
        no_intervals: why intervals cannot be had, or None.
    """

    folders: tuple[Path, Path]
    title: str
    episodes: int
    sequences: int
    differing: Mapping[str, tuple[str, str]]
    planners: tuple[ComparedPlanners, ...]
    no_intervals: str | None

    def tables(self) -> list[Table]:
        """Return what there is to read."""
        return [compare_table(self)]

    def __repr__(self) -> str:
        """Return a line: what was compared, on how many episodes."""
        runs = " and ".join(str(folder) for folder in self.folders)
        return f"Comparison({self.title}: {runs}, {len(self.planners)} planners, {self.episodes} episodes)"

    def __str__(self) -> str:
        """Return the table."""
        return str(compare_table(self))

    def _repr_html_(self) -> str:
        """Return the table for a notebook."""
        return html(compare_table(self))


def compare_table(comparison: Comparison) -> Table:
    """Return accuracies, their paired difference, and what its tests say."""
    clear = {(row, _DIFFERENCE) for row, of in enumerate(comparison.planners) if of.difference.is_clear}
    significant = {(row, _P) for row, of in enumerate(comparison.planners) if of.difference.mcnemar_p_holm < _LEVEL}
    return Table(
        title=(
            f"{comparison.title}: mean accuracy of A minus that of B, on the same {comparison.episodes} episodes from "
            f"{comparison.sequences} sequences, in points"
        ),
        header=(
            "planner",
            "A",
            "B",
            "A - B [95 %]",
            "smallest",
            "A better % [95 %]",
            "wins, losses",
            "p (Holm)",
        ),
        rows=tuple(_row(of) for of in comparison.planners),
        footnotes=tuple(_footnotes(comparison)),
        bold=frozenset(clear | significant),
    )


def _row(of: ComparedPlanners) -> tuple[str, ...]:
    difference = of.difference
    names = tuple(
        name + "*" * privileged
        for name, privileged in zip((difference.planner, difference.other), of.privileged, strict=True)
    )
    return (
        names[0] if names[0] == names[1] else f"{names[0]} - {names[1]}",
        *(f"{acc:.1f}" for acc in of.acc),
        f"{difference.acc_mean:+.1f} {interval_text(difference.ci95)}",
        "-" if difference.smallest is None else f"{difference.smallest:.1f}",
        share_text(difference.improvement, difference.improvement_ci95),
        f"{difference.mcnemar_wins}, {difference.mcnemar_losses}",
        "<0.001" if difference.mcnemar_p_holm < 0.001 else f"{difference.mcnemar_p_holm:.3f}",
    )


def _footnotes(comparison: Comparison) -> Iterator[str]:
    """Yield what a reader has to know, what differs between the runs first."""
    yield f"A: {comparison.folders[0]}. B: {comparison.folders[1]}."
    if comparison.differing:
        differing = "; ".join(f"{name} {a}, {b}" for name, (a, b) in comparison.differing.items())
        yield f"Not the same in A and B: {differing}."
    retrained = [of.difference.planner for of in comparison.planners if of.retrained]
    if retrained:
        yield f"Trained to other weights in A and B: {', '.join(retrained)}."
    rewritten = [of.difference.planner for of in comparison.planners if of.rewritten]
    if rewritten:
        yield f"Another file or other arguments in A and B: {', '.join(rewritten)}."
    several = [of for of in comparison.planners if max(of.trainings) > 1]
    if several:
        counts = ", ".join(f"{of.difference.planner} {of.trainings[0]} and {of.trainings[1]}" for of in several)
        yield f"Training seeds in A and B: {counts}. Numbers are means over them, intervals cover them."
    if any(any(of.privileged) for of in comparison.planners):
        yield "* privileged: is handed the label and the future."
    yield from no_interval_footnotes(comparison.no_intervals)
    yield "Bold: the interval excludes zero; p is below 0.05."
    yield "Smallest: the true difference that runs like these show 8 times in 10."
    yield "A better: the probability that A is more accurate in a sequence; ties count half."
    yield (
        f"Wins, losses: episodes that only A or only B has right at acc@{TESTED_AT}. p: McNemar's exact test of them, "
        "with Holm's correction over the rows; it takes episodes as independent, intervals resample whole sequences."
    )
