"""The motion of a camera in space: Cartesian velocity, acceleration and jerk of viewpoints that change in time."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ehar.arrays import FloatArray, IntArray, Trigonometry
from ehar.viewpoint import AZIMUTH, DISTANCE, POLAR


class SphericalState(NamedTuple):
    """Viewpoints and their first three derivatives in time, each (..., 3): distance [m], azimuth and polar [rad]."""

    viewpoint: FloatArray
    velocity: FloatArray  # [m/s], [rad/s], [rad/s]
    acceleration: FloatArray  # [m/s^2], [rad/s^2], [rad/s^2]
    jerk: FloatArray  # [m/s^3], [rad/s^3], [rad/s^3]

    def select(self, rows: IntArray) -> "SphericalState":
        """Return some of them, by their place on the first axis."""
        return SphericalState(*(part[rows] for part in self))


class CartesianMotion(NamedTuple):
    """Derivatives in time of a camera's position, each (..., 3)."""

    velocity: FloatArray  # [m/s]
    acceleration: FloatArray  # [m/s^2]
    jerk: FloatArray  # [m/s^3]


def local_motion(state: SphericalState) -> CartesianMotion:
    """Return the exact derivatives on three axes: horizontally away from the centre, horizontally across that, and up.

    All centripetal, Coriolis and Euler terms are included.
    """
    distance, azimuth, polar = ([part[..., axis] for part in state] for axis in (DISTANCE, AZIMUTH, POLAR))
    return CartesianMotion(*(np.stack(vector, axis=-1) for vector in local_vectors(distance, azimuth, polar, np)))


def local_vectors(
    distance: Sequence[Any], azimuth: Sequence[Any], polar: Sequence[Any], ops: Trigonometry
) -> list[tuple[Any, Any, Any]]:
    """Return velocity, acceleration and jerk, each as its components on the axes of `local_motion`.

    They come from two rotations in a plane. The first, by the polar angle, gives the camera's height and its horizontal
    radius; the second is by the azimuth about the z axis. One formula for numpy and CasADi.

    Args:
        distance: the distance and its first three derivatives.
        azimuth: the azimuth and its first three derivatives; the azimuth itself does not matter.
        polar: the polar angle and its first three derivatives.
        ops: where sin and cos come from: `numpy` or `casadi`.
    """
    cos, sin = ops.cos(polar[0]), ops.sin(polar[0])
    upright = [(along * cos - across * sin, along * sin + across * cos) for along, across in _turning(distance, polar)]
    outwards = [distance[0] * sin, *(out for _, out in upright)]
    level = _turning(outwards, azimuth)
    return [(*plane, up) for plane, (up, _) in zip(level, upright, strict=True)]


def _turning(radius: Sequence[Any], angle: Sequence[Any]) -> list[tuple[Any, Any]]:
    """Return the first three derivatives of a point r e^(ia) in the plane, each along the ray and across it.

    They follow by Leibniz's rule from r, the derivatives of r, and the derivatives of a.
    """
    r, r1, r2, r3 = radius  # products rather than a cube: `**3` takes numpy a hundred times as long
    _, a1, a2, a3 = angle
    return [
        (r1, r * a1),
        (r2 - r * a1**2, 2 * r1 * a1 + r * a2),
        (r3 - 3 * a1 * (r1 * a1 + r * a2), 3 * (r2 * a1 + r1 * a2) + r * (a3 - a1 * a1 * a1)),
    ]
