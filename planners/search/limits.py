"""How fast a trajectory may go on a track: the grid's rates, or what a vehicle can do from where it is."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.planner import Context
from ehar.viewpoint import DISTANCE
from planners.heading import axis_speeds
from planners.search.task import TrajectoryLimits, grid_limits


def camera_limits(context: Context, viewpoint: FloatArray, node_time: float) -> TrajectoryLimits:
    """Return the limits of a trajectory from a viewpoint (3,), per axis of it and Cartesian.

    An angle's limits are the vehicle's divided by the present distance; the azimuth's rate is the yaw rate too. The
    centripetal part of the acceleration is left to the motion, which keeps all limits whatever is planned.

    Args:
        context: names the track.
        viewpoint: where the camera is.
        node_time: [s] from one node of the trajectory to the next.
    """
    vehicle = context.vehicle
    if vehicle is None:
        return grid_limits(context.frame_time, node_time)
    per_axis = np.array([1.0, 1 / viewpoint[DISTANCE], 1 / viewpoint[DISTANCE]])
    return TrajectoryLimits(
        velocity=axis_speeds(vehicle, viewpoint),
        acceleration=vehicle.acceleration * per_axis,
        jerk=vehicle.jerk * per_axis,
        speed=vehicle.speed,
    )
