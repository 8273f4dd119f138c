"""A table, and the three ways to draw it: in a terminal (rich), in Markdown and in HTML."""

from collections.abc import Iterator
from html import escape
from io import StringIO
from typing import NamedTuple

from rich.box import SIMPLE_HEAD
from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table as RichTable
from rich.text import Text

Interval = tuple[float, float]  # its two ends

PRIVILEGED = "*"  # after the name of a planner that is handed the truth
NONE = "-"
NO_INTERVAL = "[-]"
TEXT_WIDTH = 160  # columns


class Cell(NamedTuple):
    """A cell with more than a text.

    Args:
        text: text of the cell.
        interval: text after it, which HTML shows in small print.
        value: value by which HTML sorts the column; None goes last. A cell that is only a text is sorted by it.
    """

    text: str
    interval: str = ""
    value: float | str | None = None

    def __str__(self) -> str:
        """Return the whole text."""
        return f"{self.text} {self.interval}".rstrip()


class Table(NamedTuple):
    """A table, independent of its output format.

    Args:
        title: title above the table.
        header: one name per column; the first column holds the names of the rows.
        rows: rows with one cell per column.
        footnotes: paragraphs below the table.
        bold: (row, column) of cells that stand out.
        slanted: rows that do not compete with the others, such as planners that are handed the truth.
        words: columns after the first that hold words: aligned on the left, and wrapped if there is no room.
        lower_is_better: columns that HTML first sorts from the least value up.
        notice: what a reader must not miss, on one line between title and rows; empty if there is nothing.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str | Cell, ...], ...]
    footnotes: tuple[str, ...]
    bold: frozenset[tuple[int, int]] = frozenset()
    slanted: frozenset[int] = frozenset()
    words: frozenset[int] = frozenset()
    lower_is_better: frozenset[int] = frozenset()
    notice: str = ""


class Rendered:
    """Tables for the terminal; columns that do not fit into its width go into further blocks below."""

    def __init__(self, *tables: Table) -> None:
        """Keep the tables until the width is known."""
        self._tables = tables

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield titles, blocks and footnotes."""
        for table in self._tables:
            yield Text(f"\n{table.title}", style="bold")
            if table.notice:
                yield Text(table.notice, style="bold yellow")
            for columns in _blocks(table, options.max_width):
                yield _block(table, columns)
            yield from (Text(note) for note in table.footnotes)


def _block(table: Table, columns: list[int]) -> RichTable:
    """Return some columns of a table for the terminal."""
    block = RichTable(box=SIMPLE_HEAD, padding=(0, 1), collapse_padding=True, pad_edge=False)
    for index in columns:
        left = index == 0 or index in table.words
        block.add_column(
            Text(table.header[index]), justify="left" if left else "right", no_wrap=index not in table.words
        )
    for number, row in enumerate(table.rows):
        slant = "italic " if number in table.slanted else ""
        styles = (slant + "bold" if (number, index) in table.bold else slant for index in columns)
        block.add_row(*(Text(str(row[index]), style) for index, style in zip(columns, styles, strict=True)))
    return block


def _blocks(table: Table, width: int) -> list[list[int]]:
    """Return which columns stand beside each other: as many as fit, each block beginning with the first column."""
    widths = [_width(table, index) for index in range(len(table.header))]
    blocks = [[0]]
    for index in range(1, len(widths)):
        if sum(widths[column] for column in (*blocks[-1], index)) > width and len(blocks[-1]) > 1:
            blocks.append([0])
        blocks[-1].append(index)
    return blocks


def _width(table: Table, column: int) -> int:
    """Return the least width of a column in the terminal: that of its longest cell, or of its longest word."""
    cells = [str(cells[column]) for cells in (table.header, *table.rows)]
    pieces = [word for cell in cells for word in cell.split()] if column in table.words else cells
    # Between columns rich puts one space of padding and one for the box, and one at either end.
    return max(map(len, pieces), default=0) + 2


def text(*tables: Table) -> str:
    """Return tables as plain text, one below the other."""
    console = Console(file=StringIO(), width=TEXT_WIDTH, color_system=None, highlight=False)
    with console.capture() as captured:
        console.print(Rendered(*tables))
    return captured.get()


