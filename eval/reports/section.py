"""A section of a report: what it says, its figures, and how both become HTML and what the page's script draws."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from eval.reports.data import ReportData
from eval.reports.figures import difference_figures
from eval.reports.style import Figure


@dataclass(frozen=True)
class ReportFigure:
    """A figure.

    Args:
        key: by which the page's script finds it.
        label: for screen readers.
        draw: it, for the planner in focus; None where it cannot be had.
        focused: whether it is another one for each planner in focus.
        heading: above it, where a section has several.
        text: what it shows, as HTML; or a function of the data.
        missing: what stands in its place.
        shown: whether a run has a place for it; None if every run has.
    """

    key: str
    label: str
    draw: Callable[[ReportData, str], Figure | None]
    focused: bool = True
    heading: str = ""
    text: str | Callable[[ReportData], str] = ""
    missing: str | Callable[[ReportData], str] = ""
    shown: Callable[[ReportData], bool] | None = None


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Args:
        anchor: of its links.
        link: what the page's head calls it.
        heading: above it.
        text: below the heading, as HTML; or a function of the data.
        figures: row by row; those of a row stand beside each other.
        before: HTML between text and figures.
        after: HTML below the figures.
    """

    anchor: str
    link: str
    heading: str
    text: str | Callable[[ReportData], str] = ""
    figures: tuple[tuple[ReportFigure, ...], ...] = ()
    before: Callable[[ReportData], str] | None = None
    after: Callable[[ReportData], str] | None = None

    def rows(self, data: ReportData) -> list[list[ReportFigure]]:
        """Return the figures that a run has a place for, row by row."""
        shown = ([figure for figure in row if figure.shown is None or figure.shown(data)] for row in self.figures)
        return [row for row in shown if row]


_ROWS = {1: "", 2: "pair", 3: "triple"}  # the class of a row, by how many figures it has


def links(sections: Sequence[Section]) -> str:
    """Return links to the sections, as HTML."""
    return "\n".join(f'<a href="#{section.anchor}">{escape(section.link)}</a>' for section in sections)


def section_html(section: Section, data: ReportData) -> str:
    """Return a section as HTML; the page's script draws the figures."""
    parts = [f'<section id="{section.anchor}">', f"<h2>{escape(section.heading)}</h2>"]
    text = section.text(data) if callable(section.text) else section.text
    parts += [f"<p>{text}</p>"] if text else []
    parts += [] if section.before is None else [section.before(data)]
    for row in section.rows(data):
        drawn = [_figure_html(figure, data, alone=len(row) == 1) for figure in row]
        kind = _ROWS.get(len(row), "pair")
        parts.append(f'<div class="{kind}">{"".join(drawn)}</div>' if kind else drawn[0])
    parts += [] if section.after is None else [section.after(data)]
    return "\n".join((*parts, "</section>"))


def _figure_html(figure: ReportFigure, data: ReportData, *, alone: bool) -> str:
    """Return where a figure is drawn, below what is said of it."""
    group = ' data-group="focus"' if figure.focused else ""
    place = (
        f'<div class="figure" data-figure="{figure.key}"{group} role="img" aria-label="{escape(figure.label)}"></div>'
    )
    if not figure.heading:
        return place
    text = figure.text(data) if callable(figure.text) else figure.text
    said = f"<h3>{escape(figure.heading)}</h3>" + (f"<p>{text}</p>" if text else "")
    return f"{said}{place}" if alone else f"<div>{said}{place}</div>"


def drawn(sections: Sequence[Section], data: ReportData) -> dict[str, Any]:
    """Return all figures for the page's script: those of their own, and those of a planner that the reader picks."""
    figures = [figure for section in sections for row in section.rows(data) for figure in row]
    names = list(data.planners)
    focused = {name: _of_planner(figures, data, name, focused=True) for name in names}
    missing = {
        figure.key: figure.missing(data) if callable(figure.missing) else figure.missing
        for figure in figures
        if figure.missing
    }
    pairs = {name: {"pairs": pair} for name, pair in difference_figures(data).items()}
    return {
        "figures": _of_planner(figures, data, names[0], focused=False),
        "grouped": {"focus": focused, "pairs": pairs},
        "missing": missing,
    }


def _of_planner(figures: list[ReportFigure], data: ReportData, name: str, *, focused: bool) -> dict[str, Figure]:
    found = {figure.key: figure.draw(data, name) for figure in figures if figure.focused == focused}
    return {key: figure for key, figure in found.items() if figure is not None}
