"""The sections of a report that show figures: each is an entry of `SECTIONS`."""

from eval.reports.behaviour_figures import moves, moves_text, position, sphere
from eval.reports.figures import accuracy_figure, cost_against_motion, cost_against_time
from eval.reports.recognition_figures import calibration, classes, confused, gains, predictability_figure
from eval.reports.section import ReportFigure, Section
from eval.reports.tables import differences_part, levels_table
from eval.scores.planner_summary import NO_ACT

ACCURACY = Section(
    anchor="accuracy",
    link="Accuracy",
    heading="Accuracy over the observed share",
    text=(
        "How many episodes are recognised once a share of their frames has been seen. The earlier a line rises, the "
        "earlier its planner knows. Bands are 95 % intervals of each point: of the planner in focus, no-act and the "
        "oracle."
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
        "Up is more accurate, left is cheaper. The dotted line is the Pareto front: planners without the truth on it, "
        "drawn larger, are beaten by none that costs as little. Bars are 95 % intervals. Times are of the machine that "
        "ran this."
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
    ),
)
DIFFERENCES = Section(anchor="differences", link="Differences", heading="Paired differences", before=differences_part)
CALIBRATION = Section(
    anchor="calibration",
    link="Calibration",
    heading="Calibration",
    text=(
        "Of the answers that were this sure, how many were right. On the diagonal, probabilities can be taken at their "
        "word; below it, the recogniser is surer than it should be from the views that the planner chose. Bars show "
        "where its answers lie."
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
                    "By how much the planner in focus is more accurate than no-act in each class. An interval is over "
                    "the sequences of that class alone and not corrected for the number of classes: one in 20 "
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
                    "In what share of its frames each true class is taken for each other, in percent. The diagonal is "
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
                    "The middle is straight above the people, the rim level with them, in a projection that keeps "
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
