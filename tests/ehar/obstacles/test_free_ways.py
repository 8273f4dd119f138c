"""How far cameras may go each way, by hand and against grids of places."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ehar.obstacles import MARGIN, Box, Cylinder, Obstacles
from ehar.obstacles.free_ways import REACH, STEP, free_ways
from ehar.viewpoint import MOVES, cartesian
from ehar.world import ROOM

LEVEL = np.pi / 2


def test_a_wall_behind_the_camera_by_hand() -> None:
    # The camera is 3 m east of the centre, level; the wall 5 m east. One margin before it there are 1.7 m left.
    wall = Obstacles(boxes=(Box(centre=(5.5, 0.0, 0.0), size=(1.0, 40.0, 40.0)),))
    free = free_ways(wall, np.array([[3.0, 0.0, LEVEL]]))
    np.testing.assert_allclose(free, [[1.5, REACH, REACH, REACH, REACH, REACH]])
    # People have walked a metre west, and the centre with them; then another three east.
    moved = np.array([[-1.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    np.testing.assert_allclose(free_ways(wall, np.array([[3.0, 0.0, LEVEL]] * 2), moved)[:, 0], [2.5, 0.0])


def test_each_way_is_that_of_its_move() -> None:
    viewpoint = np.array([[4.0, 0.7, 1.1]])
    for way, move in enumerate(MOVES[:6]):
        # A ball-like pillar where a small step of the move leads, two metres away.
        towards = cartesian(viewpoint + 1e-4 * move / np.array([1.0, 4.0 * np.sin(1.1), 4.0])) - cartesian(viewpoint)
        place = cartesian(viewpoint)[0] + 2 * towards[0] / np.linalg.norm(towards)
        x, y, z = place
        free = free_ways(Obstacles(cylinders=(Cylinder(centre=(x, y, z), radius=0.2, height=0.4),)), viewpoint)[0]
        assert 1.0 <= free[way] <= 1.5 and free[way] == free.min()
        assert (np.delete(free, way) == REACH).all()


@given(distance=st.floats(1.5, 6.0), azimuth=st.floats(0, 6.2), polar=st.floats(0.3, 1.5))
def test_no_place_on_a_free_way_is_too_near(distance: float, azimuth: float, polar: float) -> None:
    viewpoint = np.array([[distance, azimuth, polar]])
    free = free_ways(ROOM.obstacles, viewpoint)[0]
    assert ((free >= 0) & (free <= REACH)).all()
    outward = cartesian(viewpoint)[0] / distance
    for gone in np.arange(0.0, free[0] + STEP / 2, STEP) if free[0] else ():
        assert ROOM.obstacles.clearance(cartesian(viewpoint)[0] + gone * outward) >= MARGIN
