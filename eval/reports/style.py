"""The common style of a report's Plotly figures.

A figure is a dict of Plotly's JSON schema. Its colours are tokens that the page replaces by those of its light or dark
theme, see `eval.render.palette`: `@0` to `@5`, `@neutral`, `@text`, `@grid`, `@paper`; `@0/0.2` has an opacity of 0.2.
"""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

from eval.scores.planner_summary import NO_ACT

Figure = dict[str, Any]

LONGEST_LABEL = 24  # characters of an axis's label; from 45 on Plotly cannot draw a confusion of few classes


def plain(text: str) -> str:
    """Return text that Plotly shows unchanged, because Plotly takes some HTML for markup."""
    return escape(text, quote=False)


def pattern(shape: str) -> dict[str, Any]:
    """Return a pattern over a bar's own colour, for readers who cannot tell colours apart."""
    return {"shape": shape, "fillmode": "overlay", "fgcolor": "@paper", "size": 7, "solidity": 0.25}


def colour_scale(title: str) -> dict[str, Any]:
    """Return a scale of colours below a figure, where a phone has room for it."""
    below = {"orientation": "h", "y": 0, "yref": "container", "yanchor": "bottom"}
    return {**below, "title": {"text": title, "side": "bottom"}, "thickness": 10, "outlinewidth": 0}


def shortened(names: Sequence[str]) -> dict[str, str]:
    """Return the short form, start and end, of each name that is so long that it leaves no room for the plot."""
    long = [name for name in names if len(name) > LONGEST_LABEL]
    return {plain(name): plain(f"{name[:14]}…{name[-9:]}") for name in long}


def beside_no_act(planners: Iterable[str], name: str) -> list[str]:
    """Return the planners of a figure about one planner: no-act, if it ran, and that planner."""
    ran = set(planners)
    return list(dict.fromkeys(one for one in (NO_ACT, name) if one in ran))


def figure(
    data: Sequence[Mapping[str, Any]],
    *,
    x: Mapping[str, Any] | str,
    y: Mapping[str, Any] | str,
    height: int = 380,
    **layout: Any,
) -> Figure:
    """Return a figure with titled axes.

    Args:
        data: its traces.
        x: title of the x axis, or all of its options.
        y: title of the y axis, or all of its options.
        height: [px].
        layout: more of Plotly's options.
    """
    return {
        "data": [dict(trace) for trace in data],
        "layout": {
            "height": height,
            "margin": {"l": 56, "r": 16, "t": 16, "b": 48},
            "paper_bgcolor": "@paper",
            "plot_bgcolor": "@paper",
            "font": {"color": "@text", "size": 13},
            "legend": {"orientation": "h", "y": -0.2, "yanchor": "top", "x": 0, "xanchor": "left"},
            "hovermode": "closest",
            "xaxis": _axis(x),
            "yaxis": _axis(y),
            **layout,
        },
    }


def _axis(options: Mapping[str, Any] | str) -> dict[str, Any]:
    given = {"title": options} if isinstance(options, str) else dict(options)
    title = {"text": given.pop("title", ""), "standoff": 8}
    return {
        "title": title,
        "gridcolor": "@grid",
        "linecolor": "@grid",
        "zerolinecolor": "@grid",
        "automargin": True,
        "fixedrange": True,
        **given,
    }
