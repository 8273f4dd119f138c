"""The unit and the axis up of files, and how their numbers become metres with z up."""

import math
from typing import Literal, get_args

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import UsageError

Up = Literal["z", "y", "-y", "-z"]
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}

_ROTATIONS: dict[Up, FloatArray] = {  # rows: x, y and z of ours from those of the file; determinant 1, nothing mirrored
    "z": np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]),
    "y": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "-y": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    "-z": np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]),
}


def metres(unit: str | float) -> float:
    """Return a unit of length in metres: m, cm, mm, or a number of metres.

    Raises:
        UsageError: it is no unit.
    """
    try:
        length = UNITS[unit] if isinstance(unit, str) and unit in UNITS else float(unit)
    except ValueError:
        length = math.nan
    if not (math.isfinite(length) and length > 0):
        raise UsageError(f"unit: got {unit!r}, expected {', '.join(UNITS)}, or a number of metres above 0")
    return length


def up_rotation(up: Up, *, of_camera: bool = False) -> FloatArray:
    """Return the rotation (3, 3) from a file's axes to ours.

    Args:
        up: the axis of the file that points up.
        of_camera: whether joints are in the frame of the camera that recorded them, as `views` tells. Ours has x to the
            camera's right, y away from it and z up, and a file with z up is taken as such. With y up it is taken as a
            Kinect's, with x to its left and z away; with y down as an image's, with x to the right and z away.

    Raises:
        UsageError: the axis is unknown.
    """
    if up not in _ROTATIONS:
        raise UsageError(f"up: got {up!r}, expected one of {', '.join(get_args(Up))}")
    half_turn: FloatArray = np.diag([-1.0, -1.0, 1.0])
    return half_turn @ _ROTATIONS[up] if of_camera and up == "y" else _ROTATIONS[up]


def upright(positions: FloatArray, *, unit: str | float, up: Up, of_camera: bool = False) -> FloatArray:
    """Return positions (..., 3) of a file in metres with z up, as float32; they are turned, never mirrored.

    Args:
        positions: as they stand in the file.
        unit: its unit of length: m, cm, mm, or a number of metres.
        up: its axis that points up: z, y, -y or -z.
        of_camera: as in `up_rotation`.

    Raises:
        UsageError: `unit` or `up` is unknown.
    """
    turned: FloatArray = (positions @ up_rotation(up, of_camera=of_camera).T) * metres(unit)
    return turned.astype(np.float32)
