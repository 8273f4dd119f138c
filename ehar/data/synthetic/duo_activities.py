"""The 7 activities of `duo`: figures of a couple's dance, each told apart by three things that few views show at once.

In the first half of a figure the couple steps along the line between them (seen from the side, hidden along the
line); in the second half across it (seen along the line, hidden from the side); all the while their joined hands
beat above or below the shoulders (hidden from above). The free arms reach where the steps go, so that a single frame
can show it. Only the names are borrowed from real dances.
"""

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.synthetic.body import Gesture, add_gestures
from ehar.data.synthetic.figure import Figure, lift, pulse

SAGITTAL_CONTRAST = 0.52  # [leg lengths]: the step along the couple's line
LATERAL_CONTRAST = 0.45  # [leg lengths]: the step across it
VERTICAL_CONTRAST = 0.8  # [rad]: the hands above or below level

ARM_REACH = 2.0  # [rad / leg length], how far the free arm goes with a step
ARM_FLEXION = 0.35  # [rad], of the free arm at rest

CYCLE = 2.6  # [s], the average duration of a figure

ADVANCE, PART = 1.0, -1.0  # the leader follows the partner, or both step back
SAME_SIDE, OPPOSITE_SIDES = 1.0, -1.0
HIGH, LOW = 1.0, -1.0

ACTIVITIES = {
    "promenade": Figure(ADVANCE, SAME_SIDE, HIGH),
    "cradle": Figure(ADVANCE, SAME_SIDE, LOW),
    "arch": Figure(ADVANCE, OPPOSITE_SIDES, HIGH),
    "cross": Figure(ADVANCE, OPPOSITE_SIDES, LOW),
    "breakaway": Figure(PART, SAME_SIDE, HIGH),
    "rock": Figure(PART, SAME_SIDE, LOW),
    "windmill": Figure(PART, OPPOSITE_SIDES, HIGH),
}


def perform(figure: Figure, phase: FloatArray) -> tuple[Gesture, Gesture]:
    """Return the leader's and the follower's gestures at phases (T,), in cycles; they face each other."""
    sagittal = SAGITTAL_CONTRAST * pulse(phase, 0.0, 0.5)
    lateral = LATERAL_CONTRAST * pulse(phase, 0.5, 1.0)
    first, second = lift(phase, 0.0, 0.5), lift(phase, 0.5, 1.0)
    beat = VERTICAL_CONTRAST * figure.vertical * (pulse(phase, 0.1, 0.6) + pulse(phase, 0.6, 1.1))
    leader = add_gestures(
        _step_along("right", figure.sagittal * sagittal, first),
        _step_across("left", lateral, second),
        _joined_hand("right", beat),
        _free_arm("left", figure.sagittal * sagittal, figure.lateral * lateral),
    )
    # The partners face each other, so the same side of the room is the other side of the body.
    follower = add_gestures(
        _step_along("left", -sagittal, first),
        _step_across("right" if figure.lateral == SAME_SIDE else "left", lateral, second),
        _joined_hand("left", beat),
        _free_arm("right", figure.sagittal * sagittal, figure.lateral * lateral),
    )
    return leader, follower


def _step_along(side: str, distance: FloatArray, height: FloatArray) -> Gesture:
    return {
        f"{side}_step_forward": distance,
        f"{side}_step_up": height,
        "sway_forward": 0.6 * distance,
        "bend": 0.15 * distance,
    }


def _step_across(side: str, distance: FloatArray, height: FloatArray) -> Gesture:
    sign = 1.0 if side == "left" else -1.0
    return {
        f"{side}_step_out": distance,
        f"{side}_step_up": height,
        "sway_left": sign * 0.6 * distance,
        "lean": sign * 0.2 * distance,
    }


def _joined_hand(side: str, beat: FloatArray) -> Gesture:
    return {f"{side}_flexion": np.pi / 2 - 0.3 + beat, f"{side}_elbow": np.full(len(beat), 0.35)}


def _free_arm(side: str, forward: FloatArray, outward: FloatArray) -> Gesture:
    """Return the arm that is not joined: it reaches where the figure goes, and a single frame can show it."""
    return {
        f"{side}_flexion": ARM_FLEXION + ARM_REACH * forward,
        f"{side}_abduction": 0.3 + ARM_REACH * outward,
        f"{side}_elbow": np.full(len(forward), 0.9),
    }
