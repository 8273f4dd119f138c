"""The figures of a report about one planner's behaviour: where its camera goes, and which moves it makes."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ehar.viewpoint import MOVE_NAMES
from eval.render.palette import looks
from eval.reports.data import ReportData, finite
from eval.reports.style import Figure, beside_no_act, colour_scale, figure, pattern, plain
from eval.scores.behaviour import STAGES

STAGE_PATTERNS = ("", "/", "x")
FULL_COLOUR = 0.99  # the share of cells that the colours tell apart


def position(row: int) -> Callable[[ReportData, str], Figure]:
    """Return a function that draws a planner's histogram of distance (0), azimuth (1) or polar angle (2)."""

    def draw(data: ReportData, name: str) -> Figure:
        return _positions(data, name, row)

    return draw


def moves_text(data: ReportData) -> str:
    """Return what the figure of moves shows, or why there is none."""
    if data.run.flown:
        return "Cameras flew, and flights make no moves."
    if all(planner.moves is None for planner in data.planners.values()):
        return "Episodes are too short for three stages."
    return "Which of the grid's seven moves the camera made in each third of an episode."


def _positions(data: ReportData, name: str, row: int) -> Figure:
    styles = looks(data.privileged)
    traces = []
    for one in beside_no_act(data.planners, name):
        histogram, look = data.planners[one].positions[row], styles[one]
        width = np.diff(histogram.axis.edges)
        share = 100 * histogram.density * width
        # A step to the end of the last bin.
        traces.append(
            {
                "x": finite(histogram.axis.edges, 3),
                "y": finite(np.append(share, share[-1]), 3),
                "mode": "lines",
                "line": {"shape": "hv", "color": look.token, "dash": look.dash, "width": 2},
                "name": plain(one),
                "hovertemplate": f"{plain(one)}: %{{y:.1f}} % of frames from %{{x:.1f}}<extra></extra>",
            }
        )
    axis = data.planners[name].positions[row].axis
    return figure(
        traces, x=f"{axis.name} [{axis.unit}]", y={"title": "share of frames [%]", "rangemode": "tozero"}, height=300
    )


def sphere(data: ReportData, name: str) -> Figure:
    """Return the density of a planner's directions, seen from above."""
    density = data.planners[name].sphere
    middles = (density.edges[:-1] + density.edges[1:]) / 2
    turn = np.radians(np.arange(0, 361, 5))
    rings: list[dict[str, Any]] = []
    labels: list[dict[str, Any]] = []
    for polar in (30, 60, 90):
        radius = np.sqrt(2) * np.sin(np.radians(polar) / 2)
        rings.append(
            {
                "x": finite(radius * np.cos(turn), 3),
                "y": finite(radius * np.sin(turn), 3),
                "mode": "lines",
                "line": {"color": "@text", "width": 1, "dash": "dot"},
                "hoverinfo": "skip",
                "showlegend": False,
            }
        )
        labels.append({"x": 0, "y": -radius, "text": f"{polar}°", "showarrow": False, "bgcolor": "@paper/0.7"})
    rim = float(density.edges[-1])
    labels.append(
        {"x": 1.02 * rim, "y": 0, "text": "azimuth 0°", "showarrow": False, "textangle": 90, "xanchor": "left"}
    )
    labels.append({"x": 0, "y": 1.02 * rim, "text": "azimuth 90°", "showarrow": False, "yanchor": "bottom"})
    trace = {
        "type": "heatmap",
        "x": finite(middles, 3),
        "y": finite(middles, 3),
        "z": finite(density.times_even, 2),
        "zmin": 0,
        "zmax": round(float(np.nanquantile(density.times_even, FULL_COLOUR)), 2),
        "colorscale": [[0, "@paper"], [1, "@0"]],
        "colorbar": colour_scale("times as often as if even"),
        "hovertemplate": "%{z:.1f} times as often as if even<extra></extra>",
    }
    blank = {"visible": False, "range": [-1.18 * rim, 1.18 * rim]}
    return figure(
        [trace, *rings],
        x=blank,
        y={**blank, "scaleanchor": "x"},
        height=440,
        annotations=labels,
        margin={"l": 8, "r": 8, "t": 8, "b": 70},
    )


def moves(data: ReportData, name: str) -> Figure | None:
    """Return which moves a planner made in each third of the episode; None for flights and very short episodes."""
    shares = data.planners[name].moves
    if shares is None:
        return None
    traces = [
        {
            "type": "bar",
            "x": list(MOVE_NAMES),
            "y": finite(100 * shares[stage], 2),
            "name": STAGES[stage],
            "marker": {
                "color": f"@{(0, 4, 1)[stage - 1]}",
                "pattern": pattern(STAGE_PATTERNS[stage - 1]),
            },
            "hovertemplate": f"{STAGES[stage]}, %{{x}}: %{{y:.1f}} % of moves<extra></extra>",
        }
        for stage in range(1, len(STAGES))
    ]
    return figure(traces, x={"type": "category"}, y="share of moves [%]", height=380, barmode="group")
