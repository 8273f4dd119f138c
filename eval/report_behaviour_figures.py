"""The figures of a report about one planner: how sure it is, what it confuses, and where its camera goes."""

from typing import Any

import numpy as np

from ehar.viewpoint import MOVE_NAMES
from eval.behaviour import STAGES
from eval.predictability import LEVELS, RATIOS
from eval.report_data import PlannerData, ReportData, finite
from eval.report_style import Figure, figure, looks, plain
from eval.summary import NO_ACT

STAGE_PATTERNS = ("", "/", "x")
LEVEL_COLOURS = ("@2", "@4", "@5", "@neutral")
LEVEL_PATTERNS = ("", "/", ".", "x")
FULL_COLOUR = 0.99  # the share of cells that the colours tell apart


def planner_figures(data: ReportData, name: str) -> dict[str, Figure]:
    """Return the figures of one planner by their kind; those that cannot be had are left out."""
    of = data.planners[name]
    figures = {
        "calibration": _calibration(data, name),
        "confusion": _confusion(of, data.class_names),
        "sphere": _sphere(of),
        "classes": _classes(of, data.class_names),
        **{histogram.axis.name.split()[0]: _positions(data, name, row) for row, histogram in enumerate(of.positions)},
    }
    if of.gains is not None:
        figures["gains"] = _gains(of, data.class_names)
    if of.moves is not None:
        figures["moves"] = _moves(of)
    return figures


def _pattern(shape: str) -> dict[str, Any]:
    """Return a pattern over a bar's own colour, for who cannot tell colours."""
    return {"shape": shape, "fillmode": "overlay", "fgcolor": "@paper", "size": 7, "solidity": 0.25}


def _scale(title: str) -> dict[str, Any]:
    """Return a scale of colours below a figure, where a phone has room for it."""
    below = {"orientation": "h", "y": 0, "yref": "container", "yanchor": "bottom"}
    return {**below, "title": {"text": title, "side": "bottom"}, "thickness": 10, "outlinewidth": 0}


def _shown(data: ReportData, name: str) -> list[str]:
    """Return a planner, behind no-act where that ran."""
    return list(dict.fromkeys(one for one in (NO_ACT, name) if one in data.planners))


def _calibration(data: ReportData, name: str) -> Figure:
    styles = looks(data.privileged)
    bins = data.planners[name].reliability
    traces: list[dict[str, Any]] = [
        {
            "type": "bar",
            "x": finite(100 * bins.confidence, 2),
            "y": finite(100 * bins.share, 2),
            "marker": {"color": "@neutral/0.25"},
            "name": f"share of the answers of {plain(name)}",
            "hovertemplate": "%{y:.1f} % of answers<extra></extra>",
            "width": 4,
        },
        {
            "x": [0, 100],
            "y": [0, 100],
            "mode": "lines",
            "line": {"color": "@text", "width": 1, "dash": "dot"},
            "name": "as sure as right",
            "hoverinfo": "skip",
        },
    ]
    for one in _shown(data, name):
        of, look = data.planners[one].reliability, styles[one]
        traces.append(
            {
                "x": finite(100 * of.confidence, 2),
                "y": finite(100 * of.accuracy, 2),
                "mode": "lines+markers",
                "connectgaps": True,
                "line": {"color": look.colour, "dash": look.dash},
                "marker": {"color": look.colour, "symbol": look.symbol, "size": 8},
                "name": plain(one),
                "hovertemplate": f"{plain(one)}<br>%{{x:.0f}} % sure: %{{y:.0f}} % right<extra></extra>",
            }
        )
    return figure(
        traces,
        x={"title": "probability of the answer [%]", "range": [0, 102]},
        y={"title": "right answers [%]", "range": [0, 102]},
        height=440,
    )


