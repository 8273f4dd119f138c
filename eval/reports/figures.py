"""The figures of a report that compare planners: accuracy, its cost, and paired differences."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from eval.render.palette import LINE, STRONG, Look, looks
from eval.reports.data import ReportData, finite
from eval.reports.style import Figure, figure, plain
from eval.scores.differences import Difference
from eval.scores.planner_metrics import PATH_LENGTH
from eval.scores.planner_summary import ENERGY, NO_ACT, ORACLE

LEAST_MS = 1e-4  # planning times below are drawn here, as the axis is logarithmic


def accuracy_figure(data: ReportData, focus: str) -> Figure:
    """Return accuracy over the observation ratio; no-act, the oracle and the planner in focus have bands."""
    styles = looks(data.privileged)
    length = len(next(iter(data.curves.values())))
    ratios = finite(100 * np.arange(1, length + 1) / length, 2)
    banded = [name for name in data.curves if name in (NO_ACT, ORACLE, focus)]
    traces: list[dict[str, Any]] = []
    for name in banded:
        band = 100 * data.bands[name]
        if np.isfinite(band).all():
            traces.append(
                {
                    "x": ratios + ratios[::-1],
                    "y": finite(np.concatenate([band[:, 0], band[::-1, 1]]), 2),
                    "fill": "toself",
                    "fillcolor": f"{styles[name].token}/0.16",
                    "line": {"width": 0},
                    "mode": "lines",
                    "hoverinfo": "skip",
                    "showlegend": False,
                    "legendgroup": plain(name),
                }
            )
    for name, curve in data.curves.items():
        look = styles[name]
        traces.append(
            {
                "x": ratios,
                "y": finite(100 * curve, 2),
                "name": _legend(name, data),
                "legendgroup": plain(name),
                "mode": "lines",
                "opacity": 1.0 if name in banded else 0.55,
                "line": {"color": look.token, "dash": look.dash, "width": STRONG if name == focus else LINE},
                "hovertemplate": f"{plain(name)}<br>%{{x:.0f}} % seen: %{{y:.1f}} %<extra></extra>",
            }
        )
    chance = 100 / len(data.class_names)
    traces.append(
        {
            "x": [0, 100],
            "y": [chance, chance],
            "name": "chance",
            "mode": "lines",
            "line": {"color": "@neutral", "width": 1, "dash": "dot"},
            "hovertemplate": f"chance: {chance:.1f} %<extra></extra>",
        }
    )
    return figure(
        traces,
        x={"title": f"observed share of the {data.watched} [%]", "range": [0, 100]},
        y={"title": "accuracy [%]", "rangemode": "tozero"},
        height=480,
    )


def cost_against_motion(data: ReportData, _: str) -> Figure:
    """Return accuracy against the distance that cameras travelled, with the Pareto front of those without the truth."""
    metres = np.array([planner.metrics[PATH_LENGTH.key] for planner in data.summary.planners])
    return _cost(data, metres, {"title": "path length of an episode [m]", "rangemode": "tozero"}, "m")


def cost_against_time(data: ReportData, _: str) -> Figure:
    """Return accuracy against planning time, with the Pareto front of those without the truth."""
    milliseconds = np.maximum([planner.step_ms for planner in data.summary.planners], LEAST_MS)
    axis: dict[str, Any] = {"title": "planning time a frame [ms], log scale", "type": "log", "tickformat": "~g"}
    if milliseconds.max() > 100 * milliseconds.min():
        axis["dtick"] = 1  # powers of ten alone: over so many of them the labels of 2 and 5 overlap
    return _cost(data, milliseconds, axis, "ms")


def has_energy(data: ReportData) -> bool:
    """Return whether the energy of every planner's flights is known."""
    return all(ENERGY.of(planner) is not None for planner in data.summary.planners)


def cost_against_energy(data: ReportData, _: str) -> Figure | None:
    """Return accuracy against the energy of flights, with the Pareto front; None where it is not known."""
    if not has_energy(data):
        return None
    kilojoules = np.array([ENERGY.of(planner) for planner in data.summary.planners], dtype=np.float64)
    return _cost(data, kilojoules, {"title": "energy of an episode [kJ], not from 0"}, "kJ")


def pareto_front(cost: FloatArray, value: FloatArray) -> BoolArray:
    """Return which of n choices are not dominated, (n,): none is as good in both and better in one.

    Args:
        cost: (n,), of which less is better.
        value: (n,), of which more is better.
    """
    as_good = (cost[:, None] <= cost) & (value[:, None] >= value)  # [other, choice]
    better = (cost[:, None] < cost) | (value[:, None] > value)
    beaten: BoolArray = np.asarray((as_good & better).any(axis=0))
    return ~beaten


