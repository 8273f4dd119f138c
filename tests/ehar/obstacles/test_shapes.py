"""Boxes and cylinders: their distance and their shadow are those of points that are tried one by one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar import EharError
from ehar.obstacles.shapes import Box, Cylinder, Obstacles, coordinates

TURNED = Box(centre=(1.0, -0.5, 0.2), size=(2.0, 0.6, 1.0), yaw_deg=30)
PILLAR = Cylinder(centre=(-1.0, 0.4, 0.0), radius=0.5, height=2.0)


def tried(shape: Box | Cylinder, begin: np.ndarray, end: np.ndarray, steps: int = 501) -> np.ndarray:
    """Return which ways have a point inside a shape, and end outside of it."""
    share = np.linspace(0, 1, steps)[:, None, None]
    inside = shape.clearance(begin + share * (end - begin)) < 0
    return np.asarray(inside.any(axis=0) & ~inside[-1])


@pytest.mark.parametrize("shape", [TURNED, PILLAR, Box(centre=(0, 0, 0), size=(1, 1, 1))])
@given(seed=st.integers(0, 2**32 - 1))
def test_a_way_is_cut_where_one_of_its_points_is_inside(shape: Box | Cylinder, seed: int) -> None:
    rng = np.random.default_rng(seed)
    begin, end = rng.uniform(-2, 2, (2, 60, 3))
    along = end.copy()
    axis = rng.integers(3, size=60)
    along[np.arange(60), axis] = begin[np.arange(60), axis]  # ways without any length along an axis
    for last in (end, along):
        cut, expected = shape.cuts(coordinates(begin), coordinates(last)), tried(shape, begin, last)
        assert (cut | ~expected).all()  # a way may graze a shape between two points that are tried
        assert (cut != expected).sum() <= 3


@pytest.mark.parametrize("shape", [TURNED, PILLAR])
def test_the_clearance_is_the_distance_to_the_nearest_point_of_the_surface(shape: Box | Cylinder) -> None:
    rng = np.random.default_rng(0)
    inside = rng.uniform(-3, 3, (400_000, 3))
    inside = inside[shape.clearance(inside) < 0]
    points = rng.uniform(-3, 3, (50, 3))
    outside = points[shape.clearance(points) > 0.2]
    nearest = np.linalg.norm(outside[:, None] - inside, axis=-1).min(axis=1)
    np.testing.assert_allclose(shape.clearance(outside), nearest, atol=0.12)
    middle = np.array(shape.centre)
    assert shape.clearance(middle) == pytest.approx(-0.3 if shape is TURNED else -0.5)


def test_obstacles_seen_from_a_centre_that_has_moved_are_nearer_by_as_much() -> None:
    around = Obstacles(walls=Box(centre=(0, 0, 0), size=(8, 6, 4)), boxes=(TURNED,), cylinders=(PILLAR,))
    points, centre = np.random.default_rng(0).uniform(-3, 3, (50, 3)), np.array([0.5, -1.0, 0.25])
    np.testing.assert_allclose(around.relative_to(centre).clearance(points), around.clearance(points + centre))


def test_a_table_hides_the_feet_from_below_and_not_from_above() -> None:
    table = Box(centre=(1.5, 0.0, -0.575), size=(0.8, 1.8, 0.75))
    person = np.array([[[0, 0, -0.9], [0, 0, 0.0], [0, 0, 0.7]]])
    cameras = np.array([[6.0, 0, 0], [1.0, 0, 6.0], [-6.0, 0, 0]])
    hidden = Obstacles(boxes=(table,)).hide(cameras, person)
    assert hidden.tolist() == [[[True, False, False]], [[False] * 3], [[False] * 3]]


def test_an_obstacle_hides_all_from_a_camera_inside_it_and_nothing_that_is_inside_it() -> None:
    box = Box(centre=(0, 0, 0), size=(2, 2, 2))
    inside, outside = np.zeros((1, 3)), np.array([[3.0, 0, 0]])
    held = Obstacles(boxes=(box,))
    assert held.hide(inside, np.array([[[4.0, 1, 0]]])).all()
    assert not held.hide(outside, np.array([[[0.5, 0, 0]]])).any()


def test_walls_keep_cameras_in_and_hide_nobody() -> None:
    room = Obstacles(walls=Box(centre=(0, 0, 1), size=(8, 6, 3)))
    points = np.array([[0, 0, 1.0], [3.9, 0, 1], [0, 3.5, 1]])
    np.testing.assert_allclose(room.clearance(points), [1.5, 0.1, -0.5])
    assert not room.hide(np.array([[20.0, 0, 0]]), np.zeros((1, 1, 3))).any()
    assert room and not Obstacles()
    assert Obstacles().clearance(points).tolist() == [np.inf] * 3


def test_shapes_that_cannot_be_are_refused_in_one_line() -> None:
    with pytest.raises(EharError, match="lengths above 0, got Box"):
        Box(centre=(0, 0, 0), size=(1, 0, 1))
    with pytest.raises(EharError, match="finite numbers"):
        Cylinder(centre=(0, 0, np.nan), radius=1, height=1)


def test_what_there_is_in_words_and_in_numbers() -> None:
    held = Obstacles(boxes=(TURNED, TURNED), cylinders=(PILLAR,))
    assert str(held) == "2 boxes, 1 cylinder"
    assert held.numbers[:3] == (0, 2, 1) and len(held.numbers) == 3 + 7 + 7 + 5
