"""Skeletons: left is left by its name, in whatever order joints come."""

import numpy as np
import pytest

from ehar.data.skeleton import Skeleton, counterparts
from ehar.data.source import load_data
from ehar.sensors.estimator import EstimatorSensor
from ehar.sensors.sensor import draw_noise

SOLO = load_data("solo")
JOINTS = len(SOLO.skeleton.joint_names)
# Skeletons name right joints first, or now the one and now the other, as Human3.6M does with legs and arms.
ORDERS = {"right first": np.arange(JOINTS)[::-1], "mixed": np.random.default_rng(0).permutation(JOINTS)}


def reordered(skeleton: Skeleton, order: np.ndarray) -> Skeleton:
    """Return a skeleton whose joints come in another order."""
    place = np.argsort(order)
    return Skeleton(
        tuple(skeleton.joint_names[joint] for joint in order),
        tuple((int(place[start]), int(place[end])) for start, end in skeleton.bones),
    )


@pytest.mark.parametrize("order", ORDERS.values(), ids=list(ORDERS))
def test_people_face_the_same_way_in_any_order_of_joints(order: np.ndarray) -> None:
    motion = SOLO.sequence(0)
    other = reordered(SOLO.skeleton, order)
    assert all("left" in other.joint_names[left] and "right" in other.joint_names[right] for left, right in other.pairs)
    turned = other.heading(motion[:, :, order]) - SOLO.skeleton.heading(motion)
    np.testing.assert_allclose(np.cos(turned), 1, atol=1e-6)


@pytest.mark.parametrize("order", ORDERS.values(), ids=list(ORDERS))
def test_sides_are_taken_for_each_other_in_the_same_frames_in_any_order_of_joints(order: np.ndarray) -> None:
    motion = SOLO.sequence(0)[:, :1]
    viewpoint = np.tile([8.0, 0.0, np.pi / 2], (len(motion), 1))
    noise = draw_noise(np.random.default_rng(0), (len(motion),), 1, JOINTS)
    noise = noise._replace(localisation=np.zeros_like(noise.localisation), dropout=np.ones_like(noise.dropout))
    seen = EstimatorSensor(skeleton=SOLO.skeleton, swap_probability=1.0).sense(motion, viewpoint, noise)
    again = EstimatorSensor(skeleton=reordered(SOLO.skeleton, order), swap_probability=1.0).sense(
        motion[:, :, order], viewpoint, noise
    )
    np.testing.assert_allclose(again.joints_2d, seen.joints_2d[:, :, order], atol=1e-3)
    np.testing.assert_array_equal(again.confidence, seen.confidence[:, :, order])


@pytest.mark.parametrize(
    ("names", "expected"), [(("lhip", "rhip"), [1, 0]), (("hand_l", "hand_r"), [1, 0]), (("head", "l"), [0, 1])]
)
def test_joints_have_a_side_by_their_first_or_last_letter(names: tuple[str, ...], expected: list[int]) -> None:
    np.testing.assert_array_equal(counterparts(names), expected)