def _confusion(of: PlannerData, names: tuple[str, ...]) -> Figure:
    ticks = [plain(name) for name in names]
    few = len(names) <= 12
    trace: dict[str, Any] = {
        "type": "heatmap",
        "x": ticks,
        "y": ticks,
        "z": finite(100 * of.confusion, 1),
        "zmin": 0,
        "zmax": 100,
        "colorscale": [[0, "@paper"], [1, "@0"]],
        "xgap": 1,
        "ygap": 1,
        "colorbar": _scale("share of frames [%]"),
        "hovertemplate": "%{y} taken for %{x}: %{z:.1f} % of frames<extra></extra>",
    }
    if few:
        trace |= {"texttemplate": "%{z:.0f}", "textfont": {"size": 12}}
    return figure(
        [trace],
        x={"title": "taken for", "type": "category", "showgrid": False, "tickangle": -40},
        y={"title": "true class", "type": "category", "autorange": "reversed", "showgrid": False},
        height=270 + max(200, min(28, 900 // len(names)) * len(names)),
        margin={"l": 56, "r": 16, "t": 16, "b": 150},
    )


def _gains(of: PlannerData, names: tuple[str, ...]) -> Figure:
    assert of.gains is not None
    gain, ends = 100 * of.gains.gain, 100 * of.gains.ci95
    order = [row for row in np.argsort(gain, kind="stable") if np.isfinite(gain[row])]
    traces = []
    for label, symbol, colour, chosen in (
        ("wins: the interval is above zero", "circle", "@0", [row for row in order if ends[row, 0] > 0]),
        ("loses: the interval is below zero", "diamond", "@1", [row for row in order if ends[row, 1] < 0]),
        (
            "cannot be told",
            "circle-open",
            "@neutral",
            [row for row in order if not (ends[row, 0] > 0 or ends[row, 1] < 0)],
        ),
    ):
        if not chosen:
            continue
        widths = np.nan_to_num(np.stack([ends[chosen, 1] - gain[chosen], gain[chosen] - ends[chosen, 0]]))
        traces.append(
            {
                "x": finite(gain[chosen], 2),
                "y": [plain(names[row]) for row in chosen],
                "mode": "markers",
                "marker": {"color": colour, "symbol": symbol, "size": 11, "line": {"color": colour, "width": 2}},
                "error_x": {
                    "type": "data",
                    "symmetric": False,
                    "array": finite(widths[0], 2),
                    "arrayminus": finite(widths[1], 2),
                    "color": colour,
                    "thickness": 2,
                    "width": 4,
                },
                "name": label,
                "hovertemplate": "%{y}: %{x:+.1f} points<extra></extra>",
            }
        )
    return figure(
        traces,
        x={"title": "more accurate than no-act [points]", "zerolinecolor": "@text"},
        y={"type": "category", "categoryorder": "array", "categoryarray": [plain(names[row]) for row in order]},
        height=160 + 26 * len(order),
    )


def _positions(data: ReportData, name: str, row: int) -> Figure:
    styles = looks(data.privileged)
    traces = []
    for one in _shown(data, name):
        histogram, look = data.planners[one].positions[row], styles[one]
        width = np.diff(histogram.axis.edges)
        share = 100 * histogram.density * width
        # A step to the end of the last bin.
        traces.append(
            {
                "x": finite(histogram.axis.edges, 3),
                "y": finite(np.append(share, share[-1]), 3),
                "mode": "lines",
                "line": {"shape": "hv", "color": look.colour, "dash": look.dash, "width": 2},
                "name": plain(one),
                "hovertemplate": f"{plain(one)}: %{{y:.1f}} % of frames from %{{x:.1f}}<extra></extra>",
            }
        )
    axis = data.planners[name].positions[row].axis
    return figure(
        traces, x=f"{axis.name} [{axis.unit}]", y={"title": "share of frames [%]", "rangemode": "tozero"}, height=300
    )


def _sphere(of: PlannerData) -> Figure:
    middles = (of.sphere.edges[:-1] + of.sphere.edges[1:]) / 2
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
    labels.append({"x": 1.02, "y": 0, "text": "azimuth 0°", "showarrow": False, "textangle": 90, "xanchor": "left"})
    labels.append({"x": 0, "y": 1.02, "text": "azimuth 90°", "showarrow": False, "yanchor": "bottom"})
    trace = {
        "type": "heatmap",
        "x": finite(middles, 3),
        "y": finite(middles, 3),
        "z": finite(of.sphere.times_even, 2),
        "zmin": 0,
        "zmax": round(float(np.nanquantile(of.sphere.times_even, FULL_COLOUR)), 2),
        "colorscale": [[0, "@paper"], [1, "@0"]],
        "colorbar": _scale("times as often as if even"),
        "hovertemplate": "%{z:.1f} times as often as if even<extra></extra>",
    }
    blank = {"visible": False, "range": [-1.18, 1.18]}
    return figure(
        [trace, *rings],
        x=blank,
        y={**blank, "scaleanchor": "x"},
        height=440,
        annotations=labels,
        margin={"l": 8, "r": 8, "t": 8, "b": 70},
    )


def _moves(of: PlannerData) -> Figure:
    assert of.moves is not None
    traces = [
        {
            "type": "bar",
            "x": list(MOVE_NAMES),
            "y": finite(100 * of.moves[stage], 2),
            "name": STAGES[stage],
            "marker": {
                "color": f"@{(0, 4, 1)[stage - 1]}",
                "pattern": _pattern(STAGE_PATTERNS[stage - 1]),
            },
            "hovertemplate": f"{STAGES[stage]}, %{{x}}: %{{y:.1f}} % of moves<extra></extra>",
        }
        for stage in range(1, len(STAGES))
    ]
    return figure(traces, x={"type": "category"}, y="share of moves [%]", height=380, barmode="group")


def _classes(of: PlannerData, names: tuple[str, ...]) -> Figure:
    held = [row for row in range(len(names)) if np.isfinite(of.predictability.accuracy[row]).all()]
    order = sorted(held, key=lambda row: tuple(of.predictability.accuracy[row]))
    traces = [
        {
            "x": finite(100 * of.predictability.accuracy[order, column], 1),
            "y": [plain(names[row]) for row in order],
            "mode": "markers",
            "marker": {
                "symbol": symbol,
                "color": colour,
                "size": 11,
                "line": {"width": 2, "color": colour},
            },
            "name": f"after {RATIOS[column]} %",
            "hovertemplate": f"%{{y}} after {RATIOS[column]} %: %{{x:.0f}} % right<extra></extra>",
        }
        for column, (symbol, colour) in enumerate((("circle-open", "@1"), ("diamond-open", "@4"), ("circle", "@0")))
    ]
    return figure(
        traces,
        x={"title": "episodes recognised [%]", "range": [-3, 103]},
        y={"type": "category", "categoryorder": "array", "categoryarray": [plain(names[row]) for row in order]},
        height=160 + 26 * len(order),
    )


def predictability_figure(data: ReportData) -> Figure:
    """Return the share of episodes at each level of predictability, one bar a planner."""
    names = list(data.planners)[::-1]
    traces = [
        {
            "type": "bar",
            "orientation": "h",
            "y": [plain(name) for name in names],
            "x": finite(np.array([100 * data.planners[name].predictability.total[level] for name in names]), 2),
            "name": LEVELS[level],
            "marker": {
                "color": LEVEL_COLOURS[level],
                "pattern": _pattern(LEVEL_PATTERNS[level]),
            },
            "hovertemplate": f"%{{y}}, {LEVELS[level]}: %{{x:.1f}} % of episodes<extra></extra>",
        }
        for level in range(len(LEVELS))
    ]
    return figure(
        traces,
        x={"title": "share of episodes [%]", "range": [0, 100]},
        y={"type": "category"},
        height=150 + 28 * len(names),
        barmode="stack",
        legend={"orientation": "h", "y": -0.2, "yanchor": "top", "x": 0, "xanchor": "left", "traceorder": "normal"},
    )
