"""The benchmark's table, for the terminal and in Markdown."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from rich.box import SIMPLE_HEAD
from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table as RichTable
from rich.text import Text

from ehar.data.scenario import TEST
from eval.render.paper import ROWS, PaperRow, paper_gap_closed
from eval.scores.differences import Difference
from eval.scores.metrics import ACC_AT
from eval.scores.statistics import Interval
from eval.scores.summary import NO_ACT, ORACLE, PlannerSummary, Summary

_MARK = "*"  # behind the name of a privileged planner
_NONE = "-"
_NO_INTERVAL = "[-]"
_SPREAD = "±"
_KEPT = ("kept % [95 %]",)
_FLIGHT = ("peak [m/s]", "[m/s^2]", "[m/s^3]", "effort [m^2/s^3]", "at limit %")


class Table(NamedTuple):
    """A table as text: what both renderings print; `bold` are (row, column) of cells that stand out."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    footnotes: tuple[str, ...]
    bold: frozenset[tuple[int, int]] = frozenset()


def benchmark_table(summary: Summary) -> Table:
    """Return the table of a summary: one row a planner, accuracies and gaps in percent; more columns for flights."""
    header = ("planner", *(f"acc@{percent}" for percent in ACC_AT), "mean acc [95 %]", "gap closed % [95 %]")
    flown = any(planner.flight is not None for planner in summary.planners)
    compared = any(planner.accuracy_kept is not None for planner in summary.planners)
    return Table(
        title=(
            f"{summary.data}: sensor {summary.sensor}, views {summary.views}, track {summary.track}, "
            f"{'' if summary.form == 'causal' else f'recogniser {summary.form}, '}"
            f"{'' if summary.readout == 'recogniser' else f'readout {summary.readout}, '}"
            f"{'' if summary.part == TEST else f'{summary.part} part, '}"
            f"{summary.episodes} episodes of {summary.length} frames from {summary.sequences} sequences"
        ),
        header=(*header, *(_KEPT * compared), "NLL", "ECE", "path [m]", *(_FLIGHT * flown), "ms/step"),
        rows=tuple(_row(planner, compared) for planner in summary.planners),
        footnotes=tuple(_footnotes(summary, flown=flown, compared=compared)),
    )


def _footnotes(summary: Summary, *, flown: bool, compared: bool) -> Iterator[str]:
    """Yield what a reader of the table has to know."""
    names = {planner.name for planner in summary.planners}
    yield from no_interval_footnotes(summary.no_intervals)
    yield from _training_footnotes(summary)
    if any(planner.privileged for planner in summary.planners):
        yield f"{_MARK} privileged: is handed the label and the future."
    if any(planner.gap_closed is None for planner in summary.planners):
        if {NO_ACT, ORACLE} <= names:
            yield "No gap to close: the oracle is no better than no-act here."
        else:
            yield f"Gap closed needs both {NO_ACT} and {ORACLE} among the planners."
    if flown and ORACLE in names:
        yield (
            "Oracles try the moves of the grid and head for where the best lead: in flight they are no upper bound. "
            "Compared with a run on the ideal track, the gap reaches up to its oracle."
        )
    if flown:
        yield (
            "Peaks are Cartesian, the largest of all episodes; effort is the mean integral of the squared "
            "acceleration; at limit is the share of frames in which 99 % of some limit is used."
        )
    if compared:
        yield "Kept: (accuracy in flight - that of no-act) / (accuracy on the ideal track - that of no-act)."
    for planner in summary.planners:
        if planner.solves is not None and planner.solves.fallbacks:
            counts = ", ".join(f"{status} {count}" for status, count in planner.solves.counts.items())
            yield f"{planner.name}: {planner.solves.fallbacks} of {planner.solves.total} plans fell back ({counts})."


def no_interval_footnotes(reason: str | None) -> Iterator[str]:
    """Yield why intervals are missing, where they are."""
    if reason is not None:
        yield f"{_NO_INTERVAL} No intervals: {reason}."


def _training_footnotes(summary: Summary) -> Iterator[str]:
    """Yield what the numbers of planners that were trained with seeds are about."""
    several = [planner for planner in summary.planners if len(planner.training_seeds) > 1]
    one = [planner for planner in summary.planners if len(planner.training_seeds) == 1]
    if several:
        counts = ", ".join(f"{planner.name} {len(planner.training_seeds)}" for planner in several)
        yield (
            f"Training seeds: {counts}. Numbers are means over seeds, behind {_SPREAD} stands the standard deviation "
            "over seeds; intervals are a bootstrap over sequences and these seeds, elsewhere over sequences."
        )
    if one:
        names = ", ".join(f"{planner.name} ({planner.training_seeds[0]})" for planner in one)
        yield f"One training seed: {names}; its intervals do not say what another training would give."


