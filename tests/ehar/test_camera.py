"""Projection against an independent formula, and by hand."""

import numpy as np
import pytest

from ehar.camera import FOCAL_LENGTH, IMAGE_HEIGHT, IMAGE_WIDTH, Camera, look_at_rotation, project
from ehar.viewpoint import cartesian
from ehar.world import PAPER

CAMERA = Camera()
CENTRE = np.array([IMAGE_WIDTH / 2, IMAGE_HEIGHT / 2])
LEVEL = np.pi / 2


def pixel_of(point: list[float], viewpoint: list[float]) -> np.ndarray:
    """Return where one point is seen, from the image centre."""
    pixels, _ = project(np.array(point).reshape(1, 1, 3), np.array(viewpoint), CAMERA)
    return pixels[0, 0] - CENTRE


def project_by_cross_products(point: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """Return the pixel of a point seen from `eye`, which looks at the origin with the z axis up."""
    forward = -eye / np.linalg.norm(eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    ray = point - eye
    tangents = np.array([ray @ right, -(ray @ up)]) / (ray @ forward)
    return FOCAL_LENGTH * tangents + CENTRE


def test_projection_equals_look_at_by_cross_products() -> None:
    rng = np.random.default_rng(0)
    viewpoints = PAPER.sample_starts(rng, 200)
    viewpoints[:, 2] = np.maximum(viewpoints[:, 2], 0.01)  # at the pole cross products have no up
    points = rng.normal(0, 1, (200, 2, 3, 3))
    pixels, _ = project(points, viewpoints, CAMERA)
    for index, viewpoint in enumerate(viewpoints):
        for person in range(2):
            for joint in range(3):
                expected = project_by_cross_products(points[index, person, joint], cartesian(viewpoint))
                np.testing.assert_allclose(pixels[index, person, joint], expected, rtol=1e-4, atol=0.01)


def test_rotations_are_proper_everywhere_and_at_the_pole() -> None:
    viewpoints = np.array([[5.0, azimuth, polar] for azimuth in (0.0, 1.0, 4.0) for polar in (0.0, 0.7, LEVEL)])
    rotation = look_at_rotation(viewpoints)
    np.testing.assert_allclose(rotation @ np.swapaxes(rotation, 1, 2), np.tile(np.eye(3), (9, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(rotation), 1.0)


def test_the_pole_is_the_limit_of_the_viewpoints_beside_it() -> None:
    point = [0.3, -0.8, 0.5]
    for azimuth in (0.0, 1.0, 4.0):
        np.testing.assert_allclose(pixel_of(point, [8, azimuth, 0.0]), pixel_of(point, [8, azimuth, 1e-5]), atol=0.05)


def test_from_straight_above_what_lies_towards_the_azimuth_is_at_the_bottom() -> None:
    np.testing.assert_allclose(pixel_of([1, 0, 0], [10, 0, 0]), [0, FOCAL_LENGTH / 10], atol=1e-3)
    np.testing.assert_allclose(pixel_of([0, 1, 0], [10, 0, 0]), [FOCAL_LENGTH / 10, 0], atol=1e-3)


def test_the_centre_is_seen_in_the_middle_of_the_image_at_the_camera_s_distance() -> None:
    viewpoints = PAPER.sample_starts(np.random.default_rng(1), 50)
    pixels, depth = project(np.zeros((50, 1, 1, 3)), viewpoints, CAMERA)
    np.testing.assert_allclose(pixels[:, 0, 0], np.tile(CENTRE, (50, 1)))
    np.testing.assert_allclose(depth[:, 0, 0], viewpoints[:, 0], rtol=1e-6)


def test_a_person_of_1_7_metres_at_10_metres() -> None:
    head, feet = pixel_of([0, 0, 0.85], [10, 0, LEVEL]), pixel_of([0, 0, -0.85], [10, 0, LEVEL])
    assert feet[1] - head[1] == pytest.approx(1.7 * FOCAL_LENGTH / 10, rel=1e-5)
    assert head[1] < 0 < feet[1]


def test_moving_right_moves_the_near_to_the_left_and_the_far_to_the_right() -> None:
    near, far = [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]
    assert pixel_of(near, [10, 0.1, LEVEL])[0] < pixel_of(near, [10, 0, LEVEL])[0]
    assert pixel_of(far, [10, 0.1, LEVEL])[0] > pixel_of(far, [10, 0, LEVEL])[0]


def test_rising_moves_the_near_down() -> None:
    assert pixel_of([1, 0, 0], [10, 0, LEVEL - 0.1])[1] > pixel_of([1, 0, 0], [10, 0, LEVEL])[1]


def test_what_is_behind_the_camera_is_finite_and_has_a_negative_depth() -> None:
    pixels, depth = project(np.array([[[12.0, 1.0, 0.0]]]), np.array([10, 0, LEVEL]), CAMERA)
    assert depth[0, 0] == pytest.approx(-2)
    assert np.isfinite(pixels).all()


def test_forks_equal_one_by_one() -> None:
    rng = np.random.default_rng(2)
    points, viewpoints = rng.normal(0, 1, (4, 2, 5, 3)), PAPER.sample_starts(rng, 12).reshape(4, 3, 3)
    pixels, depth = project(points[:, None], viewpoints, CAMERA)
    assert pixels.shape == (4, 3, 2, 5, 2)
    for episode in range(4):
        for fork in range(3):
            alone, alone_depth = project(points[episode], viewpoints[episode, fork], CAMERA)
            np.testing.assert_allclose(pixels[episode, fork], alone, rtol=1e-5)
            np.testing.assert_allclose(depth[episode, fork], alone_depth, rtol=1e-5)
