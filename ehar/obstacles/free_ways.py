"""How far cameras may go each way before an obstacle is in the way: what agents are told of obstacles."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.obstacles.shapes import MARGIN, Obstacles
from ehar.viewpoint import AZIMUTH, POLAR, cartesian

WAYS = 6  # those of the moves but hover, in their order
REACH = 4.0  # [m], what lies farther is not told
STEP = 0.25  # [m], between places that are looked at


def free_ways(obstacles: Obstacles, viewpoint: FloatArray, moved: FloatArray | None = None) -> FloatArray:
    """Return how far cameras may go straight each way and keep the margin from obstacles, (B, 6) [m].

    The ways are straight, and begin as the moves of `ehar.viewpoint.MOVES` do: farther, nearer, and up and down in
    azimuth and in polar angle. Who is nearer than the margin already has no way. It is `REACH` at most.

    Args:
        obstacles: what stands there, in the frame whose origin is people's centre in the first frame.
        viewpoint: (B, 3).
        moved: (B, 3) how far the centre has moved since then [m]; None if it stays.
    """
    azimuth, polar = viewpoint[:, AZIMUTH], viewpoint[:, POLAR]
    level, none = np.sin(polar), np.zeros(len(viewpoint))
    outward = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.cos(polar)], axis=-1)
    around = np.stack([-np.sin(azimuth), np.cos(azimuth), none], axis=-1)
    down = np.stack([np.cos(polar) * np.cos(azimuth), np.cos(polar) * np.sin(azimuth), -level], axis=-1)
    ways = np.stack([outward, -outward, around, -around, down, -down], axis=1)  # (B, 6, 3)
    gone = np.arange(0.0, REACH + STEP / 2, STEP)
    begin = cartesian(viewpoint) + (0.0 if moved is None else moved)
    places = begin[:, None, None] + gone[:, None] * ways[:, :, None]  # (B, 6, steps, 3)
    blocked = obstacles.clearance(places) < MARGIN
    free: FloatArray = np.where(blocked.any(axis=-1), gone[np.maximum(blocked.argmax(axis=-1) - 1, 0)], REACH)
    return free
