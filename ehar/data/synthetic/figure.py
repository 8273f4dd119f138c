"""The three signs that tell synthetic activities apart, and the pulses that make up their movements."""

from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray

FOOT_LIFT = 0.08  # [leg lengths], the height of a stepping foot


class Figure(NamedTuple):
    """The signs of an activity's movements along three axes; every axis is hidden from some viewpoints.

    Args:
        sagittal: along the facing direction, hidden from the front and from behind.
        lateral: across it, hidden from the side.
        vertical: up or down, hidden from above.
    """

    sagittal: float
    lateral: float
    vertical: float


def pulse(phase: FloatArray, begin: float, end: float) -> FloatArray:
    """Return 0 outside (begin, end) of every cycle and a smooth rise to 1 and back inside, (T,)."""
    inside = np.mod(phase - begin, 1.0) / (end - begin)
    return np.where(inside < 1, np.sin(np.pi * inside) ** 2, 0.0)


def lift(phase: FloatArray, begin: float, end: float) -> FloatArray:
    """Return the height (T,) [leg lengths] of a foot that steps out and back within a pulse, down at its peak."""
    inside = np.mod(phase - begin, 1.0) / (end - begin)
    return np.where(inside < 1, FOOT_LIFT * np.sin(2 * np.pi * inside) ** 2, 0.0)
