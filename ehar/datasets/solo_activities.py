"""The 10 activities of `solo`: dance figures of two beats, each told apart by three things that few views show at once.

On the first beat a foot and the arms go forward, back, or stay (hidden from the front); on the second they open to the
side or cross (hidden from the side); all the while the forearms point up or down (hidden from above).
"""

from typing import NamedTuple

from ehar.arrays import FloatArray
from ehar.datasets.duo_activities import lift, pulse
from ehar.datasets.skeleton_model import Gesture, add_gestures

SAGITTAL_CONTRAST = 0.24  # [leg lengths]: the step forward or back
LATERAL_CONTRAST = 0.18  # [leg lengths]: the step to the side
VERTICAL_CONTRAST = 0.9  # [rad]: the forearms above or below level

FORWARD, IN_PLACE, BACK = 1.0, 0.0, -1.0
OPEN, CROSS = 1.0, -1.0
HIGH, LOW = 1.0, -1.0


class Figure(NamedTuple):
    """What tells an activity from the others."""

    sagittal: float
    lateral: float
    vertical: float


ACTIVITIES = {
    "mambo": Figure(FORWARD, OPEN, HIGH),
    "grapevine": Figure(FORWARD, OPEN, LOW),
    "cross_step": Figure(FORWARD, CROSS, HIGH),
    "jazz_square": Figure(FORWARD, CROSS, LOW),
    "rock_back": Figure(BACK, OPEN, HIGH),
    "coaster": Figure(BACK, OPEN, LOW),
    "sailor": Figure(BACK, CROSS, HIGH),
    "charleston": Figure(BACK, CROSS, LOW),
    "side_touch": Figure(IN_PLACE, OPEN, HIGH),
    "twist": Figure(IN_PLACE, CROSS, HIGH),
}


def perform(figure: Figure, phase: FloatArray) -> Gesture:
    """Return the gesture at phases (T,), in cycles of two beats, of a dancer who leads with the right."""
    sagittal = SAGITTAL_CONTRAST * figure.sagittal * pulse(phase, 0.0, 0.5)
    lateral = LATERAL_CONTRAST * figure.lateral * pulse(phase, 0.5, 1.0)
    vertical = VERTICAL_CONTRAST * figure.vertical * (pulse(phase, 0.1, 0.6) + pulse(phase, 0.6, 1.1))
    step: Gesture = {
        "right_step_forward": sagittal,
        "right_step_up": lift(phase, 0.0, 0.5),
        "sway_forward": 0.5 * sagittal,
        "left_step_out": lateral,
        "left_step_up": lift(phase, 0.5, 1.0),
        "sway_left": 0.5 * lateral,
        "rise": -0.03 * pulse(2 * phase, 0.0, 1.0),
    }
    arms: Gesture = {}
    for side in ("left", "right"):
        arms = add_gestures(
            arms,
            {
                f"{side}_flexion": 0.35 + 2.0 * sagittal,
                f"{side}_abduction": 0.45 + 1.6 * lateral,
                f"{side}_rotation": 0.3 - 0.0 * lateral,
                f"{side}_elbow": 1.1 + vertical,
            },
        )
    return add_gestures(step, arms)
