"""How much of people is seen from a viewpoint, given what is in the way and where people are thought to be."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.obstacles.shapes import Obstacles
from ehar.obstacles.surroundings import Passers, Surroundings
from ehar.viewpoint import AZIMUTH
from ehar.world import FLOOR, PASSER_RADIUS

# A person as seen from the side: an upright strip, three points high and three across.
HEIGHTS = np.array([-0.7, 0.0, 0.6])  # [m], from the mean of the joints
ACROSS = np.array([-0.25, 0.0, 0.25])  # [m]
PASSER_TOP = FLOOR + 1.7  # [m], of the head of a passer-by, whose height nobody tells


def seen_share(
    viewpoint: FloatArray,
    position: FloatArray,
    obstacles: Obstacles,
    passers: FloatArray | None = None,
    ahead: float = 0.0,
    centre: FloatArray | None = None,
) -> FloatArray:
    """Return the share of people that is seen from viewpoints, 0 to 1, (B, ...).

    It is the share of free lines of sight to points on people. Each person is an upright strip that faces the camera.

    Args:
        viewpoint: (B, ..., 3).
        position: (B, P, 3) where people are thought to be, the mean of their joints [m].
        obstacles: what stands there.
        passers: (B, W, 4) place and velocity of passers-by [m], [m/s]; they walk straight on. None if there are none.
        ahead: how far ahead the viewpoints are [s].
        centre: (B, 3) where the centre is, from where it was in the first frame [m]; None if it has stayed.
    """
    walking = None
    if passers is not None:
        place = (passers[..., :2] + ahead * passers[..., 2:])[:, None]
        low, high = np.full(passers.shape[:2], FLOOR), np.full(passers.shape[:2], PASSER_TOP)
        walking = Passers(place, low, high, PASSER_RADIUS, passers[:, None])
    azimuth = viewpoint[..., AZIMUTH]
    aside = np.stack([-np.sin(azimuth), np.cos(azimuth), np.zeros_like(azimuth)], axis=-1)
    person = position.reshape(len(position), *[1] * (viewpoint.ndim - 2), *position.shape[1:])
    up = HEIGHTS[:, None, None] * np.array([0.0, 0.0, 1.0])  # (3, 1, 3)
    strip = up + ACROSS[:, None] * aside[..., None, None, :]  # (B, ..., 3, 3, 3)
    points = person[..., None, :] + strip.reshape(*strip.shape[:-3], 1, -1, 3)  # (B, ..., P, 9, 3)
    moved = None if centre is None else centre[:, None]
    hidden = Surroundings(obstacles, moved, walking).hide(viewpoint, points, 0)
    seen: FloatArray = 1 - hidden.mean(axis=(-2, -1))
    return seen