def markdown(*tables: Table) -> str:
    """Return tables in Markdown, one below the other."""
    return "\n".join(map(_markdown, tables))


def _markdown(table: Table) -> str:
    rule = ("---", *("---" if index in table.words else "--:" for index in range(1, len(table.header))))
    rows = [[_escaped(str(cell)) for cell in row] for row in table.rows]
    for row, column in table.bold:
        rows[row][column] = f"**{rows[row][column]}**"
    lines = [f"| {' | '.join(cells)} |" for cells in (map(_escaped, table.header), rule, *rows)]
    notes = [_escaped(note) for note in table.footnotes]
    notice = [f"**{_escaped(table.notice)}**"] if table.notice else []
    return "\n\n".join([f"**{_escaped(table.title)}**", *notice, "\n".join(lines), *notes]) + "\n"


def _escaped(text: str) -> str:
    return text.replace("*", r"\*")


def html(table: Table, *, sortable: bool = False) -> str:
    """Return a table in HTML, within a part of the page that scrolls, and its footnotes.

    Args:
        table: the table.
        sortable: whether its headers are buttons with which the script of a report sorts it. Its title is then for
            screen readers only, because the page has a heading.
    """
    heads = "".join(_html_head(table, column, sortable=sortable) for column in range(len(table.header)))
    rows = "".join(_html_row(table, row) for row in range(len(table.rows)))
    kind, hidden = (' class="sortable"', " hidden") if sortable else ("", "")
    title = escape(table.title)
    notes = "".join(f"<li>{escape(note)}</li>" for note in table.footnotes)
    notice = f'<p class="notice">{escape(table.notice)}</p>' if table.notice else ""
    return (
        f'{notice}<div class="scroll" tabindex="0" role="region" aria-label="{title}"><table{kind}>'
        f"<caption{hidden}>{title}</caption><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></div>"
        + (f'<ul class="notes">{notes}</ul>' if notes else "")
    )


def _html_head(table: Table, column: int, *, sortable: bool) -> str:
    name = escape(table.header[column])
    if not sortable:
        return f'<th scope="col">{name}</th>'
    better = "low" if column in table.lower_is_better else "high"
    return f'<th scope="col" data-better="{better}"><button type="button">{name}</button></th>'


def _html_row(table: Table, row: int) -> str:
    kind = ' class="slanted"' if row in table.slanted else ""
    cells = (_html_cell(cell, bold=(row, column) in table.bold) for column, cell in enumerate(table.rows[row]))
    return f"<tr{kind}>{''.join(cells)}</tr>"


def _html_cell(cell: str | Cell, *, bold: bool) -> str:
    held = cell if isinstance(cell, Cell) else Cell(cell, value=cell)
    value = "" if held.value is None else held.value if isinstance(held.value, str) else f"{held.value:.9g}"
    text = f"<strong>{escape(held.text)}</strong>" if bold else escape(held.text)
    interval = f' <span class="interval">{escape(held.interval)}</span>' if held.interval else ""
    return f'<td data-value="{escape(value)}">{text}{interval}</td>'


def interval_text(interval: Interval | None, digits: int = 1) -> str:
    """Return the two ends of an interval."""
    return NO_INTERVAL if interval is None else f"[{interval[0]:.{digits}f}, {interval[1]:.{digits}f}]"


def share_text(share: float | None, ends: Interval | None) -> str:
    """Return a share and its interval in percent."""
    if share is None:
        return NONE
    return f"{100 * share:.1f} {interval_text(None if ends is None else (100 * ends[0], 100 * ends[1]))}"


def p_text(p: float | None) -> str:
    """Return a p-value."""
    if p is None:
        return NONE
    return "<0.001" if p < 0.001 else f"{p:.3f}"


def no_interval_footnotes(reason: str | None) -> Iterator[str]:
    """Yield why intervals are missing, if they are."""
    if reason is not None:
        yield f"{NO_INTERVAL} No intervals: {reason}."
