"""A body of 16 joints, which turns named movement channels into joint positions with constant bone lengths.

Joint angles drive the arms and the spine. The positions of the feet drive the legs: two-bone inverse kinematics places
the knees, so the feet stay on the floor however the pelvis moves. x is forward, y left, z up.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.skeleton import Skeleton

JOINT_NAMES = (
    *("pelvis", "chest", "neck", "head"),
    *("left_shoulder", "left_elbow", "left_wrist", "right_shoulder", "right_elbow", "right_wrist"),
    *("left_hip", "left_knee", "left_ankle", "right_hip", "right_knee", "right_ankle"),
)
_PARENTS = (-1, 0, 1, 2, 2, 4, 5, 2, 7, 8, 0, 10, 11, 0, 13, 14)
SKELETON = Skeleton(JOINT_NAMES, tuple((parent, joint) for joint, parent in enumerate(_PARENTS) if parent >= 0))

_MIDDLE = (
    *("travel_forward", "travel_left", "yaw"),  # [m], [m], [rad]: the whole body, feet and all
    *("sway_forward", "sway_left", "rise"),  # [leg lengths]: the pelvis over feet that stay
    *("bend", "lean", "twist"),  # [rad]: the trunk forward, to the left, about its axis
    *("nod", "tilt"),  # [rad]: the head forward, to the left
)
_SIDED = (
    *("flexion", "abduction"),  # [rad]: the upper arm forward and up, outward and up
    *("rotation", "elbow"),  # [rad]: the forearm inward about the upper arm, the elbow's bend
    *("step_forward", "step_out", "step_up"),  # [leg lengths]: the foot from where it stands at rest
)
CHANNELS = (*_MIDDLE, *(f"{side}_{name}" for side in ("left", "right") for name in _SIDED))
_INDEX = {name: index for index, name in enumerate(CHANNELS)}
_LATERAL = ("travel_left", "yaw", "sway_left", "lean", "twist", "tilt")

ANKLE_HEIGHT = 0.08  # [m]
STANDING_REACH = 0.985  # of a straight leg: people stand with knees not quite locked
FULL_REACH = 0.998  # of a straight leg: the farthest a foot gets from its hip

Gesture = Mapping[str, FloatArray]  # channel name -> (T,)


@dataclass(frozen=True)
class Body:
    """The lengths of one person's segments [m]."""

    thigh: float = 0.43
    shank: float = 0.42
    hip_half_width: float = 0.10
    pelvis_to_chest: float = 0.30
    chest_to_neck: float = 0.22
    neck_to_head: float = 0.20
    shoulder_half_width: float = 0.18
    upper_arm: float = 0.29
    forearm: float = 0.26

    @property
    def leg(self) -> float:
        """The length of a straight leg, hip to ankle [m]."""
        return self.thigh + self.shank


def to_channels(gesture: Gesture, frames: int) -> FloatArray:
    """Return a gesture as channels (T, C); those it does not name are 0."""
    channels = np.zeros((frames, len(CHANNELS)))
    for name, values in gesture.items():
        channels[:, _INDEX[name]] += values
    return channels


def add_gestures(*gestures: Gesture) -> Gesture:
    """Return the sum of gestures, channel by channel."""
    total: dict[str, FloatArray] = {}
    for gesture in gestures:
        for name, values in gesture.items():
            total[name] = total[name] + values if name in total else values
    return total


def mirrored(channels: FloatArray) -> FloatArray:
    """Return the same movement (..., C) performed left for right."""
    other = {"left": "right", "right": "left"}
    source = list(range(len(CHANNELS)))
    for name, index in _INDEX.items():
        side, _, rest = name.partition("_")
        if side in other:
            source[index] = _INDEX[f"{other[side]}_{rest}"]
    sign = np.where(np.isin(CHANNELS, _LATERAL), -1.0, 1.0)
    swapped: FloatArray = channels[..., source] * sign
    return swapped


