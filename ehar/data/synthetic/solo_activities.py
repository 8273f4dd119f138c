"""The 10 activities of `solo`: dance figures of two beats, each told apart by three things that few views show at once.

On the first beat a foot and the arms go forward, back, or stay (hidden from the front); on the second they open to the
side or cross (hidden from the side); all the while the forearms beat up or down (hidden from above).
Only the names are borrowed from real dances.
"""

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.synthetic.body import Gesture
from ehar.data.synthetic.figure import Figure, lift, pulse

SAGITTAL_CONTRAST = 0.42  # [leg lengths]: the step forward or back
LATERAL_CONTRAST = 0.35  # [leg lengths]: the step to the side
VERTICAL_CONTRAST = 0.78  # [rad]: the forearms above or below level

CYCLE = 1.1  # [s], the average duration of a figure
ARM_FLEXION = 0.35  # [rad], of the upper arms at rest

FORWARD, IN_PLACE, BACK = 1.0, 0.0, -1.0
OPEN, CROSS = 1.0, -1.0
HIGH, LOW = 1.0, -1.0


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
    arm = {
        "flexion": ARM_FLEXION + 2.0 * sagittal,
        "abduction": 0.3 + 1.6 * lateral,
        "rotation": np.full(len(phase), 0.3),
        "elbow": np.pi / 2 - ARM_FLEXION + vertical,  # level between beats, so that up and down look alike from above
    }
    return {
        "right_step_forward": sagittal,
        "right_step_up": lift(phase, 0.0, 0.5),
        "sway_forward": 0.5 * sagittal,
        "left_step_out": lateral,
        "left_step_up": lift(phase, 0.5, 1.0),
        "sway_left": 0.5 * lateral,
        "rise": -0.03 * pulse(2 * phase, 0.0, 1.0),
        **{f"{side}_{name}": values for side in ("left", "right") for name, values in arm.items()},
    }
