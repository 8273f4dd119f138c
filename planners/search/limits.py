"""The limits of a trajectory on a track: the grid's rates, or those of the vehicle at its viewpoint."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.planner import Context
from ehar.viewpoint import DISTANCE
from planners.heading import axis_speeds
from planners.search.task import TrajectoryLimits, grid_limits


def camera_limits(context: Context, viewpoint: FloatArray, node_time: float) -> TrajectoryLimits:
    """Return the limits of a trajectory from a viewpoint (3,), for each axis and Cartesian.

    The limits of an angle are the vehicle's limits divided by the present distance. The yaw rate limits the azimuth
    too. The centripetal part of the acceleration is not planned: the motion keeps all limits anyway.

    Args:
        context: the episodes' context, which names the track.
        viewpoint: the camera's viewpoint.
        node_time: time from one node of the trajectory to the next [s].
    """
    vehicle = context.vehicle
    if vehicle is None:
        return grid_limits(context.workspace, context.frame_time, node_time)
    per_axis = np.array([1.0, 1 / viewpoint[DISTANCE], 1 / viewpoint[DISTANCE]])
    return TrajectoryLimits(
        velocity=axis_speeds(vehicle, viewpoint),
        acceleration=vehicle.acceleration * per_axis,
        jerk=vehicle.jerk * per_axis,
        speed=vehicle.speed,
    )
