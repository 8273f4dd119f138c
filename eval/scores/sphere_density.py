"""Where on the sphere cameras were, seen from above: a density in the plane that keeps areas.

Lambert's azimuthal equal-area projection from straight above: a point at azimuth a and polar angle p lies at the
distance sqrt(2) sin(p / 2) from the middle, so that the level (p = 90 degrees) is the unit circle, and equal areas of
the plane are equal parts of the sphere. Cameras that were anywhere alike give an even disc.
"""

from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray
from ehar.viewpoint import AZIMUTH, POLAR

CELLS = 30  # to a side


class SphereDensity(NamedTuple):
    """How often cameras were in each part of the upper half of the sphere.

    Args:
        edges: (31,) of the cells, the same along both axes, -1 to 1.
        times_even: (30, 30), rows along y: how many times as often as if all directions were alike; NaN outside of
            the disc.
    """

    edges: FloatArray
    times_even: FloatArray


def from_above(viewpoint: FloatArray) -> FloatArray:
    """Return where viewpoints (..., 3) lie in the plane, (..., 2) within the unit disc; azimuth 0 is +x."""
    radius = np.sqrt(2) * np.sin(viewpoint[..., POLAR] / 2)
    azimuth = viewpoint[..., AZIMUTH]
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth)], axis=-1)


def sphere_density(viewpoint: FloatArray) -> SphereDensity:
    """Return the density over all viewpoints (..., 3); whatever the distance."""
    points = np.clip(from_above(viewpoint).reshape(-1, 2), -1, 1)
    edges = np.linspace(-1, 1, CELLS + 1)
    counts, _, _ = np.histogram2d(points[:, 1], points[:, 0], bins=(edges, edges))
    even = (2 / CELLS) ** 2 / np.pi * len(points)  # frames of a cell within the disc
    nearest = np.clip(0.0, edges[:-1], edges[1:])  # of each cell to the middle
    outside = np.hypot(nearest[:, None], nearest) >= 1
    return SphereDensity(edges, np.where(outside & (counts == 0), np.nan, counts / even))
