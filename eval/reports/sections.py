"""The sections of a report that show figures, in `SECTIONS`."""

from eval.reports.behaviour_figures import moves, moves_text, position, sphere
from eval.reports.figures import (
    accuracy_figure,
    cost_against_energy,
    cost_against_motion,
    cost_against_time,
    has_energy,
)
from eval.reports.recognition_figures import calibration, classes, confused, gains, predictability_figure
from eval.reports.section import ReportFigure, Section
from eval.reports.tables import differences_part, levels_table
from eval.scores.planner_summary import NO_ACT

ACCURACY = Section(
    anchor="accuracy",
    link="Accuracy",
    heading="Accuracy over the observed share",
    text=(
        "The share of episodes that are recognised after a share of their frames. The earlier a line rises, the "
        "earlier its planner recognises them. Bands are 95 % intervals of each point, for the planner in focus, no-act "
        "and the oracle."
    ),
    figures=(
        (
            ReportFigure(
                key="accuracy",
                label="Accuracy against the observed share of an episode, a line for each planner",
                draw=accuracy_figure,
            ),
        ),
    ),
)
COST = Section(
    anchor="cost",
    link="Cost",
    heading="Accuracy against its cost",
    text=(
        "Up is more accurate, left is cheaper. The dotted line is the Pareto front of planners without the truth: no "
        "planner that costs as little is more accurate. Planners on it are drawn larger. Bars are 95 % intervals. "
        "Times depend on the machine."
    ),
    figures=(
        (
            ReportFigure(
                key="motion",
                label="Mean accuracy against the distance that cameras travelled",
                draw=cost_against_motion,
                focused=False,
            ),
            ReportFigure(
                key="time", label="Mean accuracy against planning time", draw=cost_against_time, focused=False
            ),
        ),
        (
            ReportFigure(
                key="energy",
                label="Mean accuracy against the energy of flights",
                draw=cost_against_energy,
                focused=False,
                shown=has_energy,
            ),
        ),
    ),
)
DIFFERENCES = Section(anchor="differences", link="Differences", heading="Paired differences", before=differences_part)
CALIBRATION = Section(
    anchor="calibration",
    link="Calibration",
    heading="Calibration",
    text=(
        "The share of right answers among answers of the same probability. On the diagonal, probabilities are right; "
        "below it, the recogniser is too sure, from the views that the planner chose. Bars show how often it gives "
        "each probability."
    ),
    figures=((ReportFigure("calibration", "Reliability diagram of the planner in focus", calibration),),),
)
CLASSES = Section(
    anchor="confusion",
    link="Classes",
    heading="Classes: what is confused, won and lost",
    figures=(
        (
            ReportFigure(
                key="gains",
                label="Accuracy of each class minus that of no-act, planner in focus",
                draw=gains,
                heading="Against no-act",
                text=(
                    "The accuracy of the planner in focus minus that of no-act, in each class. Each interval is over "
                    "the people and sequences of its class, without a correction for the number of classes: one in 20 "
                    "excludes zero by chance."
                ),
                missing=f"Needs {NO_ACT} in the run, and another planner in focus.",
            ),
            ReportFigure(
                key="confusion",
                label="Confusion of classes, planner in focus",
                draw=confused,
                heading="Taken for",
                text=(
                    "The share of frames of each true class that are taken for each class, in percent. The diagonal is "
                    "right; a strong cell beside it is a pair that this planner's views do not tell apart."
                ),
            ),
        ),
    ),
)
CAMERAS = Section(
    anchor="cameras",
    link="Cameras",
    heading="Where cameras went",
    text=(
        "All frames of all episodes. Polar angle 0 looks straight down, 90 is level with the people; the level share "
        "of the planner in focus is in the table below."
    ),
    figures=(
        (
            ReportFigure("distance", "Histogram of distance", position(0)),
            ReportFigure("azimuth", "Histogram of azimuth", position(1)),
            ReportFigure("polar", "Histogram of polar angle", position(2)),
        ),
        (
            ReportFigure(
                key="sphere",
                label="Density of directions, seen from above",
                draw=sphere,
                heading="The sphere from above",
                text=(
                    "The middle is straight above the people, 90° is level with them, in a projection that keeps "
                    "areas: an even disc means all directions alike. The stronger the blue, the more often; a few "
                    "cells lie beyond the scale."
                ),
            ),
            ReportFigure(
                key="moves",
                label="Share of each move in each third of the episode",
                draw=moves,
                heading="Moves by stage",
                text=moves_text,
                missing=moves_text,
            ),
        ),
    ),
    after=levels_table,
)
PREDICTABILITY = Section(
    anchor="predictability",
    link="Predictability",
    heading="Predictability",
    text=(
        "An episode is recognised <em>instantly</em> if it is right after 10 % of its frames and stays so at 50 and "
        "100 %, <em>early</em> if from 50 % on, <em>late</em> if only at 100 %, and else <em>never</em> by the end."
    ),
    figures=(
        (
            ReportFigure(
                key="predictability",
                label="Share of episodes recognised instantly, early, late and never",
                draw=predictability_figure,
                focused=False,
            ),
        ),
        (
            ReportFigure(
                key="classes",
                label="Share of each class's episodes recognised after 10, 50 and 100 % of their frames",
                draw=classes,
                heading="By class, planner in focus",
            ),
        ),
    ),
)

SECTIONS: tuple[Section, ...] = (ACCURACY, COST, DIFFERENCES, CALIBRATION, CLASSES, CAMERAS, PREDICTABILITY)
