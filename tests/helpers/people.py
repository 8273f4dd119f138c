"""People who face a known way."""

import numpy as np

from ehar.arrays import FloatArray
from tests.helpers.fakes import POSE


def facing_people(azimuth: FloatArray) -> FloatArray:
    """Return the tests' pose, which faces along x, turned to azimuths (...,): (..., 6, 3)."""
    cos, sin, zero = np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)
    turn = np.stack([cos, -sin, zero, sin, cos, zero, zero, zero, zero + 1], axis=-1).reshape(*azimuth.shape, 3, 3)
    return np.einsum("...ij,kj->...ki", turn, POSE.astype(np.float64))
