"""Where a camera heads in the direction of a move: the next cell, or for a vehicle farther than that."""

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.flight.vehicle import Vehicle
from ehar.planner import Context
from ehar.viewpoint import DISTANCE, MOVES, apply_moves

HEADING_TIME = 1.0  # [s]; a vehicle brakes for a target, so one that is near is approached slowly


def axis_speeds(vehicle: Vehicle, viewpoint: FloatArray) -> FloatArray:
    """Return how fast a vehicle may change each part of viewpoints (..., 3) alone [m/s], [rad/s], [rad/s].

    An angle's rate is the speed divided by the present distance; the azimuth's is the yaw rate too.
    """
    speed = np.full(viewpoint.shape[:-1], vehicle.speed)
    rate = vehicle.speed / viewpoint[..., DISTANCE]
    return np.stack([speed, np.minimum(rate, vehicle.yaw_rate), rate], axis=-1)


def heading(context: Context, viewpoint: FloatArray, moves: IntArray) -> FloatArray:
    """Return targets (..., 3) in the direction of moves (...,): the next cell, or as far as a vehicle's speed takes it.

    Args:
        context: names the track.
        viewpoint: (..., 3), where the cameras are.
        moves: indices into `MOVES`.
    """
    if context.vehicle is None:
        return apply_moves(viewpoint, moves, context.workspace)
    way = MOVES[moves] * HEADING_TIME * axis_speeds(context.vehicle, viewpoint)
    return context.workspace.clip(viewpoint + way)
