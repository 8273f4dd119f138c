"""How much of people is seen from a viewpoint, given what is in the way and where people are thought to be."""

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.obstacles.shapes import Obstacles, cylinder_cuts
from ehar.obstacles.surroundings import Surroundings
from ehar.viewpoint import AZIMUTH, cartesian
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
    Each passer-by is an upright cylinder, as nobody tells how they hold their limbs.

    Args:
        viewpoint: (B, ..., 3).
        position: (B, P, 3) where people are thought to be, the mean of their joints [m].
        obstacles: what stands there.
        passers: (B, W, 4) place and velocity of passers-by [m], [m/s]; they walk straight on. None if there are none.
        ahead: how far ahead the viewpoints are [s].
        centre: (B, 3) where the centre is, from where it was in the first frame [m]; None if it has stayed.
    """
    azimuth = viewpoint[..., AZIMUTH]
    aside = np.stack([-np.sin(azimuth), np.cos(azimuth), np.zeros_like(azimuth)], axis=-1)
    person = position.reshape(len(position), *[1] * (viewpoint.ndim - 2), *position.shape[1:])
    up = HEIGHTS[:, None, None] * np.array([0.0, 0.0, 1.0])  # (3, 1, 3)
    strip = up + ACROSS[:, None] * aside[..., None, None, :]  # (B, ..., 3, 3, 3)
    points = person[..., None, :] + strip.reshape(*strip.shape[:-3], 1, -1, 3)  # (B, ..., P, 9, 3)
    moved = None if centre is None else centre[:, None]
    hidden = Surroundings(obstacles, moved).hide(viewpoint, points, 0)
    if passers is not None:
        hidden |= _behind(passers[..., :2] + ahead * passers[..., 2:], cartesian(viewpoint), points)
    seen: FloatArray = 1 - hidden.mean(axis=(-2, -1))
    return seen


def _behind(place: FloatArray, cameras: FloatArray, points: FloatArray) -> BoolArray:
    """Return which points (B, ..., P, N, 3) passers-by at places (B, W, 2) hide from cameras (B, ..., 3)."""
    begin, end = cameras[..., None, None, :].astype(np.float32), points.astype(np.float32)
    hidden = np.zeros(np.broadcast_shapes(begin.shape, end.shape)[:-1], dtype=bool)
    for walker in range(place.shape[1]):
        at = np.zeros((len(place), *[1] * (end.ndim - 2), 3), dtype=np.float32)
        at[..., :2] = place[:, walker].reshape(len(place), *[1] * (end.ndim - 2), 2)
        hidden |= cylinder_cuts(begin - at, end - at, FLOOR, PASSER_TOP, PASSER_RADIUS)
    return hidden
