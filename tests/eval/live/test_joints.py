"""Keypoints of three pose estimators become the joints of a recogniser."""

import numpy as np
import pytest

from ehar.data.preparing.layouts import COCO17, SMPL22
from ehar.errors import DataError
from eval.live.joints import ORDERS, JointMap, Order

BODY = (
    *("pelvis", "neck", "head", "left_wrist", "right_wrist", "left_knee", "right_knee", "left_ankle", "right_ankle"),
)
PLACES = [(0, 0), (0, 6), (0, 10), (5, 3), (-5, 3), (2, -4), (-2, -4), (2, -8), (-2, -8)]


def points(order: Order) -> np.ndarray:
    """Return keypoints that lie where their names say, the same for each order."""
    places = {"nose": (0, 10), "left_wrist": (5, 3), "right_wrist": (-5, 3), "left_knee": (2, -4)}
    places |= {"right_knee": (-2, -4), "left_ankle": (2, -8), "right_ankle": (-2, -8)}
    places |= {"left_hip": (2, 0), "right_hip": (-2, 0), "left_shoulder": (3, 6), "right_shoulder": (-3, 6)}
    places |= {"mid_hip": (0, 0), "neck": (0, 6)}
    return np.array([(*places.get(name, (99, 99)), 0.5) for name in ORDERS[order]], dtype=np.float64)


def test_orders_have_as_many_joints_as_their_estimators() -> None:
    assert {order: len(names) for order, names in ORDERS.items()} == {"coco17": 17, "body25": 25, "mediapipe33": 33}
    assert all(len(set(names)) == len(names) for names in ORDERS.values())


@pytest.mark.parametrize("order", ["coco17", "body25", "mediapipe33"])
def test_the_same_body_has_the_same_joints(order: Order) -> None:
    joints = JointMap(order, BODY).joints(points(order))
    np.testing.assert_array_equal(joints[:, :2], PLACES)
    np.testing.assert_array_equal(joints[:, 2], 0.5)


def test_a_middle_is_as_sure_as_the_less_sure_end() -> None:
    keypoints = points("coco17")
    keypoints[COCO17.joint_names.index("left_hip"), 2] = 0.0
    joints = JointMap("coco17", BODY).joints(keypoints)
    np.testing.assert_array_equal(joints[:, 2], [0, *[0.5] * 8])


def test_what_no_keypoint_tells_of_is_never_seen() -> None:
    mapped = JointMap("coco17", SMPL22.joint_names)
    assert {"left_foot", "right_foot"} <= set(mapped.lacking)
    unseen = [SMPL22.joint_names.index(name) for name in mapped.lacking]
    confidence = mapped.joints(points("coco17"))[:, 2]
    assert not confidence[unseen].any() and np.delete(confidence, unseen).all()
    assert {"left_foot", "right_foot"}.isdisjoint(JointMap("body25", SMPL22.joint_names).lacking)


def test_the_recognisers_own_order_is_taken_as_it_is() -> None:
    keypoints = np.arange(6.0).reshape(2, 3)
    np.testing.assert_array_equal(JointMap("own", ("a", "b")).joints(keypoints), keypoints)


def test_other_numbers_of_keypoints_and_other_bodies_are_refused() -> None:
    with pytest.raises(DataError, match="people: expected 25 keypoints, the order body25, got 17"):
        JointMap("body25", BODY).joints(points("coco17"))
    with pytest.raises(DataError, match="joints: got coco17, expected keypoints of the recogniser's joints"):
        JointMap("coco17", ("wheel", "mast"))
