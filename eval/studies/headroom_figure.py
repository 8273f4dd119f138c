"""The map of a headroom study as a polar figure."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ehar.arrays import FloatArray
from eval.render.figures import outlined, save_figure
from eval.render.palette import VERMILION

ARC_SLICES = 12  # straight pieces of a cell's arc


def draw_map(viewpoints: FloatArray, acc_mean: FloatArray, title: str, stem: Path) -> None:
    """Draw accuracy over the map as `stem`.png and .svg: straight above in the middle, level at the rim.

    Args:
        viewpoints: (polars, azimuths, 3), viewpoints of the cameras.
        acc_mean: (polars, azimuths), accuracies [%].
        title: data, sensor and distance.
        stem: path without a suffix.
    """
    figure = Figure(figsize=(5.6, 4.8), layout="constrained")
    axes: Any = figure.add_subplot(projection="polar")
    azimuth, polar = viewpoints[0, :, 1], np.degrees(viewpoints[:, 0, 2])
    # Each cell is cut into slices, because a polar mesh is drawn with straight edges.
    slices = ARC_SLICES * len(azimuth)
    across = 2 * np.pi * (np.arange(slices + 1) / slices - 0.5 / len(azimuth))
    middles = (polar[1:] + polar[:-1]) / 2
    outward = np.concatenate([[0.0], middles, [2 * polar[-1] - middles[-1]]])
    mesh = axes.pcolormesh(across, outward, np.repeat(acc_mean, ARC_SLICES, axis=1), cmap="viridis")
    row, column = np.unravel_index(acc_mean.argmax(), acc_mean.shape)
    axes.plot(azimuth[column], polar[row], "o", markerfacecolor="none", markeredgecolor=VERMILION, markersize=11)
    axes.set_yticks(polar, [f"{angle:.0f}°" for angle in polar], fontsize=7)
    for label in axes.get_yticklabels():
        label.set_path_effects(outlined(2.0))
    axes.tick_params(axis="x", labelsize=8)
    axes.grid(False)
    figure.colorbar(mesh, ax=axes, label="mean accuracy [%]", shrink=0.8)
    figure.suptitle(
        f"{title}\npolar angle outward, azimuth around; ring: best, {acc_mean.max():.1f} %",
        fontsize=9,
    )
    save_figure(figure, stem)
