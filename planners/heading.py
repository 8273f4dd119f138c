"""The target of a camera in the direction of a move: the next cell, or for a vehicle a farther point."""

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.flight.vehicle import Vehicle
from ehar.planner import Context
from ehar.viewpoint import DISTANCE, MOVES, apply_moves

HEADING_TIME = 1.0  # [s]; a vehicle brakes for its target, so it approaches a near one slowly


def axis_speeds(vehicle: Vehicle, viewpoint: FloatArray) -> FloatArray:
    """Return a vehicle's highest speed along each axis of viewpoints (..., 3) alone [m/s], [rad/s], [rad/s].

    The rate of an angle is at most the speed divided by the present distance. The yaw rate limits the azimuth too.
    """
    speed = np.full(viewpoint.shape[:-1], vehicle.speed)
    rate = vehicle.speed / viewpoint[..., DISTANCE]
    return np.stack([speed, np.minimum(rate, vehicle.yaw_rate), rate], axis=-1)


def heading(context: Context, viewpoint: FloatArray, moves: IntArray) -> FloatArray:
    """Return targets (..., 3) in the direction of moves (...,): the next cell, or for a vehicle a second's way.

    Args:
        context: the episodes' context, which names the track.
        viewpoint: (..., 3), the cameras' viewpoints.
        moves: indices into `MOVES`.
    """
    if context.vehicle is None:
        return apply_moves(viewpoint, moves, context.workspace)
    way = MOVES[moves] * HEADING_TIME * axis_speeds(context.vehicle, viewpoint)
    return context.workspace.clip(viewpoint + way)
