"""Pictures of an analysed run: the positions of cameras (Fig. 6), moves (Fig. 7a-d), states of an agent (Fig. 7e)."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, MultipleLocator

from ehar.arrays import FloatArray, IntArray
from ehar.files import replacing
from ehar.viewpoint import AZIMUTH, MOVE_NAMES, POLAR
from eval.render.figures import clean
from eval.render.palette import CLASSES, EDGE, LINE, NEUTRAL, THIN, looks
from eval.scores.behaviour import STAGES, PositionHistogram
from eval.scores.planner_summary import NO_ACT
from eval.studies.behaviour.agent_states import Purity

MARKERS = ("o", "^", "s", "D", "v", "P", "X", "*")  # 64 pairs of colour and marker, one for each class
LEGEND_ROWS = 22
_DIGIT_ROOM = 0.012  # space between a bar and its number, as a share of the highest bar
_SIGNS = str.maketrans("-", "\N{MINUS SIGN}")


def draw_positions(histograms: Mapping[str, tuple[PositionHistogram, ...]], title: str, path: Path) -> None:
    """Draw the histograms of distance, azimuth and polar angle (Fig. 6): no-act filled, planners as lines over it.

    Args:
        histograms: one histogram for each axis, by planner.
        title: title of the run.
        path: the .png to write.
    """
    axes = [histogram.axis for histogram in next(iter(histograms.values()))]
    figure = Figure(figsize=(9.0, 3.3), layout="constrained")
    styles = looks(dict.fromkeys(histograms, False))
    handles: dict[str, Any] = {}
    for index, (axis, place) in enumerate(zip(axes, figure.subplots(1, len(axes)), strict=True)):
        low, high = axis.edges[[0, -1]]
        for name, by_axis in histograms.items():
            density = by_axis[index].density
            if name == NO_ACT:
                drawn = place.stairs(density, axis.edges, fill=True, color=EDGE, label=f"{name} (starts)")
            else:
                drawn = place.stairs(
                    density, axis.edges, color=styles[name].colour, linewidth=LINE, label=name, baseline=None
                )
            handles.setdefault(name, drawn)
        handles["uniform"] = place.hlines(
            1 / (high - low), low, high, color=NEUTRAL, linewidth=THIN, linestyle=":", label="uniform"
        )
        place.set_xlim(low, high)
        place.set_ylim(0, 1.08 * max(by_axis[index].density.max() for by_axis in histograms.values()))
        place.set_xlabel(f"{axis.name} [{axis.unit}]" + (", 90 is level" if axis.column == POLAR else ""))
        place.set_ylabel(f"density [1/{axis.unit}]")
        if axis.column in (AZIMUTH, POLAR):
            place.xaxis.set_major_locator(MultipleLocator(90 if axis.column == AZIMUTH else 15))
        else:
            place.xaxis.set_major_locator(FixedLocator(np.linspace(*axis.bounds, 5).tolist()))
        clean(place)
    figure.suptitle(title, fontsize=9.5, x=0.01, ha="left")
    figure.legend(handles=list(handles.values()), loc="outside lower center", ncols=6, fontsize=9, frameon=False)
    _save(figure, path)


def draw_moves(shares: Mapping[str, FloatArray], title: str, path: Path) -> None:
    """Draw how often each move is made, in the whole episode and its three stages (Fig. 7a-d).

    Args:
        shares: (4, 7) shares by planner, from `eval.scores.behaviour.move_shares`.
        title: title of the run.
        path: the .png to write.
    """
    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    styles = looks(dict.fromkeys(shares, False))
    places = figure.subplots(2, 2, sharex=True, sharey=True)
    width = 0.8 / len(shares)
    slots = np.arange(len(MOVE_NAMES))
    top = 100 * max(float(by_stage.max()) for by_stage in shares.values())
    for stage, (letter, place) in enumerate(zip("abcd", places.flat, strict=True)):
        for index, (name, by_stage) in enumerate(shares.items()):
            heights = 100 * by_stage[stage]
            x = slots + width * (index - (len(shares) - 1) / 2)
            place.bar(x, heights, 0.92 * width, color=styles[name].colour, label=name)
            if len(shares) <= 2:
                for at, height in zip(x, heights, strict=True):
                    place.text(at, height + _DIGIT_ROOM * top, f"{height:.0f}", ha="center", va="bottom", fontsize=7.5)
        place.set_title(f"({letter}) {STAGES[stage]}", fontsize=9.5, loc="left")
        place.set_ylim(0, 1.12 * top)
        place.set_xticks(slots, [name.translate(_SIGNS) for name in MOVE_NAMES], fontsize=8)
        place.tick_params(axis="x", length=0)
        clean(place)
    for place in places[:, 0]:
        place.set_ylabel("share of moves [%]")
    for place in places[1]:
        place.set_xticks(slots, [name.translate(_SIGNS) for name in MOVE_NAMES], rotation=25, ha="right", fontsize=8)
    figure.suptitle(title, fontsize=9.5, x=0.01, ha="left")
    handles, labels = places[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6, fontsize=9, frameon=False)
    _save(figure, path)


def draw_states(
    mapped: FloatArray, label: IntArray, class_names: tuple[str, ...], title: str, purity: Purity, path: Path
) -> None:
    """Draw states in the plane, coloured by class (Fig. 7e), and say how pure their neighbourhoods are.

    Args:
        mapped: (M, 2) states in the plane.
        label: (M,) classes.
        class_names: K names.
        title: title of the run, and the planner whose states are drawn.
        purity: purity in the space of the states.
        path: the .png to write.
    """
    held = np.unique(label).tolist()
    columns = -(-len(held) // LEGEND_ROWS)
    figure = Figure(figsize=(7.0 + 1.8 * (columns - 1), 5.2), layout="constrained")
    place = figure.add_subplot()
    for rank, shown in enumerate(held):
        here = mapped[label == shown]
        colour = CLASSES[rank % len(CLASSES)]
        marker = MARKERS[(rank + rank // len(CLASSES)) % len(MARKERS)]
        place.scatter(
            here[:, 0],
            here[:, 1],
            s=13,
            color=colour,
            marker=marker,
            linewidths=0,
            alpha=0.75,
            label=class_names[shown],
            rasterized=True,
        )
    place.set_xticks([])
    place.set_yticks([])
    place.set_aspect("equal", adjustable="datalim")
    place.spines[:].set_color(EDGE)
    place.set_xlabel(
        f"t-SNE of {len(mapped)} states\nOf the {purity.neighbours} nearest in other sequences "
        f"{100 * purity.purity:.0f} % are of the class, by chance {100 * purity.chance:.0f} %",
        fontsize=8.5,
    )
    figure.suptitle(title, fontsize=9.5, x=0.01, ha="left")
    figure.legend(loc="outside right center", ncols=columns, fontsize=8, frameon=False, markerscale=1.8)
    _save(figure, path)


def _save(figure: Figure, path: Path) -> None:
    """Write a .png without a date in it, and rename it into place."""
    FigureCanvasAgg(figure)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=160, metadata={"Software": None})
