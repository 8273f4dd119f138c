"""The accuracy curve (Fig. 5) as PNG and SVG, and helpers of all figures; the same numbers give the same bytes."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, withStroke

from ehar.arrays import FloatArray
from ehar.files import replacing
from eval.render.palette import GRID, LINE, NEUTRAL, THIN, looks


def draw_accuracy(
    curves: Mapping[str, FloatArray],
    privileged: Collection[str],
    classes: int,
    title: str,
    stem: Path,
    watched: str = "episode",
) -> None:
    """Draw accuracy against the observation ratio as `stem`.png and `stem`.svg.

    Args:
        curves: the accuracy after each frame (L,) of every planner, 0 to 1.
        privileged: the planners that are drawn dashed.
        classes: K; chance is 1 / K.
        title: title of the figure.
        stem: path without a suffix.
        watched: what is observed, in the title of the axis.
    """
    figure = Figure(figsize=(7.2, 4.3), layout="constrained")
    axes = figure.add_subplot()
    length = len(next(iter(curves.values())))
    ratios = 100 * np.arange(1, length + 1) / length
    styles = looks({name: name in privileged for name in curves})
    for name, curve in curves.items():
        look = styles[name]
        axes.plot(ratios, 100 * curve, linestyle=look.line, color=look.colour, linewidth=LINE)
    chance = 100 / classes
    axes.axhline(chance, color=NEUTRAL, linewidth=THIN, linestyle=":")
    axes.annotate("chance", (100, chance), (0, 3), textcoords="offset points", ha="right", color=NEUTRAL, fontsize=8)
    heights = np.array([100 * curve for curve in curves.values()])
    low = 10 * np.floor(min(heights.min(), chance) / 10)
    high = max(10 * np.ceil(heights.max() / 10), low + 10)
    axes.set_xlim(0, 100)
    axes.set_ylim(low, high)
    ends = {name: 100 * float(curve[-1]) for name, curve in curves.items()}
    for name, height in _spread(ends, gap=0.05 * (high - low), high=high).items():
        colour = styles[name].colour
        axes.plot([100, 105], [ends[name], height], color=colour, linewidth=0.6, clip_on=False)
        label = f"{name} (privileged)" if name in privileged else name
        axes.text(106, height, label, va="center", fontsize=8.5, color=colour)
    axes.set_xlabel(f"observed share of the {watched} [%]")
    axes.set_ylabel("accuracy [%]")
    axes.set_title(title, fontsize=9.5, loc="left")
    clean(axes)
    save_figure(figure, stem)


def clean(axes: Axes) -> None:
    """Remove lines that a reader does not need, and draw a grid for reading heights."""
    axes.grid(axis="y", color=GRID, linewidth=THIN)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def outlined(width: float) -> list[Any]:
    """Return effects that give a line or a text a white edge, which sets it off from its background."""
    return [withStroke(linewidth=width, foreground="white"), Normal()]


def shortened(text: str, longest: int) -> str:
    """Return text on one line, cut off if it is longer than `longest` letters."""
    line = " ".join(text.split())
    return line if len(line) <= longest else f"{line[: longest - 1]}…"


def save_figure(figure: Figure, stem: Path) -> None:
    """Write `stem`.png and `stem`.svg atomically, without dates or random identifiers in them."""
    FigureCanvasAgg(figure)
    # Each savefig would find the layout again, and draw twice for it: the same one holds for both files.
    engine = figure.get_layout_engine()
    assert engine is not None
    engine.execute(figure)
    figure.set_layout_engine(None)  # "none" would leave one that does nothing, and that each draws twice for, too
    metadata = {".png": {"Software": None}, ".svg": {"Date": None, "Creator": None}}
    with matplotlib.rc_context({"svg.hashsalt": "ehar", "svg.fonttype": "none"}):
        for suffix, entries in metadata.items():
            with replacing(stem.with_name(stem.name + suffix)) as temporary:
                figure.savefig(temporary, dpi=160, metadata=entries)


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
