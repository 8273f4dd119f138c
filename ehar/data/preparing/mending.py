"""What a user knows better than the file: its rate, its side, and the joints that are wanted."""

import math
from dataclasses import replace

import numpy as np

from ehar.data.motion_data import MotionData
from ehar.data.preparing.mapping import Target, mapped
from ehar.errors import UsageError


def mended(
    data: MotionData, *, fps: float | None = None, mirror: bool = False, skeleton: Target | None = None
) -> MotionData:
    """Return motion as it should have been read.

    Args:
        data: as it was read.
        fps: frames per second; nothing is resampled. None keeps what the reader says.
        mirror: whether x changes its sign. It mends a left-handed frame, and joints whose left and right are exchanged.
        skeleton: skeleton to map joints to; None keeps the data's.

    Raises:
        UsageError: the rate is not above 0.
        DataError: the data lacks a joint of the skeleton.
    """
    if fps is not None:
        if not (math.isfinite(fps) and fps > 0):
            raise UsageError(f"fps: got {fps}, expected frames per second above 0")
        data = replace(data, fps=float(fps))
    if mirror:
        data = replace(data, positions=data.positions * np.array([-1, 1, 1], dtype=np.float32))
    return data if skeleton is None else mapped(data, skeleton)
