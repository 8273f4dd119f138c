"""The figures of a report about recognition with one planner: how sure answers are, and which classes win."""

from typing import Any

import numpy as np

from eval.render.palette import looks
from eval.reports.data import ReportData, finite
from eval.reports.style import Figure, beside_no_act, colour_scale, figure, pattern, plain, shortened
from eval.scores.predictability import LEVELS, RATIOS

LEVEL_COLOURS = ("@2", "@4", "@5", "@neutral")
LEVEL_PATTERNS = ("", "/", ".", "x")


def calibration(data: ReportData, name: str) -> Figure:
    """Return the reliability diagram of a planner, beside that of no-act."""
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
    for one in beside_no_act(data.planners, name):
        diagram, look = data.planners[one].reliability, styles[one]
        traces.append(
            {
                "x": finite(100 * diagram.confidence, 2),
                "y": finite(100 * diagram.accuracy, 2),
                "mode": "lines+markers",
                "connectgaps": True,
                "line": {"color": look.token, "dash": look.dash},
                "marker": {"color": look.token, "symbol": look.symbol, "size": 8},
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


def confused(data: ReportData, name: str) -> Figure:
    """Return the confusion of classes with a planner."""
    planner, names = data.planners[name], data.recognised_names
    ticks = [plain(name) for name in names]
    few, short = len(names) <= 12, shortened(names)
    trace: dict[str, Any] = {
        "type": "heatmap",
        "x": ticks,
        "y": ticks,
        "z": finite(100 * planner.confusion, 1),
        "zmin": 0,
        "zmax": 100,
        "colorscale": [[0, "@paper"], [1, "@0"]],
        "xgap": 1,
        "ygap": 1,
        "colorbar": colour_scale("share of frames [%]"),
        "hovertemplate": "%{y} taken for %{x}: %{z:.1f} % of frames<extra></extra>",
    }
    if few:
        trace |= {"texttemplate": "%{z:.0f}", "textfont": {"size": 12}}
    return figure(
        [trace],
        x={"title": "taken for", "type": "category", "showgrid": False, "tickangle": -40, "labelalias": short},
        y={"title": "true class", "type": "category", "autorange": "reversed", "showgrid": False, "labelalias": short},
        height=270 + max(200, min(28, 900 // len(names)) * len(names)),
        margin={"l": 56, "r": 16, "t": 16, "b": 150},
    )


def gains(data: ReportData, name: str) -> Figure | None:
    """Return how much more accurate a planner is than no-act in each class; None without a comparison."""
    planner, names = data.planners[name], data.class_names
    if planner.gains is None:
        return None
    gain, ends = 100 * planner.gains.gain, 100 * planner.gains.ci95
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
        y={
            "type": "category",
            "categoryorder": "array",
            "categoryarray": [plain(names[row]) for row in order],
            "labelalias": shortened(names),
        },
        height=160 + 26 * len(order),
    )


def classes(data: ReportData, name: str) -> Figure:
    """Return how early each class is recognised with a planner."""
    planner, names = data.planners[name], data.class_names
    held = [row for row in range(len(names)) if np.isfinite(planner.predictability.accuracy[row]).all()]
    order = sorted(held, key=lambda row: tuple(planner.predictability.accuracy[row]))
    traces = [
        {
            "x": finite(100 * planner.predictability.accuracy[order, column], 1),
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
        x={"title": f"{data.plural} recognised [%]", "range": [-3, 103]},
        y={
            "type": "category",
            "categoryorder": "array",
            "categoryarray": [plain(names[row]) for row in order],
            "labelalias": shortened(names),
        },
        height=160 + 26 * len(order),
    )


def predictability_figure(data: ReportData, _: str) -> Figure:
    """Return the share of episodes at each level of predictability, one bar per planner."""
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
                "pattern": pattern(LEVEL_PATTERNS[level]),
            },
            "hovertemplate": f"%{{y}}, {LEVELS[level]}: %{{x:.1f}} % of {data.plural}<extra></extra>",
        }
        for level in range(len(LEVELS))
    ]
    return figure(
        traces,
        x={"title": f"share of {data.plural} [%]", "range": [0, 100]},
        y={"type": "category"},
        height=150 + 28 * len(names),
        barmode="stack",
        legend={"orientation": "h", "y": -0.2, "yanchor": "top", "x": 0, "xanchor": "left", "traceorder": "normal"},
    )


def delays(data: ReportData, name: str) -> Figure | None:
    """Return how long the activities of each class take to be recognised with a planner, beside no-act."""
    fps, styles = data.run.conditions.fps or 1.0, looks(data.privileged)
    held, names = data.planners[name].delays, data.class_names
    if held is None:
        return None
    order = [row for row in np.argsort(-np.nan_to_num(held.means), kind="stable") if np.isfinite(held.means[row])]
    rng = np.random.default_rng(0)  # moves marks up and down, so that equal ones do not hide each other
    traces: list[dict[str, Any]] = []
    planners = beside_no_act(data.planners, name)
    for row, one in enumerate(planners):
        delays, look = data.planners[one].delays, styles[one]
        if delays is None:
            continue
        middle = (0.5 - (row + 0.5) / len(planners)) * 0.5  # no-act above, the planner below
        place = np.array([order.index(label) for label in delays.label]) + middle
        place += rng.uniform(-0.08, 0.08, len(place))
        for recognised, symbol, never in ((True, "circle", ""), (False, "x-thin", ", not recognised")):
            chosen = delays.recognised == recognised
            traces.append(
                {
                    "x": finite(delays.frames[chosen] / fps, 2),
                    "y": finite(place[chosen], 3),
                    "mode": "markers",
                    "marker": {
                        "color": f"{look.token}/0.45",
                        "size": 6 if recognised else 8,
                        "symbol": symbol,
                        "line": {"width": 0 if recognised else 2, "color": f"{look.token}/0.8"},
                    },
                    "showlegend": False,
                    "hovertemplate": f"{plain(one)}: %{{x:.2f}} s{never}<extra></extra>",
                }
            )
        traces.append(
            {
                "x": finite(delays.means[order] / fps, 3),
                "y": finite(np.arange(len(order)) + middle, 3),
                "customdata": finite(100 * delays.shares[order], 0),
                "mode": "markers",
                "marker": {
                    "color": look.token,
                    "symbol": look.symbol,
                    "size": 12,
                    "line": {"width": 2, "color": look.token},
                },
                "name": f"{plain(one)}, mean",
                "hovertemplate": f"{plain(one)}: %{{x:.2f}} s, %{{customdata:.0f}} % recognised<extra></extra>",
            }
        )
    short = shortened(names)
    return figure(
        traces,
        x={"title": "from the onset until right for good [s]", "rangemode": "tozero"},
        y={
            "tickvals": list(range(len(order))),
            "ticktext": [short.get(plain(names[row]), plain(names[row])) for row in order],
            "range": [-0.6, len(order) - 0.4],
            "zeroline": False,
        },
        height=160 + 36 * len(order),
    )