def _cost(data: ReportData, cost: FloatArray, axis: Mapping[str, Any], unit: str) -> Figure:
    planners = data.summary.planners
    value = np.array([planner.acc_mean for planner in planners])
    styles = looks(data.privileged)
    able = np.flatnonzero([not planner.privileged for planner in planners])
    front = able[pareto_front(cost[able], value[able])]
    front = front[np.argsort(cost[front], kind="stable")]
    traces: list[dict[str, Any]] = [
        {
            "x": finite(cost[front], 4),
            "y": finite(value[front], 2),
            "mode": "lines",
            "line": {"color": "@text", "width": 1.5, "dash": "dot", "shape": "hv"},
            "name": "Pareto front",
            "hoverinfo": "skip",
        }
    ]
    for row, planner in enumerate(planners):
        name = planner.name
        ends = planner.acc_mean_ci95
        on_front = row in front
        traces.append(
            {
                "x": [round(float(cost[row]), 4)],
                "y": [round(float(value[row]), 2)],
                "error_y": _errors([value[row]], [ends], thickness=1),
                "name": _legend(name, data) + (" (Pareto front)" if on_front else ""),
                "mode": "markers",
                "cliponaxis": False,
                "marker": _marker(styles[name], 13 if on_front else 9),
                "hovertemplate": f"{plain(name)}<br>%{{y:.1f}} %, %{{x:.4g}} {unit}<extra></extra>",
            }
        )
    return figure(traces, x=axis, y="mean accuracy [%]", height=400 + 14 * len(planners))


def difference_figures(data: ReportData) -> dict[str, Figure]:
    """Return the paired differences of each planner that is compared with the others, by its name."""
    found: dict[str, list[Difference]] = {}
    for pair in data.summary.differences:
        found.setdefault(pair.planner, []).append(pair)
    return {name: _differences(name, pairs) for name, pairs in found.items()}


def _differences(name: str, pairs: list[Difference]) -> Figure:
    pairs = sorted(pairs, key=lambda pair: pair.acc_mean)
    rows = [plain(pair.other) for pair in pairs]
    means = [pair.acc_mean for pair in pairs]
    clear = [pair.is_clear for pair in pairs]
    smallest = [pair.smallest for pair in pairs]
    traces: list[dict[str, Any]] = []
    if any(value is not None for value in smallest):
        traces.append(
            {
                "type": "bar",
                "orientation": "h",
                "y": rows,
                "base": [-(value or 0) for value in smallest],
                "x": [2 * (value or 0) for value in smallest],
                "marker": {"color": "@neutral/0.18"},
                "name": "too small for this run to show 8 times in 10",
                "hoverinfo": "skip",
            }
        )
    for kind, label, symbol, colour in (
        (True, "interval excludes zero", "circle", "@0"),
        (False, "interval includes zero", "circle-open", "@neutral"),
    ):
        chosen = [row for row, is_clear in enumerate(clear) if is_clear is kind]
        if chosen:
            values = [means[row] for row in chosen]
            traces.append(
                {
                    "x": [round(value, 3) for value in values],
                    "y": [rows[row] for row in chosen],
                    "mode": "markers",
                    "marker": {"color": colour, "size": 11, "symbol": symbol, "line": {"width": 2, "color": colour}},
                    "error_x": {
                        **_errors(values, [pairs[row].ci95_corrected for row in chosen], thickness=2),
                        "color": colour,
                    },
                    "name": label,
                    "hovertemplate": f"{plain(name)} minus %{{y}}: %{{x:+.1f}} points<extra></extra>",
                }
            )
    return figure(
        traces,
        x={"title": f"{plain(name)} minus the other [points]", "zerolinecolor": "@text"},
        y={"type": "category", "categoryorder": "array", "categoryarray": rows},
        height=150 + 34 * len(rows),
        barmode="overlay",
    )


def _errors(values: Any, ends: list[Any], *, thickness: float) -> dict[str, Any]:
    """Return Plotly's error bars from interval ends; none where an interval is missing."""
    high = [0 if pair is None else round(pair[1] - value, 3) for value, pair in zip(values, ends, strict=True)]
    low = [0 if pair is None else round(value - pair[0], 3) for value, pair in zip(values, ends, strict=True)]
    return {"type": "data", "symmetric": False, "array": high, "arrayminus": low, "thickness": thickness, "width": 4}


def _marker(look: Look, size: int) -> dict[str, Any]:
    return {"color": look.token, "symbol": look.symbol, "size": size, "line": {"color": "@text", "width": 1}}


def _legend(name: str, data: ReportData) -> str:
    return plain(name) + (" (privileged)" if data.privileged[name] else "")
