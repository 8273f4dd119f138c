"""The start of a plan for a camera that does not follow plans exactly: the nearest state that it can stop from."""

from dataclasses import replace

import numpy as np

from ehar.arrays import FloatArray
from ehar.flight.kinematics import SphericalState
from ehar.flight.limits import limit_shares
from ehar.viewpoint import DISTANCE, POLAR
from planners.search.task import TrajectoryTask

PACE_SHARE = 0.95  # share of the limit; a solver needs room to begin
TIME_SHARE = 0.5  # share of the horizon for one axis alone; the others have to stop as well, and nodes are coarse


def stoppable(task: TrajectoryTask, *, surely: bool = True) -> TrajectoryTask:
    """Return the task with the nearest velocity and acceleration from which it has a solution.

    A camera that another controller flies may be faster than the task's limits, or nearer to the workspace's bounds
    than a plan would ever get at its speed. Then no plan exists, so the plan begins at the state returned here.

    Let A and J be the limits of acceleration and jerk. A stop from velocity v takes at most the way
    v^2 / 2 A + v A / 2 J and the time v / A + A / J. An acceleration a has to end first: this takes the way
    a / J (v + a^2 / 3 J) and adds a^2 / 2 J to v. Slow states stay as they are.

    Args:
        task: the planning task.
        surely: whether a vehicle is also slowed down where its way asks for too much acceleration and jerk. Mostly a
            solution exists without, and then the plan begins nearer to where the camera is.
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
    slower = min(_slower(velocity, acceleration, task, surely), _slower(reached, np.zeros(3), task, surely))
    velocity, acceleration = velocity * slower, acceleration * slower**2
    most_up, most_down = np.sqrt(2 * limits.jerk * np.array([fastest_up - velocity, velocity + fastest_down]))
    return replace(task, velocity=velocity, acceleration=acceleration.clip(-most_down, most_up))


def _fastest(room: FloatArray, task: TrajectoryTask) -> FloatArray:
    """Return the highest speeds (3,) from which a stop fits into the room (3,), and into a part of the horizon."""
    strongest, half_ramp = task.limits.acceleration, task.limits.acceleration**2 / (2 * task.limits.jerk)
    in_room = np.sqrt(half_ramp**2 + 2 * strongest * room) - half_ramp
    in_time = TIME_SHARE * (task.horizon * task.node_time * strongest - 2 * half_ramp)
    fastest: FloatArray = np.minimum(np.minimum(in_room, in_time.clip(0)), task.limits.velocity)
    return fastest


def _slower(velocity: FloatArray, acceleration: FloatArray, task: TrajectoryTask, surely: bool) -> float:
    """Return how much slower a camera has to go along its way, so that it keeps its limits: a share, at most 1.

    At a share k of its pace, it uses k times its share of the speed limits, k^2 of that of the acceleration, and k^3 of
    that of the jerk, which its way alone asks for.
    """
    vehicle = task.limits.vehicle
    if vehicle is None:
        pace = (np.abs(velocity) / task.limits.velocity).sum()
    else:
        state = SphericalState(task.position, velocity, acceleration, np.zeros(3))
        speed, force, jolt, vertical, turn = limit_shares(vehicle, state)
        pace = max(speed, vertical, turn, *((np.sqrt(force), np.cbrt(jolt)) if surely else ()))
    return float(PACE_SHARE / max(pace, PACE_SHARE))
