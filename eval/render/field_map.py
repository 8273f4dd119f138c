"""Maps of a gain field over directions at the camera's distance, relative to the camera's own direction."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.viewpoint import AZIMUTH, DISTANCE, POLAR
from planners.value.view_basis import DistanceRange, field_value

COLOUR_MAP = "cividis"  # the same to colour-blind readers, and in grey


def gain_over_directions(
    weights: FloatArray, here: FloatArray, azimuth: FloatArray, polar: FloatArray, span: DistanceRange
) -> FloatArray:
    """Return the probability gained by looking to the end from each direction and not from here, (..., H, A).

    Args:
        weights: (..., 21) weights of the field.
        here: (..., 3) viewpoint of the camera.
        azimuth: (A,) [rad].
        polar: (H,) [rad].
        span: range of distances of the world.
    """
    views = np.empty((*here.shape[:-1], len(polar), len(azimuth), 3))
    views[..., DISTANCE] = here[..., DISTANCE, None, None]
    views[..., AZIMUTH], views[..., POLAR] = azimuth, polar[:, None]
    there = field_value(weights[..., None, None, :], views, span)
    gain: FloatArray = there - field_value(weights, here, span)[..., None, None]
    return gain
