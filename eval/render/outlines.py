"""The outlines of obstacles, as lines in space for pictures."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.obstacles.shapes import Box, Cylinder, Obstacles

SIDES = 24  # of a circle


def outlines(obstacles: Obstacles) -> list[FloatArray]:
    """Return lines (N, 3) [m] that show obstacles: bottom, top, and edges between them; of walls the floor."""
    lines = [] if obstacles.walls is None else _lines(_corners(obstacles.walls), obstacles.walls.size[2])[:1]
    for box in obstacles.boxes:
        lines += _lines(_corners(box), box.size[2])
    for cylinder in obstacles.cylinders:
        lines += _lines(_circle(cylinder), cylinder.height)
    return lines


def _lines(floor: FloatArray, height: float) -> list[FloatArray]:
    """Return the lines of a prism, whose floor is a closed line (N, 3): floor, ceiling, and four edges at most."""
    ceiling = floor + np.array([0, 0, height])
    edges = np.stack([floor, ceiling], axis=1)[:-1]
    return [floor, ceiling, *edges[:: max(1, len(edges) // 4)]]


def _corners(box: Box) -> FloatArray:
    across, along = np.array(box.size[:2]) / 2
    cos, sin = np.cos(np.radians(box.yaw_deg)), np.sin(np.radians(box.yaw_deg))
    x = across * np.array([1, -1, -1, 1, 1])
    y = along * np.array([1, 1, -1, -1, 1])
    own: FloatArray = np.stack([cos * x - sin * y, sin * x + cos * y, np.full(5, -box.size[2] / 2)], axis=1)
    return own + np.asarray(box.centre, dtype=np.float64)


def _circle(cylinder: Cylinder) -> FloatArray:
    turn = np.linspace(0, 2 * np.pi, SIDES + 1)
    low = np.full(len(turn), -cylinder.height / 2)
    own: FloatArray = np.stack([cylinder.radius * np.cos(turn), cylinder.radius * np.sin(turn), low], axis=1)
    return own + np.asarray(cylinder.centre, dtype=np.float64)
