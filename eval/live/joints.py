"""Orders of joints that pose estimators have, and how a recogniser's joints follow from them."""

from collections.abc import Mapping
from typing import Literal

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.preparing.layouts import COCO17
from ehar.data.preparing.mapping import joint_sources
from ehar.errors import DataError

Order = Literal["coco17", "body25", "mediapipe33", "own"]

BODY25 = (  # OpenPose, BODY_25
    *("nose", "neck", "right_shoulder", "right_elbow", "right_wrist", "left_shoulder", "left_elbow", "left_wrist"),
    *("mid_hip", "right_hip", "right_knee", "right_ankle", "left_hip", "left_knee", "left_ankle"),
    *("right_eye", "left_eye", "right_ear", "left_ear"),
    *("left_big_toe", "left_small_toe", "left_heel", "right_big_toe", "right_small_toe", "right_heel"),
)
MEDIAPIPE33 = (  # MediaPipe's pose landmarks
    *("nose", "left_eye_inner", "left_eye", "left_eye_outer", "right_eye_inner", "right_eye", "right_eye_outer"),
    *("left_ear", "right_ear", "mouth_left", "mouth_right", "left_shoulder", "right_shoulder"),
    *("left_elbow", "right_elbow", "left_wrist", "right_wrist", "left_pinky", "right_pinky"),
    *("left_index", "right_index", "left_thumb", "right_thumb", "left_hip", "right_hip", "left_knee", "right_knee"),
    *("left_ankle", "right_ankle", "left_heel", "right_heel", "left_foot_index", "right_foot_index"),
)
ORDERS: Mapping[str, tuple[str, ...]] = {"coco17": COCO17.joint_names, "body25": BODY25, "mediapipe33": MEDIAPIPE33}


class JointMap:
    """Turns keypoints in one order into the joints of a recogniser.

    A joint is the keypoint of the same part of the body, or the middle of the keypoints around it, with the least of
    their confidences. A joint that no keypoint tells of is never seen.

    Args:
        order: the keypoints' order.
        joint_names: names of the recogniser's J joints.

    Raises:
        DataError: the keypoints tell of no joint.
    """

    def __init__(self, order: Order, joint_names: tuple[str, ...]) -> None:
        """Find where each joint comes from."""
        self.held = joint_names if order == "own" else ORDERS[order]
        sources = [[joint] for joint in range(len(joint_names))]
        if order != "own":
            sources = joint_sources(self.held, joint_names)
        self.lacking = tuple(name for name, source in zip(joint_names, sources, strict=True) if not source)
        if len(self.lacking) == len(joint_names):
            raise DataError(f"joints: got {order}, expected keypoints of the recogniser's joints {list(joint_names)}")
        # A source more than once does no harm to a minimum, and the middle of two is taken from just two columns.
        self._first = np.array([source[0] if source else 0 for source in sources])
        self._middles = [(joint, source) for joint, source in enumerate(sources) if len(source) > 1]
        self._seen = np.array([bool(source) for source in sources])
        self._order = order

    def joints(self, keypoints: FloatArray) -> FloatArray:
        """Return x, y and confidence of each joint, (J, 3), from keypoints (N, 3).

        Raises:
            DataError: there are not as many keypoints as the order has.
        """
        if len(keypoints) != len(self.held):
            raise DataError(
                f"people: expected {len(self.held)} keypoints, the order {self._order}, got {len(keypoints)}"
            )
        joints: FloatArray = keypoints[self._first]
        for joint, source in self._middles:
            joints[joint, :2] = keypoints[source, :2].mean(axis=0)
            joints[joint, 2] = keypoints[source, 2].min()
        joints[~self._seen, 2] = 0
        return joints
