"""The results of a comparison of two runs, and its table: each row has a planner of run A and a planner of run B."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from eval.render.tables import Table, html, interval_text, p_text, share_text
from eval.scores.differences import Difference
from eval.scores.resampling.resamples import Basis
from eval.scores.summary_table import TOGETHER, basis_lines

_DIFFERENCE = 3  # column


@dataclass(frozen=True)
class ComparedPlanners:
    """A planner of run A and a planner of run B.

    Args:
        difference: accuracy in A minus accuracy in B, with its interval and tests.
        acc: accuracies [%] in A and in B, the mean over all frames.
        trainings: number of trainings in A and in B.
        privileged: whether the planner was handed the truth, in A and in B.
        retrained: whether trainings of the same name have other weights in A than in B.
        rewritten: whether your own planners of the same name have another file or other arguments in A than in B.
    """

    difference: Difference
    acc: tuple[float, float]
    trainings: tuple[int, int]
    privileged: tuple[bool, bool]
    retrained: bool
    rewritten: bool


@dataclass(frozen=True, repr=False)
class Comparison:
    """Planners of run A against planners of run B on the same episodes; it prints as a table, in a notebook as HTML.

    Args:
        folders: folders of A and B.
        title: the data, and the conditions that both runs share.
        episodes: number of episodes that both ran.
        sequences: number of sequences that the episodes are from.
        differing: the differences between the runs by name, with both values as text.
        planners: the compared planners.
        no_intervals: the reason why there are no intervals, or None.
        basis: the people and sequences that intervals rest on.
        activities: of streams, the number of activities that are scored; None for clips.
    """

    folders: tuple[Path, Path]
    title: str
    episodes: int
    sequences: int
    differing: Mapping[str, tuple[str, str]]
    planners: tuple[ComparedPlanners, ...]
    no_intervals: str | None
    basis: Basis
    activities: int | None = None

    def tables(self) -> list[Table]:
        """Return the table of the comparison."""
        return [compare_table(self)]

    def __repr__(self) -> str:
        """Return one line: the runs, the number of planners and the number of episodes."""
        runs = " and ".join(str(folder) for folder in self.folders)
        return f"Comparison({self.title}: {runs}, {len(self.planners)} planners, {self.episodes} episodes)"

    def __str__(self) -> str:
        """Return the table."""
        return str(compare_table(self))

    def _repr_html_(self) -> str:
        """Return the table for a notebook."""
        return html(compare_table(self))


def compare_table(comparison: Comparison) -> Table:
    """Return a table of accuracies and paired differences, corrected together."""
    clear = {(row, _DIFFERENCE) for row, pair in enumerate(comparison.planners) if pair.difference.is_clear}
    notice, footnotes = basis_lines(comparison.basis, comparison.no_intervals)
    scored = "" if comparison.activities is None else f"{comparison.activities} activities in "
    return Table(
        title=(
            f"{comparison.title}: mean accuracy of A minus that of B, on the same {scored}{comparison.episodes} "
            f"episodes from {comparison.sequences} sequences, in points"
        ),
        header=(
            "planner",
            "A",
            "B",
            "A - B [95 %]",
            "smallest",
            "A better % [95 %]",
            "p",
        ),
        rows=tuple(_row(pair) for pair in comparison.planners),
        footnotes=(*_footnotes(comparison), *footnotes, *_MEANINGS),
        bold=frozenset(clear),
        notice=notice,
    )


_MEANINGS = (
    f"Bold: the interval excludes zero. {TOGETHER} So is p, the chance of such a difference if there is none.",
    "Smallest: the true difference that runs like these show 8 times in 10.",
    "A better: the probability that A is more accurate in a sequence; ties count half.",
)


def _row(pair: ComparedPlanners) -> tuple[str, ...]:
    difference = pair.difference
    names = tuple(
        name + "*" * privileged
        for name, privileged in zip((difference.planner, difference.other), pair.privileged, strict=True)
    )
    return (
        names[0] if names[0] == names[1] else f"{names[0]} - {names[1]}",
        *(f"{acc:.1f}" for acc in pair.acc),
        f"{difference.acc_mean:+.1f} {interval_text(difference.ci95_corrected)}",
        "-" if difference.smallest is None else f"{difference.smallest:.1f}",
        share_text(difference.improvement, difference.improvement_ci95),
        p_text(difference.p_corrected),
    )


def _footnotes(comparison: Comparison) -> Iterator[str]:
    """Yield the footnotes; the differences between the runs come first."""
    yield f"A: {comparison.folders[0]}. B: {comparison.folders[1]}."
    if comparison.differing:
        differing = "; ".join(f"{name} {a}, {b}" for name, (a, b) in comparison.differing.items())
        yield f"Not the same in A and B: {differing}."
    retrained = [pair.difference.planner for pair in comparison.planners if pair.retrained]
    if retrained:
        yield f"Trained to other weights in A and B: {', '.join(retrained)}."
    rewritten = [pair.difference.planner for pair in comparison.planners if pair.rewritten]
    if rewritten:
        yield f"Another file or other arguments in A and B: {', '.join(rewritten)}."
    several = [pair for pair in comparison.planners if max(pair.trainings) > 1]
    if several:
        counts = ", ".join(f"{pair.difference.planner} {pair.trainings[0]} and {pair.trainings[1]}" for pair in several)
        yield f"Training seeds in A and B: {counts}. Numbers are means over them, intervals cover them."
    if any(any(pair.privileged) for pair in comparison.planners):
        yield "* privileged: is handed the label and the future."
