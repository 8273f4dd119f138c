"""The sections of a report on streams, in `STREAM_SECTIONS`: those of clips, read for activities, and two more."""

from dataclasses import replace

from eval.reports.data import ReportData
from eval.reports.recognition_figures import delays
from eval.reports.section import ReportFigure, Section
from eval.reports.sections import ACCURACY, CALIBRATION, CAMERAS, CLASSES, COST, DIFFERENCES, PREDICTABILITY
from eval.reports.timelines import timelines_part

TIMELINES = Section(
    anchor="timelines",
    link="Timelines",
    heading="Timelines",
    text=(
        "What was shown, and what was believed, with the planner in focus and with no-act. Colours are classes, grey "
        "is no activity, and a bar below the answers marks wrong ones. Below: the probability of the true class, and "
        "where the camera was. Vertical lines are onsets and ends. Point at it, or use arrow keys, to read a moment."
    ),
    before=timelines_part,
)
DELAYS = Section(
    anchor="delays",
    link="Delays",
    heading="Delay, class by class",
    text=(
        "How long it takes from the onset of an activity until the answer is right and stays right until its end. Each "
        "small mark is an activity, a cross one for which that never happens: it counts in full. Large marks are means."
    ),
    figures=((ReportFigure("delays", "Delay of each class, planner in focus", delays),),),
)


def _accuracy_text(data: ReportData) -> str:
    return (
        f"The share of the {data.summary.activities} activities that are recognised after a share of their frames, "
        "counted from their onset. Activities that an episode begins or ends with may be cut, and are left out. Bands "
        "are 95 % intervals of each point, for the planner in focus, no-act and the oracle."
    )


STREAM_SECTIONS: tuple[Section, ...] = (
    TIMELINES,
    replace(ACCURACY, heading="Accuracy within activities", text=_accuracy_text),
    DELAYS,
    COST,
    DIFFERENCES,
    replace(CALIBRATION, text=f"All frames, those of no activity too. {CALIBRATION.text}"),
    replace(CLASSES, text="Gains are those within activities; confusions are of all frames."),
    CAMERAS,
    replace(
        PREDICTABILITY,
        text=(
            "An activity is recognised <em>instantly</em> if it is right after 10 % of its frames and stays so at 50 "
            "and 100 %, <em>early</em> if from 50 % on, <em>late</em> if only at 100 %, and else <em>never</em> by its "
            "end."
        ),
    ),
)
