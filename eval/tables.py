"""The benchmark's table, for the terminal and in Markdown."""

from typing import NamedTuple

from rich.box import SIMPLE_HEAD
from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table as RichTable
from rich.text import Text

from eval.metrics import ACC_AT
from eval.paper import ROWS, PaperRow, paper_gap_closed
from eval.summary import NO_ACT, ORACLE, Interval, PlannerSummary, Summary

_MARK = "*"  # behind the name of a privileged planner
_NONE = "-"


class Table(NamedTuple):
    """A table as text: what both renderings print."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    footnotes: tuple[str, ...]


def benchmark_table(summary: Summary) -> Table:
    """Return the table of a summary: one row a planner, accuracies and gaps in percent."""
    header = ("planner", *(f"acc@{percent}" for percent in ACC_AT), "mean acc [95 %]", "gap closed % [95 %]")
    footnotes = []
    if any(planner.privileged for planner in summary.planners):
        footnotes.append(f"{_MARK} privileged: is handed the label and the future.")
    if any(planner.gap_closed is None for planner in summary.planners):
        names = {planner.name for planner in summary.planners}
        if {NO_ACT, ORACLE} <= names:
            footnotes.append("No gap to close: the oracle is no better than no-act here.")
        else:
            footnotes.append(f"Gap closed needs both {NO_ACT} and {ORACLE} among the planners.")
    return Table(
        title=(
            f"{summary.data}: sensor {summary.sensor}, views {summary.views}, track {summary.track}, "
            f"{'' if summary.form == 'causal' else f'recogniser {summary.form}, '}"
            f"{summary.episodes} episodes of {summary.length} frames from {summary.sequences} sequences"
        ),
        header=(*header, "NLL", "ECE", "path [m]", "ms/step"),
        rows=tuple(_row(planner) for planner in summary.planners),
        footnotes=tuple(footnotes),
    )


def paper_table(summary: Summary) -> Table | None:
    """Return the paper's own rows where the data is one of its two sets."""
    rows = ROWS.get(summary.data)
    if rows is None:
        return None
    return Table(
        title=f"The paper's rows on {summary.data}, with its recogniser and its scenarios",
        header=("planner", *(f"acc@{percent}" for percent in ACC_AT), "mean acc", "gap closed %"),
        rows=tuple(_paper_row(row, rows) for row in rows),
        footnotes=(f"{_MARK} privileged.",),
    )


class Rendered:
    """Tables for the terminal; columns that do not fit into its width go into further blocks below."""

    def __init__(self, *tables: Table) -> None:
        """Keep the tables until the width is known."""
        self._tables = tables

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield titles, blocks and footnotes."""
        for table in self._tables:
            yield Text(f"\n{table.title}", style="bold")
            for columns in _blocks(table, options.max_width):
                block = RichTable(box=SIMPLE_HEAD, padding=(0, 1), collapse_padding=True, pad_edge=False)
                for index in columns:
                    block.add_column(Text(table.header[index]), justify="right" if index else "left", no_wrap=True)
                for row in table.rows:
                    block.add_row(*(Text(row[index]) for index in columns))
                yield block
            yield from (Text(note) for note in table.footnotes)


def render_summary(summary: Summary) -> Rendered:
    """Return all tables of a summary for the terminal: ours, and the paper's where there is one."""
    return Rendered(*summary_tables(summary))


def summary_tables(summary: Summary) -> list[Table]:
    """Return the table of a summary, and the paper's where there is one."""
    return [table for table in (benchmark_table(summary), paper_table(summary)) if table is not None]


def _blocks(table: Table, width: int) -> list[list[int]]:
    """Return which columns stand beside each other: as many as fit, each block beginning with the first column."""
    widths = [max(len(cells[index]) for cells in (table.header, *table.rows)) + 1 for index in range(len(table.header))]
    blocks = [[0]]
    for index in range(1, len(widths)):
        if sum(widths[column] for column in (*blocks[-1], index)) > width and len(blocks[-1]) > 1:
            blocks.append([0])
        blocks[-1].append(index)
    return blocks


def markdown(table: Table) -> str:
    """Return a table in Markdown."""
    rule = ("---", *("--:" for _ in table.header[1:]))
    lines = [f"| {' | '.join(cells)} |".replace(_MARK, rf"\{_MARK}") for cells in (table.header, rule, *table.rows)]
    notes = [note.replace(_MARK, rf"\{_MARK}") for note in table.footnotes]
    return "\n\n".join([f"**{table.title}**", "\n".join(lines), *notes]) + "\n"


def markdown_summary(summary: Summary) -> str:
    """Return all tables of a summary in Markdown."""
    return "\n".join(markdown(table) for table in summary_tables(summary))


def _row(planner: PlannerSummary) -> tuple[str, ...]:
    gap = _NONE
    if planner.gap_closed is not None and planner.gap_closed_ci95 is not None:
        low, high = planner.gap_closed_ci95
        gap = f"{100 * planner.gap_closed:.1f} {_ends((100 * low, 100 * high))}"
    return (
        planner.name + _MARK * planner.privileged,
        *(f"{planner.acc[str(percent)]:.1f}" for percent in ACC_AT),
        f"{planner.acc_mean:.1f} {_ends(planner.acc_mean_ci95)}",
        gap,
        f"{planner.nll:.2f}",
        f"{planner.ece:.3f}",
        f"{planner.path_length_m:.1f}",
        f"{planner.step_ms:.3f}",
    )


def _ends(interval: Interval) -> str:
    return f"[{interval[0]:.1f}, {interval[1]:.1f}]"


def _paper_row(row: PaperRow, rows: tuple[PaperRow, ...]) -> tuple[str, ...]:
    return (
        row.name + _MARK * (row.name == ORACLE),
        *(f"{acc:.1f}" for acc in row.acc),
        f"{row.acc_mean:.1f}",
        f"{100 * paper_gap_closed(rows, row.name):.1f}",
    )
