"""The maps of a headroom study as polar figures: people in the middle, their front at the top."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ehar.arrays import FloatArray
from eval.render.figures import outlined, save_figure, shortened
from eval.render.palette import NEUTRAL, VERMILION
from eval.studies.headroom.class_maps import ClassMaps

ARC_SLICES = 12  # straight pieces of a cell's arc
COLUMNS = 6  # panels in a row, at most
RING = {"marker": "o", "markerfacecolor": "none", "markeredgecolor": VERMILION}
CROSS = {"marker": "x", "markeredgecolor": VERMILION}


def draw_map(viewpoints: FloatArray, acc_mean: FloatArray, title: str, stem: Path) -> None:
    """Draw accuracy over the map as `stem`.png and .svg: straight above in the middle, level at the rim.

    Args:
        viewpoints: (polars, azimuths, 3), viewpoints of the cameras; azimuths are counted from people's front.
        acc_mean: (polars, azimuths), accuracies [%].
        title: data, sensor and distance.
        stem: path without a suffix.
    """
    figure = Figure(figsize=(5.6, 4.8), layout="constrained")
    axes: Any = figure.add_subplot(projection="polar")
    mesh = _fill(axes, viewpoints, acc_mean, Normalize(acc_mean.min(), acc_mean.max()))
    _mark(axes, viewpoints, int(acc_mean.argmax()), RING, 11)
    polar = np.degrees(viewpoints[:, 0, 2])
    axes.set_yticks(polar, [f"{angle:.0f}°" for angle in polar], fontsize=7)
    for label in axes.get_yticklabels():
        label.set_path_effects(outlined(2.0))
    axes.tick_params(axis="x", labelsize=8)
    axes.grid(False)
    figure.colorbar(mesh, ax=axes, label="mean accuracy [%]", shrink=0.8)
    figure.suptitle(
        f"{title}\nfront at the top, polar angle outward; ring: best, {acc_mean.max():.1f} %",
        fontsize=9,
    )
    save_figure(figure, stem)


def draw_class_maps(viewpoints: FloatArray, maps: ClassMaps, title: str, stem: Path) -> None:
    """Draw the map of each class as `stem`.png and .svg, in points above the mean of its map; all have one scale.

    Args:
        viewpoints: (polars, azimuths, 3), viewpoints of the cameras; azimuths are counted from people's front.
        maps: the maps.
        title: data, sensor and distance.
        stem: path without a suffix.
    """
    count = len(maps.classes)
    columns = min(COLUMNS, count)
    rows = -(-count // columns)
    figure = Figure(figsize=(max(1.5 * columns, 4.5) + 0.8, 1.75 * rows + 0.7), layout="constrained")
    panels = [figure.add_subplot(rows, columns, index + 1, projection="polar") for index in range(count)]
    above = maps.acc_mean - maps.acc_mean.mean(axis=1, keepdims=True)
    scale = Normalize(above.min(), above.max())
    mesh: Any = None
    for axes, row, values, best in zip(panels, maps.classes, above, maps.best, strict=True):
        mesh = _fill(axes, viewpoints, values.reshape(viewpoints.shape[:2]), scale)
        _mark(axes, viewpoints, maps.one, CROSS, 6)
        _mark(axes, viewpoints, int(best), RING, 9)
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines["polar"].set_color(NEUTRAL)
        axes.set_title(f"{shortened(row.class_name, 15)}, {row.over_map:.0f} %", fontsize=7, pad=3)
    bar = figure.colorbar(mesh, ax=panels, shrink=0.8)
    bar.set_label("points above the class's mean", fontsize=8)
    bar.ax.tick_params(labelsize=7)
    figure.suptitle(
        f"{title}\nfront at the top, level at the rim; ring: best for the class, cross: best for all", fontsize=8.5
    )
    save_figure(figure, stem)


def _fill(axes: Any, viewpoints: FloatArray, values: FloatArray, scale: Normalize) -> Any:
    """Draw values (polars, azimuths) as cells around people, and return the mesh."""
    azimuths, polar = viewpoints.shape[1], np.degrees(viewpoints[:, 0, 2])
    # Each cell is cut into slices, because a polar mesh is drawn with straight edges.
    slices = ARC_SLICES * azimuths
    across = 2 * np.pi * (np.arange(slices + 1) / slices - 0.5 / azimuths)
    middles = (polar[1:] + polar[:-1]) / 2
    outward = np.concatenate([[0.0], middles, [2 * polar[-1] - middles[-1]]])
    axes.set_theta_zero_location("N")
    return axes.pcolormesh(across, outward, np.repeat(values, ARC_SLICES, axis=1), cmap="viridis", norm=scale)


def _mark(axes: Any, viewpoints: FloatArray, place: int, look: dict[str, str], size: float) -> None:
    """Mark one place of the map."""
    _, azimuth, polar = viewpoints.reshape(-1, 3)[place]
    axes.plot(azimuth, np.degrees(polar), markersize=size, **look)
