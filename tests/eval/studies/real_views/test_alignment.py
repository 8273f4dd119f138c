"""Two recordings of one execution are laid over each other, whatever the cameras and their clocks."""

import numpy as np
import pytest

from eval.studies.real_views.alignment import Pose, apart, consensus, find_pose, matched, rigid
from tests.helpers.recordings import recorded_solo, rotation

JOINTS = np.random.default_rng(0).normal(size=(30, 12, 3))
POSE = Pose(rotation(0.8), np.array([1.0, -2.0, 0.3]))


def test_a_pose_carries_there_and_says_where_the_other_camera_is() -> None:
    np.testing.assert_allclose(POSE.carried(POSE.other_camera), 0, atol=1e-12)


def test_lost_limbs_do_not_turn_the_rotation() -> None:
    second = POSE.carried(JOINTS)
    second[:, :2] += np.random.default_rng(1).normal(size=(30, 2, 3))  # a sixth of the joints is anywhere
    found = rigid(JOINTS, second)
    np.testing.assert_allclose(found.rotation, POSE.rotation, atol=0.01)
    np.testing.assert_allclose(found.translation, POSE.translation, atol=0.02)


def test_a_mirror_is_no_rotation() -> None:
    found = rigid(JOINTS, JOINTS * np.array([-1, 1, 1]))
    assert np.linalg.det(found.rotation) == pytest.approx(1)


def test_frames_are_matched_in_order_from_corner_to_corner() -> None:
    times = np.array([0, 1, 1, 2, 5, 5, 6, 9.0])
    one, other = matched(np.abs(np.arange(10.0)[:, None] - times))
    assert (one[0], other[0], one[-1], other[-1]) == (0, 0, 9, 7)
    steps = np.stack([np.diff(one), np.diff(other)])
    assert (steps >= 0).all() and (steps <= 1).all() and (steps.sum(axis=0) > 0).all()
    assert {(0, 0), (2, 3), (5, 5), (9, 7)} <= set(zip(one.tolist(), other.tolist(), strict=True))


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_the_way_between_cameras_is_found_from_what_they_recorded(noise: float) -> None:
    data = recorded_solo(executions=3, frames=40, noise=noise)
    for sequence in (0, 3, 6):  # camera 1; camera 2 is next
        first, second = data.sequence(sequence)[:, 0], data.sequence(sequence + 1)[:, 0]
        found = find_pose(first, second)
        np.testing.assert_allclose(found.rotation, rotation(0.7), atol=0.06)
        assert apart(found.carried(first[2:]), second[:-2]).diagonal().mean() < 0.06 + 2 * noise


def test_executions_agree_on_a_pose_though_some_take_a_back_for_a_front() -> None:
    rng = np.random.default_rng(0)
    near = [Pose(rotation(0.8 + turn), rng.normal([1, 2, 0], 0.05)) for turn in rng.normal(0, 0.03, 6)]
    turned = [Pose(rotation(0.8 + np.pi), np.array([5.0, 5, 5]))] * 3
    found = consensus([*turned, *near])
    np.testing.assert_allclose(found.rotation, rotation(0.8), atol=0.05)
    np.testing.assert_allclose(found.translation, [1, 2, 0], atol=0.1)
