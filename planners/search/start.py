"""The start of a plan for a camera that does not follow plans exactly: the nearest state that it can stop from."""

from dataclasses import replace

import numpy as np

from ehar.arrays import FloatArray
from ehar.viewpoint import DISTANCE, POLAR
from planners.search.task import TrajectoryTask

PACE_SHARE = 0.99  # share of the limit; a solver needs room to begin
TIME_SHARE = 0.5  # share of the horizon for one axis alone; the others have to stop as well, and nodes are coarse


def stoppable(task: TrajectoryTask) -> TrajectoryTask:
    """Return the task with the nearest velocity and acceleration from which it has a solution.

    A camera that another controller flies may be faster than the task's limits, or nearer to the workspace's bounds
    than a plan would ever get at its speed. Then no plan exists, so the plan begins at the state returned here.

    Let A and J be the limits of acceleration and jerk. A stop from velocity v takes at most the way
    v^2 / 2 A + v A / 2 J and the time v / A + A / J. An acceleration a has to end first: this takes the way
    a / J (v + a^2 / 3 J) and adds a^2 / 2 J to v. Slow states stay as they are.
    """
    limits, workspace = task.limits, task.workspace
    rise, fall = np.full(3, np.inf), np.full(3, np.inf)
    for axis, low, high in (
        (DISTANCE, workspace.distance_min, workspace.distance_max),
        (POLAR, workspace.polar_min, workspace.polar_max),
    ):
        rise[axis], fall[axis] = high - task.position[axis], task.position[axis] - low
    acceleration = task.acceleration.clip(-limits.acceleration, limits.acceleration)
    ending = acceleration / limits.jerk * (np.abs(task.velocity) + acceleration**2 / (3 * limits.jerk))
    rise, fall = (rise - ending.clip(0)).clip(0), (fall + ending.clip(None, 0)).clip(0)
    fastest_up, fastest_down = _fastest(rise, task), _fastest(fall, task)
    velocity = task.velocity.clip(-fastest_down, fastest_up)
    reached = velocity + acceleration * np.abs(acceleration) / (2 * limits.jerk)
    slower = PACE_SHARE / max(_pace(velocity, task), _pace(reached, task), PACE_SHARE)
    velocity, acceleration = velocity * slower, acceleration * slower
    most_up, most_down = np.sqrt(2 * limits.jerk * np.array([fastest_up - velocity, velocity + fastest_down]))
    return replace(task, velocity=velocity, acceleration=acceleration.clip(-most_down, most_up))


def _fastest(room: FloatArray, task: TrajectoryTask) -> FloatArray:
    """Return the highest speeds (3,) from which a stop fits into the room (3,), and into a part of the horizon."""
    strongest, half_ramp = task.limits.acceleration, task.limits.acceleration**2 / (2 * task.limits.jerk)
    in_room = np.sqrt(half_ramp**2 + 2 * strongest * room) - half_ramp
    in_time = TIME_SHARE * (task.horizon * task.node_time * strongest - 2 * half_ramp)
    fastest: FloatArray = np.minimum(np.minimum(in_room, in_time.clip(0)), task.limits.velocity)
    return fastest


def _pace(velocity: FloatArray, task: TrajectoryTask) -> float:
    """Return the share that a velocity (3,) uses of the Cartesian speed limit, or of the axes' common budget."""
    distance, _, polar = task.position
    speed = np.linalg.norm(velocity * np.array([1.0, distance * np.sin(polar), distance])) / task.limits.speed
    shared = np.linalg.norm(velocity / task.limits.velocity) * task.limits.shared
    return float(np.hypot(speed, shared))
