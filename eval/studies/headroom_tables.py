"""Headroom for people to read: tables, and the map as a polar figure."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from eval.render.figures import save_figure
from eval.render.tables import Table
from eval.studies.headroom import Headroom

ARC_SLICES = 12  # straight pieces in which a cell's arc is drawn


def headroom_tables(result: Headroom) -> list[Table]:
    """Return the ways to place cameras, the accuracy at each polar angle, and the best viewpoint of each class."""
    config = result.config
    placed = f"{config.azimuths} x {config.polars} fixed cameras at {result.distance:g} m"
    title = f"{config.data}: sensor {config.conditions.sensor}, views {config.conditions.views}, {result.scenarios} test scenarios, {placed}"
    polar = np.degrees(result.viewpoints[:, 0, 2])
    return [
        Table(
            title=title,
            header=("camera", "mean acc", "chosen on"),
            rows=tuple((row.name, f"{row.acc_mean:.1f}", row.chosen_on) for row in result.rows),
            footnotes=(
                "What is chosen on test is scored on what it was chosen from: read it as an upper bound.",
                "* privileged: is handed the label and the future; from random starts, like no-act.",
            ),
        ),
        Table(
            title="By polar angle (0 looks down from straight above), mean over azimuths",
            header=("polar [deg]", "mean acc", "worst azimuth", "best azimuth"),
            rows=tuple(
                (f"{angle:.1f}", f"{acc.mean():.1f}", f"{acc.min():.1f}", f"{acc.max():.1f}")
                for angle, acc in zip(polar, result.acc_mean, strict=True)
            ),
            footnotes=(),
        ),
        Table(
            title="The fixed viewpoint that shows each class best, chosen on test",
            header=("class", "azimuth [deg]", "polar [deg]", "mean acc", "over the map"),
            rows=tuple(
                (
                    row.class_name,
                    f"{row.azimuth_deg:.1f}",
                    f"{row.polar_deg:.1f}",
                    f"{row.acc_mean:.1f}",
                    f"{row.acc_mean_map:.1f}",
                )
                for row in result.classes
            ),
            footnotes=(),
        ),
    ]


def draw_map(result: Headroom, stem: Path) -> None:
    """Draw accuracy over the map as `stem`.png and .svg: straight above in the middle, level at the rim."""
    figure = Figure(figsize=(5.6, 4.8), layout="constrained")
    axes: Any = figure.add_subplot(projection="polar")
    azimuth, polar = result.viewpoints[0, :, 1], np.degrees(result.viewpoints[:, 0, 2])
    # Each azimuth's cell in slices, as a polar mesh is drawn with straight edges.
    slices = ARC_SLICES * len(azimuth)
    across = 2 * np.pi * (np.arange(slices + 1) / slices - 0.5 / len(azimuth))
    middles = (polar[1:] + polar[:-1]) / 2
    outward = np.concatenate([[0.0], middles, [2 * polar[-1] - middles[-1]]])
    mesh = axes.pcolormesh(across, outward, np.repeat(result.acc_mean, ARC_SLICES, axis=1), cmap="viridis")
    row, column = np.unravel_index(result.acc_mean.argmax(), result.acc_mean.shape)
    axes.plot(azimuth[column], polar[row], "o", markerfacecolor="none", markeredgecolor="#D55E00", markersize=11)
    axes.set_yticks(polar, [f"{angle:.0f}°" for angle in polar], fontsize=7)
    for label in axes.get_yticklabels():
        label.set_path_effects([withStroke(linewidth=2, foreground="white")])
    axes.tick_params(axis="x", labelsize=8)
    axes.grid(False)
    figure.colorbar(mesh, ax=axes, label="mean accuracy [%]", shrink=0.8)
    figure.suptitle(
        f"{result.config.data}, {result.config.conditions.sensor} sensor: fixed cameras at {result.distance:g} m\n"
        f"polar angle outward, azimuth around; ring: best, {result.acc_mean.max():.1f} %",
        fontsize=9,
    )
    save_figure(figure, stem)
