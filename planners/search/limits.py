"""The limits of a trajectory on a track: the grid's rates, or those of the vehicle at its viewpoint."""

from dataclasses import replace

import numpy as np

from ehar.arrays import FloatArray
from ehar.flight.vehicle import Vehicle
from ehar.planner import Context
from ehar.viewpoint import DISTANCE
from planners.search.task import TrajectoryLimits, grid_limits

# Shares of a vehicle's limits. Plans keep them at their nodes, flights in between as well, where the jerk changes most.
PLANNED = {
    "speed": 0.95,
    "acceleration": 0.9,
    "jerk": 0.7,
    "climb_speed": 0.95,
    "descent_speed": 0.95,
    "yaw_rate": 0.95,
}


def camera_limits(context: Context, viewpoint: FloatArray, node_time: float) -> TrajectoryLimits:
    """Return the limits of a trajectory from a viewpoint (3,), for each axis and Cartesian.

    A vehicle's speed, acceleration and jerk divided by the present distance are about the limits of an angle. Straight
    above any turn is free, so the azimuth has limits of its own: the yaw rate, which builds up in the time in which the
    acceleration does. `ehar.flight.proposals` has the same.

    Args:
        context: the episodes' context, which names the track.
        viewpoint: the camera's viewpoint.
        node_time: time from one node of the trajectory to the next [s].
    """
    if context.vehicle is None:
        return grid_limits(context.workspace, context.frame_time, node_time)
    vehicle = planned(context.vehicle)
    rate = 1 / viewpoint[DISTANCE]
    build_up = vehicle.acceleration / vehicle.jerk
    return TrajectoryLimits(
        velocity=np.array([vehicle.speed, vehicle.yaw_rate, vehicle.speed * rate]),
        acceleration=np.array([vehicle.acceleration, vehicle.yaw_rate / build_up, vehicle.acceleration * rate]),
        jerk=np.array([vehicle.jerk, vehicle.yaw_rate / build_up**2, vehicle.jerk * rate]),
        vehicle=vehicle,
    )


def planned(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with the part of its limits that plans use."""
    return replace(vehicle, **{name: share * getattr(vehicle, name) for name, share in PLANNED.items()})
