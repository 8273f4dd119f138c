"""The basis functions of a gain field, which is a linear combination of them; one formula for numpy and CasADi.

They are real spherical harmonics up to degree 3, written as polynomials of the unit vector towards the camera, and
distance terms. So a field is smooth, periodic in the azimuth, and has one value at the pole whatever the azimuth.
"""

from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from ehar.arrays import FloatArray, Trigonometry
from ehar.viewpoint import Workspace
from ehar.world import PAPER

BASIS_SIZE = 21
# Places in the basis of functions that go with sin(m azimuth) and with cos(m azimuth), and their m.
SINES, COSINES = np.array([1, 5, 11, 19, 4, 10, 9]), np.array([3, 7, 13, 18, 8, 14, 15])
ORDERS = np.array([1, 1, 1, 1, 2, 2, 3])


class DistanceRange(NamedTuple):
    """The range of distances over which s runs from -1 to 1.

    Args:
        middle: its middle [m].
        half: half its length [m].
    """

    middle: float
    half: float

    @staticmethod
    def of(workspace: Workspace) -> "DistanceRange":
        """Return the range of a workspace; where it has only one distance, s is 0 there."""
        low, high = workspace.distance_min, workspace.distance_max
        return DistanceRange((low + high) / 2, (high - low) / 2 or 1.0)


PAPER_RANGE = DistanceRange.of(PAPER.workspace)  # Sec. 5.1: 5 to 15 m


def view_basis(distance: Any, azimuth: Any, polar: Any, span: DistanceRange, ops: Trigonometry) -> list[Any]:
    """Return the 21 basis functions at a viewpoint, each of the arguments' shape.

    The 16 harmonics have a mean square of 1 over the sphere (sqrt(4 pi) times the orthonormal ones), ordered by
    degree l and within it by order m = -l to l. The other 5 are s, s^2, s x, s y, s z, where s in [-1, 1] is the
    distance over the world's workspace and (x, y, z) the unit vector towards the camera.

    Args:
        distance: [m].
        azimuth: [rad].
        polar: [rad], 0 is straight above.
        span: the range of distances of the world.
        ops: where sin and cos come from: `numpy` or `casadi`.
    """
    x = ops.sin(polar) * ops.cos(azimuth)
    y = ops.sin(polar) * ops.sin(azimuth)
    z = ops.cos(polar)
    s = (distance - span.middle) / span.half
    return [
        x * 0 + 1,  # an array of ones, not the number 1
        sqrt(3) * y,
        sqrt(3) * z,
        sqrt(3) * x,
        sqrt(15) * x * y,
        sqrt(15) * y * z,
        sqrt(5) / 2 * (3 * z * z - 1),
        sqrt(15) * x * z,
        sqrt(15) / 2 * (x * x - y * y),
        sqrt(35 / 8) * y * (3 * x * x - y * y),
        sqrt(105) * x * y * z,
        sqrt(21 / 8) * y * (5 * z * z - 1),
        sqrt(7) / 2 * z * (5 * z * z - 3),
        sqrt(21 / 8) * x * (5 * z * z - 1),
        sqrt(105) / 2 * z * (x * x - y * y),
        sqrt(35 / 8) * x * (x * x - 3 * y * y),
        s,
        s * s,
        s * x,
        s * y,
        s * z,
    ]


def basis_at(viewpoint: FloatArray, span: DistanceRange) -> FloatArray:
    """Return the view basis (..., 21) at viewpoints (..., 3)."""
    return np.stack(view_basis(viewpoint[..., 0], viewpoint[..., 1], viewpoint[..., 2], span, np), axis=-1)


def mean_direction(basis: FloatArray) -> FloatArray:
    """Return the mean unit vector (..., 3) towards cameras whose mean basis is (..., 21)."""
    x, y, z = basis[..., 3], basis[..., 1], basis[..., 2]
    return np.stack([x, y, z], axis=-1) / sqrt(3)


def turned(basis: FloatArray, angle: FloatArray) -> FloatArray:
    """Return the basis (..., 21) at azimuths less `angle` (...,) [rad]; sums and weights turn in the same way.

    Each order's sine and cosine turn into each other: sin m(a - b) = sin ma cos mb - cos ma sin mb.
    """
    sine, cosine = np.sin(angle[..., None] * ORDERS), np.cos(angle[..., None] * ORDERS)
    result = np.array(basis, dtype=np.float64)
    result[..., SINES] = basis[..., SINES] * cosine - basis[..., COSINES] * sine
    result[..., COSINES] = basis[..., COSINES] * cosine + basis[..., SINES] * sine
    return result


def field_value(weights: FloatArray, viewpoint: FloatArray, span: DistanceRange) -> FloatArray:
    """Return the value of a field (...,) at viewpoints (..., 3) for weights (..., 21); they broadcast."""
    value: FloatArray = (weights * basis_at(viewpoint, span)).sum(-1)
    return value
