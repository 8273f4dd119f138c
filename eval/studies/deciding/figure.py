"""Accuracy against the time of answers: a panel for each planner, a curve for each rule."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from eval.render.figures import clean, save_figure
from eval.render.palette import BLUE, GREEN, LIGHT, LINE, STRONG, THIN, VERMILION
from eval.scores.deciding.curves import FIXED_TIME, INDUCTION, SPRT, THRESHOLD, Curve
from eval.studies.deciding.deciding import Deciding

COLOURS = {FIXED_TIME: LIGHT.text, THRESHOLD: BLUE, SPRT: GREEN, INDUCTION: VERMILION}
MARKERS = {FIXED_TIME: "o", THRESHOLD: "s", SPRT: "^", INDUCTION: "D"}


def draw_deciding(deciding: Deciding, stem: Path) -> None:
    """Draw accuracy against time as `stem`.png and .svg."""
    figure = Figure(figsize=(0.9 + 3.2 * len(deciding.planners), 3.6), layout="constrained")
    panels: Any = figure.subplots(1, len(deciding.planners), sharex=True, sharey=True, squeeze=False)[0]
    for axes, (planner, told) in zip(panels, deciding.planners.items(), strict=True):
        time, right = deciding.found.courses[planner]
        axes.plot(time, 100 * right, color=LIGHT.neutral, linewidth=THIN, label="after each frame")
        for curve in deciding.found.curves:
            if curve.planner == planner:
                _draw_curve(axes, curve)
        axes.set_title(planner + " (privileged)" * told, fontsize=9)
        axes.set_xlabel("mean time of an answer [s]")
        clean(axes)
    panels[0].set_ylabel("right answers [%]")
    panels[-1].legend(frameon=False, fontsize=8, loc="lower right")
    figure.suptitle(deciding.run.config.title, fontsize=9, x=0.01, ha="left")
    save_figure(figure, stem)


def _draw_curve(axes: Any, curve: Curve) -> None:
    """Draw a curve with the intervals of its points."""
    time, accuracy = (np.array([getattr(point, name) for point in curve.points]) for name in ("seconds", "accuracy"))
    ends = [point.accuracy_ci95 for point in curve.points]
    colour = COLOURS[curve.rule]
    if all(pair is not None for pair in ends):
        axes.vlines(time, *np.array(ends).T, color=colour, linewidth=THIN, alpha=0.35)
    axes.plot(
        time,
        accuracy,
        color=colour,
        marker=MARKERS[curve.rule],
        markersize=4,
        linewidth=STRONG if curve.rule == INDUCTION else LINE,
        linestyle="" if curve.rule == FIXED_TIME else "-",
        label=curve.rule,
    )
