"""The table of `ehar compare`: one row a planner of run A beside one of run B."""

from collections.abc import Iterator

from eval.render.tables import Table, interval_text, no_interval_footnotes, share_text
from eval.scores.planner_accuracy import TESTED_AT
from eval.studies.compare import ComparedPlanners, Comparison

_LEVEL = 0.05  # below which a p-value stands out
_DIFFERENCE, _P = 3, 7  # columns


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
