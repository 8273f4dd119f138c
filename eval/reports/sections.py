"""The sections of a report that show figures: each is an entry of `SECTIONS`."""

from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from typing import Any

from eval.reports.behaviour_figures import moves, moves_text, position, sphere
from eval.reports.data import ReportData
from eval.reports.figures import accuracy_figure, cost_against_motion, cost_against_time, difference_figures
from eval.reports.recognition_figures import calibration, classes, confused, gains, predictability_figure
from eval.reports.style import Figure
from eval.reports.tables import differences_part, levels_table
from eval.scores.planner_summary import NO_ACT


@dataclass(frozen=True)
class ReportFigure:
    """A figure.

    Args:
        key: key by which the page's script finds the figure.
        label: label for screen readers.
        draw: draws the figure for the planner in focus, or returns None if there is none.
        focused: whether the figure depends on the planner in focus.
        heading: heading above the figure, if a section has several.
        text: description of the figure as HTML, or a function of the data that returns it.
        missing: text in place of a missing figure.
    """

    key: str
    label: str
    draw: Callable[[ReportData, str], Figure | None]
    focused: bool = True
    heading: str = ""
    text: str | Callable[[ReportData], str] = ""
    missing: str | Callable[[ReportData], str] = ""


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Args:
        anchor: anchor of its links.
        link: text of its link at the head of the page.
        heading: heading of the section.
        text: text below the heading, as HTML.
        figures: figures, row by row; figures of one row are side by side.
        before: HTML between text and figures.
        after: HTML below the figures.
    """

    anchor: str
    link: str
    heading: str
    text: str = ""
    figures: tuple[tuple[ReportFigure, ...], ...] = ()
    before: Callable[[ReportData], str] | None = None
    after: Callable[[ReportData], str] | None = None


ACCURACY = Section(
    anchor="accuracy",
    link="Accuracy",
    heading="Accuracy over the observed share",
    text=(
        "How many episodes are recognised once a share of their frames has been seen. The earlier a line rises, the "
        "earlier its planner knows. Bands are 95 % intervals of each point: of the planner in focus, no-act and the "
        "oracle."
    ),
    figures=(
        (
            ReportFigure(
                key="accuracy",
                label="Accuracy against the observed share of an episode, a line for each planner",
                draw=accuracy_figure,
            ),
        ),
    ),
)
COST = Section(
    anchor="cost",
    link="Cost",
    heading="Accuracy against its cost",
    text=(
        "Up is more accurate, left is cheaper. The dotted line is the Pareto front: planners without the truth on it, "
        "drawn larger, are beaten by none that costs as little. Bars are 95 % intervals. Times are of the machine that "
        "ran this."
    ),
    figures=(
        (
            ReportFigure(
                key="motion",
                label="Mean accuracy against the distance that cameras travelled",
                draw=cost_against_motion,
                focused=False,
            ),
            ReportFigure(
                key="time", label="Mean accuracy against planning time", draw=cost_against_time, focused=False
            ),
        ),
    ),
)
DIFFERENCES = Section(anchor="differences", link="Differences", heading="Paired differences", before=differences_part)
CALIBRATION = Section(
    anchor="calibration",
    link="Calibration",
    heading="Calibration",
    text=(
        "Of the answers that were this sure, how many were right. On the diagonal, probabilities can be taken at their "
        "word; below it, the recogniser is surer than it should be from the views that the planner chose. Bars show "
        "where its answers lie."
    ),
    figures=((ReportFigure("calibration", "Reliability diagram of the planner in focus", calibration),),),
)
CLASSES = Section(
    anchor="confusion",
    link="Classes",
    heading="Classes: what is confused, won and lost",
    figures=(
        (
            ReportFigure(
                key="gains",
                label="Accuracy of each class minus that of no-act, planner in focus",
                draw=gains,
                heading="Against no-act",
                text=(
                    "By how much the planner in focus is more accurate than no-act in each class. An interval is over "
                    "the sequences of that class alone and not corrected for the number of classes: one in 20 "
                    "excludes zero by chance."
                ),
                missing=f"Needs {NO_ACT} in the run, and another planner in focus.",
            ),
            ReportFigure(
                key="confusion",
                label="Confusion of classes, planner in focus",
                draw=confused,
                heading="Taken for",
                text=(
                    "In what share of its frames each true class is taken for each other, in percent. The diagonal is "
                    "right; a strong cell beside it is a pair that this planner's views do not tell apart."
                ),
            ),
        ),
    ),
)
CAMERAS = Section(
    anchor="cameras",
    link="Cameras",
    heading="Where cameras went",
    text=(
        "All frames of all episodes. Polar angle 0 looks straight down, 90 is level with the people; the level share "
        "of the planner in focus is in the table below."
    ),
    figures=(
        (
            ReportFigure("distance", "Histogram of distance", position(0)),
            ReportFigure("azimuth", "Histogram of azimuth", position(1)),
            ReportFigure("polar", "Histogram of polar angle", position(2)),
        ),
        (
            ReportFigure(
                key="sphere",
                label="Density of directions, seen from above",
                draw=sphere,
                heading="The sphere from above",
                text=(
                    "The middle is straight above the people, the rim level with them, in a projection that keeps "
                    "areas: an even disc means all directions alike. The stronger the blue, the more often; a few "
                    "cells lie beyond the scale."
                ),
            ),
            ReportFigure(
                key="moves",
                label="Share of each move in each third of the episode",
                draw=moves,
                heading="Moves by stage",
                text=moves_text,
                missing=moves_text,
            ),
        ),
    ),
    after=levels_table,
)
PREDICTABILITY = Section(
    anchor="predictability",
    link="Predictability",
    heading="Predictability",
    text=(
        "An episode is recognised <em>instantly</em> if it is right after 10 % of its frames and stays so at 50 and "
        "100 %, <em>early</em> if from 50 % on, <em>late</em> if only at 100 %, and else <em>never</em> by the end."
    ),
    figures=(
        (
            ReportFigure(
                key="predictability",
                label="Share of episodes recognised instantly, early, late and never",
                draw=predictability_figure,
                focused=False,
            ),
        ),
        (
            ReportFigure(
                key="classes",
                label="Share of each class's episodes recognised after 10, 50 and 100 % of their frames",
                draw=classes,
                heading="By class, planner in focus",
            ),
        ),
    ),
)

SECTIONS: tuple[Section, ...] = (ACCURACY, COST, DIFFERENCES, CALIBRATION, CLASSES, CAMERAS, PREDICTABILITY)

_ROWS = {1: "", 2: "pair", 3: "triple"}  # the class of a row, by how many figures it has


def links(sections: tuple[Section, ...]) -> str:
    """Return links to the sections, as HTML."""
    return "\n".join(f'<a href="#{section.anchor}">{escape(section.link)}</a>' for section in sections)


def section_html(section: Section, data: ReportData) -> str:
    """Return a section as HTML; the page's script draws the figures."""
    parts = [f'<section id="{section.anchor}">', f"<h2>{escape(section.heading)}</h2>"]
    parts += [f"<p>{section.text}</p>"] if section.text else []
    parts += [] if section.before is None else [section.before(data)]
    for row in section.figures:
        drawn = [_figure_html(figure, data, alone=len(row) == 1) for figure in row]
        kind = _ROWS.get(len(row), "pair")
        parts.append(f'<div class="{kind}">{"".join(drawn)}</div>' if kind else drawn[0])
    parts += [] if section.after is None else [section.after(data)]
    return "\n".join((*parts, "</section>"))


def _figure_html(figure: ReportFigure, data: ReportData, *, alone: bool) -> str:
    """Return the HTML of a figure's place, below its heading and text."""
    group = ' data-group="focus"' if figure.focused else ""
    place = (
        f'<div class="figure" data-figure="{figure.key}"{group} role="img" aria-label="{escape(figure.label)}"></div>'
    )
    if not figure.heading:
        return place
    text = figure.text(data) if callable(figure.text) else figure.text
    said = f"<h3>{escape(figure.heading)}</h3>" + (f"<p>{text}</p>" if text else "")
    return f"{said}{place}" if alone else f"<div>{said}{place}</div>"


def drawn(sections: tuple[Section, ...], data: ReportData) -> dict[str, Any]:
    """Return all figures for the page's script: fixed figures, and those for each planner that a reader may pick."""
    figures = [figure for section in sections for row in section.figures for figure in row]
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
