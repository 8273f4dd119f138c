"""How much of people is seen from a viewpoint, given obstacles and where people are thought to be."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.obstacles.shapes import Obstacles
from ehar.viewpoint import AZIMUTH, cartesian

# A person as seen from the side: an upright strip, three points high and three across.
HEIGHTS = np.array([-0.7, 0.0, 0.6])  # [m], from the mean of the joints
ACROSS = np.array([-0.25, 0.0, 0.25])  # [m]


def seen_share(viewpoint: FloatArray, position: FloatArray, obstacles: Obstacles) -> FloatArray:
    """Return the share of people that is seen from viewpoints, 0 to 1, (B, ...).

    It is the share of free lines of sight to points on people. Each person is an upright strip that faces the camera.

    Args:
        viewpoint: (B, ..., 3).
        position: (B, P, 3) where people are thought to be, the mean of their joints [m].
        obstacles: what stands there.
    """
    azimuth = viewpoint[..., AZIMUTH]
    aside = np.stack([-np.sin(azimuth), np.cos(azimuth), np.zeros_like(azimuth)], axis=-1)
    person = position.reshape(len(position), *[1] * (viewpoint.ndim - 2), *position.shape[1:])
    up = HEIGHTS[:, None, None] * np.array([0.0, 0.0, 1.0])  # (3, 1, 3)
    strip = up + ACROSS[:, None] * aside[..., None, None, :]  # (B, ..., 3, 3, 3)
    points = person[..., None, :] + strip.reshape(*strip.shape[:-3], 1, -1, 3)  # (B, ..., P, 9, 3)
    seen: FloatArray = 1 - obstacles.hide(cartesian(viewpoint), points).mean(axis=(-2, -1))
    return seen
