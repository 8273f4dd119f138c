"""Where a vehicle heads in the direction of a move of the grid: farther than a cell, or it would hardly set off."""

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.vehicle import Vehicle
from ehar.viewpoint import DISTANCE, MOVES, Workspace

HEADING_TIME = 1.0  # [s]; a vehicle brakes for a target, so one that is near is approached slowly


def axis_speeds(vehicle: Vehicle, viewpoint: FloatArray) -> FloatArray:
    """Return how fast a vehicle may change each part of viewpoints (..., 3) alone [m/s], [rad/s], [rad/s].

    An angle's rate is the speed divided by the present distance; the azimuth's is the yaw rate too.
    """
    speed = np.full(viewpoint.shape[:-1], vehicle.speed)
    rate = vehicle.speed / viewpoint[..., DISTANCE]
    return np.stack([speed, np.minimum(rate, vehicle.yaw_rate), rate], axis=-1)


def heading(vehicle: Vehicle, viewpoint: FloatArray, moves: IntArray, workspace: Workspace) -> FloatArray:
    """Return targets (..., 3) in the direction of moves (...,) of the grid, as far as the vehicle's speed takes it."""
    return workspace.clip(viewpoint + MOVES[moves] * HEADING_TIME * axis_speeds(vehicle, viewpoint))
