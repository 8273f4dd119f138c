"""The accuracy curve (Fig. 5), as PNG and SVG; the same numbers give the same bytes."""

from collections.abc import Collection, Mapping
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ehar.arrays import FloatArray
from ehar.files import replacing

_COLOURS = (  # Okabe and Ito's, told apart by colour-blind readers too; yellow left out, as it fades on white
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#56B4E9",
    "#E69F00",
    "#7F5539",
    "#6A51A3",
    "#4D4D4D",
    "#882255",
    "#999933",
)
_GREY = "#6B6B6B"


def draw_accuracy(
    curves: Mapping[str, FloatArray], privileged: Collection[str], classes: int, title: str, stem: Path
) -> None:
    """Draw accuracy against the observation ratio as `stem`.png and `stem`.svg.

    Args:
        curves: the accuracy after each frame (L,) of every planner, 0 to 1.
        privileged: the planners that are drawn dashed.
        classes: K; chance is 1 / K.
        title: above it.
        stem: path without a suffix.
    """
    figure = Figure(figsize=(7.2, 4.3), layout="constrained")
    axes = figure.add_subplot()
    length = len(next(iter(curves.values())))
    ratios = 100 * np.arange(1, length + 1) / length
    colours = dict(zip(curves, _cycle(len(curves)), strict=True))
    for index, (name, curve) in enumerate(curves.items()):
        line = _line(index, privileged=name in privileged)
        axes.plot(ratios, 100 * curve, line, color=colours[name], linewidth=1.6)
    chance = 100 / classes
    axes.axhline(chance, color=_GREY, linewidth=0.8, linestyle=":")
    axes.annotate("chance", (100, chance), (0, 3), textcoords="offset points", ha="right", color=_GREY, fontsize=8)
    heights = np.array([100 * curve for curve in curves.values()])
    low = 10 * np.floor(min(heights.min(), chance) / 10)
    high = max(10 * np.ceil(heights.max() / 10), low + 10)
    axes.set_xlim(0, 100)
    axes.set_ylim(low, high)
    ends = {name: 100 * float(curve[-1]) for name, curve in curves.items()}
    for name, height in _spread(ends, gap=0.05 * (high - low), high=high).items():
        axes.annotate(
            f"{name} (privileged)" if name in privileged else name,
            (100, ends[name]),
            (106, height),
            annotation_clip=False,
            va="center",
            fontsize=8.5,
            color=colours[name],
            arrowprops={"arrowstyle": "-", "color": colours[name], "linewidth": 0.6, "relpos": (0, 0.5)},
        )
    axes.set_xlabel("observed share of the episode [%]")
    axes.set_ylabel("accuracy [%]")
    axes.set_title(title, fontsize=9.5, loc="left")
    axes.grid(axis="y", color="#E3E3E3", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    save_figure(figure, stem)


def save_figure(figure: Figure, stem: Path) -> None:
    """Write `stem`.png and `stem`.svg, without a date or random identifiers in them, each renamed into place."""
    FigureCanvasAgg(figure)
    metadata = {".png": {"Software": None}, ".svg": {"Date": None, "Creator": None}}
    with matplotlib.rc_context({"svg.hashsalt": "ehar", "svg.fonttype": "none"}):
        for suffix, entries in metadata.items():
            with replacing(stem.with_name(stem.name + suffix)) as temporary:
                figure.savefig(temporary, dpi=160, metadata=entries)


def _cycle(count: int) -> list[str]:
    return [_COLOURS[index % len(_COLOURS)] for index in range(count)]


def _line(index: int, *, privileged: bool) -> str:
    """Return a line style: dashed for the privileged, dash-dotted where colours begin anew."""
    if privileged:
        return "--"
    return "-" if index < len(_COLOURS) else "-."


def _spread(heights: Mapping[str, float], *, gap: float, high: float) -> dict[str, float]:
    """Return label heights up to `high`, in the order of the curves' ends, at least `gap` apart, near those ends."""
    names = sorted(heights, key=lambda name: heights[name])
    ranks = gap * np.arange(len(names))
    # At least `gap` apart means that height - rank * gap does not fall: pool neighbours that would (isotonic means).
    pools: list[list[float]] = []
    for offset in np.array([heights[name] for name in names]) - ranks:
        pools.append([float(offset)])
        while len(pools) > 1 and np.mean(pools[-2]) > np.mean(pools[-1]):
            pools[-2:] = [pools[-2] + pools[-1]]
    offsets = np.concatenate([np.full(len(pool), np.mean(pool)) for pool in pools])
    placed = np.minimum(offsets, high - ranks[-1]) + ranks
    return dict(zip(names, placed.tolist(), strict=True))
