"""Outlines lie on the surface of what they show."""

import numpy as np

from ehar.obstacles import Box, Cylinder, Obstacles
from eval.render.outlines import outlines

TABLE = Box(centre=(1.0, 2.0, -0.5), size=(0.8, 1.6, 0.7), yaw_deg=30)
PILLAR = Cylinder(centre=(-2.0, 0.0, 1.0), radius=0.4, height=4.0)


def test_lines_lie_on_the_surface() -> None:
    for shape, held in ((TABLE, Obstacles(boxes=(TABLE,))), (PILLAR, Obstacles(cylinders=(PILLAR,)))):
        lines = outlines(held)
        assert len(lines) == 6
        for line in lines:
            np.testing.assert_allclose(shape.clearance(line), 0, atol=1e-9)
        heights = np.concatenate(lines)[:, 2]
        assert np.isclose(np.ptp(heights), 0.7 if shape is TABLE else 4.0)


def test_of_walls_the_floor_is_shown_and_of_nothing_nothing() -> None:
    walls = Box(centre=(0.0, 0.0, 2.0), size=(8.0, 6.0, 6.0))
    (floor,) = outlines(Obstacles(walls=walls))
    assert (floor[:, 2] == -1).all() and floor.shape == (5, 3)
    assert outlines(Obstacles()) == []
