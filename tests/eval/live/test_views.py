"""What a turned camera with another lens sees becomes what the recogniser's camera would see."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.camera import Camera, project
from ehar.viewpoint import cartesian
from eval.live.messages import CameraPose
from eval.live.views import centred, looked_from, viewpoint_of

PEOPLE = np.random.default_rng(0).uniform(-0.8, 0.8, size=(1, 16, 3))
PHONE, OURS = Camera(width=1920, height=1080, focal_length=1500.0), Camera()


def seen_by(place: np.ndarray, yaw: float, pitch: float, camera: Camera) -> np.ndarray:
    """Return where people are in the image of a camera at a place, computed in another way than `centred` does."""
    forward = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), np.sin(pitch)])
    right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    away = PEOPLE[0] - place
    depth = away @ forward
    across, down = away @ right / depth, away @ np.cross(forward, right) / depth
    pixels = camera.focal_length * np.stack([across, down], axis=-1) + (camera.width / 2, camera.height / 2)
    return np.concatenate([pixels, np.ones((16, 1))], axis=-1)[None]


@given(
    st.floats(5, 15),
    st.floats(0, 2 * np.pi),
    st.floats(0.0, np.pi / 2),
    st.floats(-0.3, 0.3),
    st.floats(-0.2, 0.2),
)
def test_turn_and_lens_are_undone(distance: float, azimuth: float, polar: float, aside: float, up: float) -> None:
    viewpoint = np.array([distance, azimuth, polar])
    pose = CameraPose(
        position=tuple(cartesian(viewpoint).tolist()), yaw=azimuth + np.pi + aside, pitch=polar - np.pi / 2 + up
    )
    assert pose.yaw is not None and pose.pitch is not None
    there, looking = looked_from(pose, None)
    if polar > 0.2:  # straight above, the yaw is the camera's own
        np.testing.assert_allclose(cartesian(there), cartesian(viewpoint), atol=1e-9)
    joints = seen_by(cartesian(viewpoint), pose.yaw, pose.pitch, PHONE)
    pixels, _ = project(PEOPLE, there, OURS)
    np.testing.assert_allclose(centred(joints, there, looking, PHONE, OURS)[..., :2], pixels, atol=2e-2)


def test_a_camera_like_ours_that_looks_at_people_is_left_as_it_is() -> None:
    viewpoint, looking = looked_from(CameraPose(position=(6.0, 0.0, 1.0)), None)
    joints = seen_by(np.array([6.0, 0.0, 1.0]), np.pi, -np.arctan2(1, 6), OURS)
    assert centred(joints, viewpoint, looking, None, OURS) is joints
    assert centred(joints, viewpoint, looking, OURS, OURS) is joints


def test_what_lies_behind_is_not_seen() -> None:
    viewpoint = np.array([6.0, 0.0, np.pi / 2])
    joints = np.array([[[640.0, 360.0, 0.8]]])
    away = np.array([6.0, np.pi, np.pi / 2])  # looks the other way
    assert centred(joints, viewpoint, away, None, OURS)[0, 0, 2] == 0


def test_straight_above_the_azimuth_is_the_one_before_or_that_of_the_yaw() -> None:
    above = CameraPose(position=(0.0, 0.0, 6.0))
    assert looked_from(above, np.array([6.0, 1.0, 0.1]))[0] == pytest.approx([6.0, 1.0, 0.0])
    turned = CameraPose(position=(0.0, 0.0, 6.0), yaw=1.0 + np.pi, pitch=-np.pi / 2)
    assert looked_from(turned, np.array([6.0, 2.0, 0.1]))[0] == pytest.approx([6.0, 1.0, 0.0])
    assert viewpoint_of(np.array([0.0, 0.0, 6.0]), 7.0) == pytest.approx([6.0, 7.0 - 2 * np.pi, 0.0])
