"""Skeletons that several data sets and pose estimators share: which joints they have, in which order."""

from collections.abc import Mapping
from typing import Literal

from ehar.data.skeleton import Skeleton
from ehar.errors import UsageError

Layout = Literal["coco17", "kinect20", "ntu25", "smpl22", "body12"]

COCO17 = Skeleton(
    joint_names=(
        *("nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder"),
        *("left_elbow", "right_elbow", "left_wrist", "right_wrist", "left_hip", "right_hip"),
        *("left_knee", "right_knee", "left_ankle", "right_ankle"),
    ),
    bones=(
        *((0, 1), (0, 2), (1, 3), (2, 4), (0, 5), (0, 6), (5, 6), (5, 7), (7, 9), (6, 8), (8, 10)),
        *((5, 11), (6, 12), (11, 12), (11, 13), (13, 15), (12, 14), (14, 16)),
    ),
)
BODY12 = Skeleton(  # what all pose estimators and all motion capture have: no face, no hands, no feet
    joint_names=COCO17.joint_names[5:],
    bones=tuple((a - 5, b - 5) for a, b in COCO17.bones if min(a, b) >= 5),
)
KINECT20 = Skeleton(  # Kinect for Windows SDK 1
    joint_names=(
        *("hip_center", "spine", "shoulder_center", "head"),
        *("shoulder_left", "elbow_left", "wrist_left", "hand_left"),
        *("shoulder_right", "elbow_right", "wrist_right", "hand_right"),
        *("hip_left", "knee_left", "ankle_left", "foot_left", "hip_right", "knee_right", "ankle_right", "foot_right"),
    ),
    bones=(
        *((0, 1), (1, 2), (2, 3), (2, 4), (4, 5), (5, 6), (6, 7), (2, 8), (8, 9), (9, 10), (10, 11)),
        *((0, 12), (12, 13), (13, 14), (14, 15), (0, 16), (16, 17), (17, 18), (18, 19)),
    ),
)
NTU25 = Skeleton(  # Kinect for Windows SDK 2, in the order of NTU RGB+D
    joint_names=(
        *("spine_base", "spine_mid", "neck", "head"),
        *("shoulder_left", "elbow_left", "wrist_left", "hand_left"),
        *("shoulder_right", "elbow_right", "wrist_right", "hand_right"),
        *("hip_left", "knee_left", "ankle_left", "foot_left", "hip_right", "knee_right", "ankle_right", "foot_right"),
        *("spine_shoulder", "hand_tip_left", "thumb_left", "hand_tip_right", "thumb_right"),
    ),
    bones=(
        *((0, 1), (1, 20), (20, 2), (2, 3), (20, 4), (4, 5), (5, 6), (6, 7), (7, 21), (6, 22)),
        *((20, 8), (8, 9), (9, 10), (10, 11), (11, 23), (10, 24)),
        *((0, 12), (12, 13), (13, 14), (14, 15), (0, 16), (16, 17), (17, 18), (18, 19)),
    ),
)
SMPL22 = Skeleton(  # the body of SMPL, without hands
    joint_names=(
        *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle"),
        *("right_ankle", "spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head"),
        *("left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist"),
    ),
    bones=(
        *((0, 1), (0, 2), (0, 3), (1, 4), (2, 5), (3, 6), (4, 7), (5, 8), (6, 9), (7, 10), (8, 11)),
        *((9, 12), (9, 13), (9, 14), (12, 15), (13, 16), (14, 17), (16, 18), (17, 19), (18, 20), (19, 21)),
    ),
)
LAYOUTS: Mapping[Layout, Skeleton] = {
    "coco17": COCO17,
    "kinect20": KINECT20,
    "ntu25": NTU25,
    "smpl22": SMPL22,
    "body12": BODY12,
}


def layout_of(name: str) -> Skeleton:
    """Return the skeleton of a layout.

    Raises:
        UsageError: there is none of this name.
    """
    layout = next((skeleton for known, skeleton in LAYOUTS.items() if known == name), None)
    if layout is None:
        raise UsageError(f"joints: got {name!r}, expected names, or one of {', '.join(LAYOUTS)}")
    return layout