def differences_table(summary: Summary) -> Table | None:
    """Return how much more accurate each planner of interest is (columns) than each other (rows); None without any."""
    if not summary.differences:
        return None
    found = {(of.other, of.planner): of for of in summary.differences}
    columns = tuple(dict.fromkeys(of.planner for of in summary.differences))
    rows = [planner.name for planner in summary.planners if any((planner.name, column) in found for column in columns)]
    cells = [[found.get((row, column)) for column in columns] for row in rows]
    return Table(
        title="Mean accuracy of the column's planner minus that of the row's, on the same episodes, in points [95 %]",
        header=("planner", *columns),
        rows=tuple(
            (name, *("" if of is None else f"{of.acc_mean:+.1f} {interval_text(of.ci95)}" for of in row))
            for name, row in zip(rows, cells, strict=True)
        ),
        footnotes=(
            "Bold: the interval excludes zero.",
            *no_interval_footnotes(summary.no_intervals),
            *smallest_footnotes(summary.differences),
        ),
        bold=frozenset(
            (row, column)
            for row, differences in enumerate(cells)
            for column, of in enumerate(differences, 1)
            if of is not None and of.is_clear
        ),
    )


def smallest_footnotes(found: Sequence[Difference]) -> Iterator[str]:
    """Yield how small true differences could have been and still have shown."""
    smallest = sorted(of.smallest for of in found if of.smallest is not None)
    if smallest:
        low, high = f"{smallest[0]:.1f}", f"{smallest[-1]:.1f}"
        span = f"{low} points" if low == high else f"{low} to {high} points, depending on the pair"
        yield f"Smallest difference that a run like this shows 8 times in 10: {span}."


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
                for number, row in enumerate(table.rows):
                    styles = ("bold" if (number, index) in table.bold else "" for index in columns)
                    block.add_row(*(Text(row[index], style) for index, style in zip(columns, styles, strict=True)))
                yield block
            yield from (Text(note) for note in table.footnotes)


def render_summary(summary: Summary) -> Rendered:
    """Return all tables of a summary for the terminal."""
    return Rendered(*summary_tables(summary))


def summary_tables(summary: Summary) -> list[Table]:
    """Return the table of a summary and, where they exist, that of differences and the paper's."""
    tables = (benchmark_table(summary), differences_table(summary), paper_table(summary))
    return [table for table in tables if table is not None]


def _blocks(table: Table, width: int) -> list[list[int]]:
    """Return which columns stand beside each other: as many as fit, each block beginning with the first column."""
    # Between columns rich puts one space of padding and one for the box, and one at either end.
    widths = [max(len(cells[index]) for cells in (table.header, *table.rows)) + 2 for index in range(len(table.header))]
    blocks = [[0]]
    for index in range(1, len(widths)):
        if sum(widths[column] for column in (*blocks[-1], index)) > width and len(blocks[-1]) > 1:
            blocks.append([0])
        blocks[-1].append(index)
    return blocks


def markdown(table: Table) -> str:
    """Return a table in Markdown."""
    rule = ("---", *("--:" for _ in table.header[1:]))
    rows = [[_escaped(cell) for cell in row] for row in table.rows]
    for row, column in table.bold:
        rows[row][column] = f"**{rows[row][column]}**"
    lines = [f"| {' | '.join(cells)} |" for cells in (map(_escaped, table.header), rule, *rows)]
    notes = [_escaped(note) for note in table.footnotes]
    return "\n\n".join([f"**{table.title}**", "\n".join(lines), *notes]) + "\n"


def _escaped(text: str) -> str:
    return text.replace(_MARK, rf"\{_MARK}")


def markdown_summary(summary: Summary) -> str:
    """Return all tables of a summary in Markdown."""
    return "\n".join(markdown(table) for table in summary_tables(summary))


def _row(planner: PlannerSummary, compared: bool) -> tuple[str, ...]:
    flight: tuple[str, ...] = ()
    if planner.flight is not None:
        peaks = (planner.flight.peak_speed, planner.flight.peak_acceleration, planner.flight.peak_jerk)
        last = (f"{planner.flight.effort:.1f}", f"{100 * planner.flight.limit_share:.1f}")
        flight = (*(f"{peak:.2f}" for peak in peaks), *last)
    spread = "" if planner.acc_mean_seed_sd is None else f" {_SPREAD} {planner.acc_mean_seed_sd:.1f}"
    return (
        planner.name + _MARK * planner.privileged,
        *(f"{planner.acc[str(percent)]:.1f}" for percent in ACC_AT),
        f"{planner.acc_mean:.1f}{spread} {interval_text(planner.acc_mean_ci95)}",
        share_text(planner.gap_closed, planner.gap_closed_ci95),
        *((share_text(planner.accuracy_kept, planner.accuracy_kept_ci95),) * compared),
        f"{planner.nll:.2f}",
        f"{planner.ece:.3f}",
        f"{planner.path_length_m:.1f}",
        *flight,
        f"{planner.step_ms:.3f}",
    )


def share_text(share: float | None, ends: Interval | None) -> str:
    """Return a share and its interval in percent."""
    if share is None:
        return _NONE
    return f"{100 * share:.1f} {interval_text(None if ends is None else (100 * ends[0], 100 * ends[1]))}"


def interval_text(interval: Interval | None, digits: int = 1) -> str:
    """Return the two ends of an interval."""
    return _NO_INTERVAL if interval is None else f"[{interval[0]:.{digits}f}, {interval[1]:.{digits}f}]"


def _paper_row(row: PaperRow, rows: tuple[PaperRow, ...]) -> tuple[str, ...]:
    return (
        row.name + _MARK * (row.name == ORACLE),
        *(f"{acc:.1f}" for acc in row.acc),
        f"{row.acc_mean:.1f}",
        f"{100 * paper_gap_closed(rows, row.name):.1f}",
    )