def pose(body: Body, channels: FloatArray) -> FloatArray:
    """Return the joints (T, 16, 3) [m] of a body that moves by channels (T, C); at rest it stands at the origin."""
    value = dict(zip(CHANNELS, channels.T, strict=True))
    zero = np.zeros(len(channels))
    heading = _turn(2, value["yaw"])
    root = np.stack([value["travel_forward"], value["travel_left"], zero], axis=-1)
    ankles = [_ankle(body, value, heading, root, side) for side in ("left", "right")]

    level = np.stack([value["sway_forward"], value["sway_left"], zero], axis=-1) * body.leg
    pelvis = root + _rotate(heading, level)
    half_width = {"left": body.hip_half_width, "right": -body.hip_half_width}
    hip_offsets = [_rotate(heading, np.array([0.0, half_width[side], 0.0])) for side in ("left", "right")]
    pelvis[:, 2] = ANKLE_HEIGHT + (STANDING_REACH + value["rise"]) * body.leg
    for ankle, offset in zip(ankles, hip_offsets, strict=True):
        level_square = ((ankle - pelvis - offset)[:, :2] ** 2).sum(axis=-1)
        reach = np.sqrt(np.maximum((FULL_REACH * body.leg) ** 2 - level_square, 0.01))
        pelvis[:, 2] = np.minimum(pelvis[:, 2], ankle[:, 2] + reach)

    trunk = heading @ _turn(2, value["twist"]) @ _turn(0, -value["lean"]) @ _turn(1, value["bend"])
    chest = pelvis + _rotate(trunk, np.array([0.0, 0.0, body.pelvis_to_chest]))
    neck = chest + _rotate(trunk, np.array([0.0, 0.0, body.chest_to_neck]))
    head_turn = trunk @ _turn(0, -value["tilt"]) @ _turn(1, value["nod"])
    head = neck + _rotate(head_turn, np.array([0.04, 0.0, body.neck_to_head]))
    joints = [pelvis, chest, neck, head]
    joints += _arm(body, value, trunk, neck, "left") + _arm(body, value, trunk, neck, "right")
    for ankle, offset in zip(ankles, hip_offsets, strict=True):
        joints += _leg(body, heading[..., 0], pelvis + offset, ankle)
    return np.stack(joints, axis=1)


def _ankle(body: Body, value: Gesture, heading: FloatArray, root: FloatArray, side: str) -> FloatArray:
    """Return the target positions of a foot's ankle, (T, 3)."""
    outward = 1.0 if side == "left" else -1.0
    offset = np.stack([value[f"{side}_{name}"] for name in ("step_forward", "step_out", "step_up")], axis=-1) * body.leg
    offset[:, 1] = outward * (offset[:, 1] + 1.15 * body.hip_half_width)
    offset[:, 2] = np.maximum(offset[:, 2], 0.0) + ANKLE_HEIGHT
    return root + _rotate(heading, offset)


def _leg(body: Body, forward: FloatArray, hip: FloatArray, ankle: FloatArray) -> list[FloatArray]:
    """Return hip, knee and ankle; the knee bends forward, and a foot out of reach is drawn in."""
    line = ankle - hip
    distance = np.linalg.norm(line, axis=-1, keepdims=True)
    direction = line / distance
    distance = np.clip(distance, 1.05 * abs(body.thigh - body.shank) + 0.05, FULL_REACH * body.leg)
    along = (body.thigh**2 - body.shank**2 + distance**2) / (2 * distance)
    across = np.sqrt(np.maximum(body.thigh**2 - along**2, 0.0))
    bend = forward - (forward * direction).sum(axis=-1, keepdims=True) * direction
    bend /= np.linalg.norm(bend, axis=-1, keepdims=True)
    return [hip, hip + along * direction + across * bend, hip + distance * direction]


def _arm(body: Body, value: Gesture, trunk: FloatArray, neck: FloatArray, side: str) -> list[FloatArray]:
    """Return shoulder, elbow and wrist."""
    outward = 1.0 if side == "left" else -1.0
    shoulder = neck + _rotate(trunk, np.array([0.0, outward * body.shoulder_half_width, -0.05]))
    upper = trunk @ _turn(0, outward * value[f"{side}_abduction"]) @ _turn(1, -value[f"{side}_flexion"])
    elbow = shoulder + _rotate(upper, np.array([0.0, 0.0, -body.upper_arm]))
    bend = np.maximum(value[f"{side}_elbow"], 0.0)  # style noise must not bend an elbow backwards
    lower = upper @ _turn(2, -outward * value[f"{side}_rotation"]) @ _turn(1, -bend)
    return [shoulder, elbow, elbow + _rotate(lower, np.array([0.0, 0.0, -body.forearm]))]


def _turn(axis: int, angle: FloatArray) -> FloatArray:
    """Return right-handed rotations (T, 3, 3) by `angle` (T,) [rad] about a coordinate axis."""
    matrix = np.zeros((len(angle), 3, 3))
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix[:, axis, axis] = 1.0
    matrix[:, first, first] = matrix[:, second, second] = np.cos(angle)
    matrix[:, second, first] = np.sin(angle)
    matrix[:, first, second] = -matrix[:, second, first]
    return matrix


def _rotate(rotation: FloatArray, vector: FloatArray) -> FloatArray:
    """Return vectors (3,) or (T, 3) turned by rotations (T, 3, 3), as (T, 3)."""
    turned: FloatArray = (rotation @ np.broadcast_to(vector, (len(rotation), 3))[..., None])[..., 0]
    return turned
