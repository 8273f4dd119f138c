"""The guesses that a solver starts from: smooth trajectories to goals, and the previous solution moved on in time."""

from collections.abc import Callable

import numpy as np

from ehar.arrays import FloatArray
from ehar.viewpoint import AZIMUTH, DISTANCE, POLAR, wrap_difference
from planners.search.task import Trajectory, TrajectoryTask

# The peaks of a quintic from rest to rest over unit distance and time.
PEAK_VELOCITY, PEAK_ACCELERATION, PEAK_JERK = 15 / 8, 10 / np.sqrt(3), 60.0


def trajectories_to(goals: FloatArray, task: TrajectoryTask) -> Trajectory:
    """Return a trajectory from the present state to rest at each of the goals (G, 3), the short way round.

    Each is the quintic in time that matches position, velocity and acceleration at both ends. It takes about as long
    as the limits ask for, and stands still afterwards. A trajectory longer than the horizon is cut off. These are
    guesses: they may exceed limits.
    """
    way = goals - task.position
    way[:, AZIMUTH] = wrap_difference(way[:, AZIMUTH])
    duration = _duration(way, task)[:, None, None]
    times = np.minimum(np.arange(task.horizon + 1)[:, None] * task.node_time, duration)
    share = times / duration
    # The coefficients of the quintic in `share` follow from the conditions at both ends.
    first, second = task.velocity * duration, task.acceleration * duration**2 / 2
    way = way[:, None]
    third = 10 * way - 6 * first - 3 * second
    fourth = -15 * way + 8 * first + 3 * second
    fifth = 6 * way - 3 * first - second
    position = task.position + share * (first + share * (second + share * (third + share * (fourth + share * fifth))))
    velocity = first + share * (2 * second + share * (3 * third + share * (4 * fourth + share * 5 * fifth)))
    acceleration = 2 * second + share * (6 * third + share * (12 * fourth + share * 20 * fifth))
    acceleration = acceleration / duration**2
    workspace = task.workspace
    position[..., DISTANCE] = position[..., DISTANCE].clip(workspace.distance_min, workspace.distance_max)
    position[..., POLAR] = position[..., POLAR].clip(workspace.polar_min, workspace.polar_max)
    return Trajectory(position, velocity / duration, acceleration, np.diff(acceleration, axis=1) / task.node_time)


def trajectory_along(places: FloatArray, times: FloatArray, task: TrajectoryTask) -> Trajectory:
    """Return a trajectory from the present viewpoint along a way, places (N, 3) at times (N,) [s], as a guess.

    It is straight between places and stays at the last, so it may exceed limits.
    """
    nodes = np.arange(task.horizon + 1) * task.node_time
    places = np.vstack([task.position, places])
    places[:, AZIMUTH] = np.unwrap(places[:, AZIMUTH])
    position = np.stack([np.interp(nodes, np.append(0.0, times), axis) for axis in places.T], axis=1)
    velocity = np.gradient(position, task.node_time, axis=0)
    velocity[-1] = 0
    acceleration = np.gradient(velocity, task.node_time, axis=0)
    acceleration[-1] = 0
    return Trajectory(position, velocity, acceleration, np.diff(acceleration, axis=0) / task.node_time)


def _duration(way: FloatArray, task: TrajectoryTask) -> FloatArray:
    """Return the durations (G,) [s] of quintics over ways (G, 3) within the limits, at least two nodes."""
    limits, far = task.limits, task.workspace.distance_max
    along = np.abs(way)
    stopping = 2 * np.abs(task.velocity) / limits.acceleration
    duration: FloatArray = np.max(
        [
            PEAK_VELOCITY * along / limits.velocity,
            np.sqrt(PEAK_ACCELERATION * along / limits.acceleration),
            np.cbrt(PEAK_JERK * along / limits.jerk),
            np.broadcast_to(stopping, along.shape),
        ],
        axis=(0, 2),
    )
    if limits.vehicle is None:
        together = (along / limits.velocity).sum(axis=1)
    else:
        together = np.linalg.norm(way * np.array([1.0, far, far]), axis=1) / limits.vehicle.speed
    at_least: FloatArray = np.maximum(PEAK_VELOCITY * together, 2 * task.node_time)
    return np.maximum(duration, at_least)


def moved_on(trajectory: Trajectory, elapsed: float, task: TrajectoryTask) -> Trajectory:
    """Return a trajectory as it is `elapsed` seconds later; after its end it stands still.

    The azimuth is moved by full turns to the task's azimuth, which may have been wrapped in between.
    """
    times = elapsed + np.arange(task.horizon + 1) * task.node_time
    position, velocity, acceleration = states_at(trajectory, times, task.node_time)
    turns = np.rint((task.position[AZIMUTH] - position[0, AZIMUTH]) / (2 * np.pi))
    position[:, AZIMUTH] += 2 * np.pi * turns
    return Trajectory(position, velocity, acceleration, np.diff(acceleration, axis=0) / task.node_time)


def states_at(trajectory: Trajectory, times: FloatArray, node_time: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return position, velocity and acceleration of a trajectory at times (n,) [s], (n, 3) each; its end is at rest."""
    last = len(trajectory.jerk)
    node = np.minimum((times / node_time + 1e-9).astype(int), last)
    after = (times - node * node_time)[:, None]
    ended = (node == last)[:, None]
    velocity = np.where(ended, 0.0, trajectory.velocity[node])
    acceleration = np.where(ended, 0.0, trajectory.acceleration[node])
    jerk = np.vstack([trajectory.jerk, np.zeros(3)])[node]
    position = trajectory.position[node] + after * (velocity + after * (acceleration / 2 + after * jerk / 6))
    return position, velocity + after * (acceleration + after * jerk / 2), acceleration + after * jerk


def at_rest_at_the_end(trajectory: Trajectory, task: TrajectoryTask) -> Trajectory:
    """Return the trajectory from the task's state to rest whose jerk is nearest to that of a given trajectory.

    It is integrated exactly. It may exceed limits by about as much as the given one violates its equations.
    """
    time, remaining = task.node_time, np.arange(task.horizon)[::-1] + 0.5  # nodes from the middle of each jerk on
    effect = np.stack([np.ones(task.horizon), remaining])  # effect of a jerk on the last acceleration and velocity
    last_acceleration = task.acceleration / time + trajectory.jerk.sum(0)
    last_velocity = (task.velocity / time + task.horizon * task.acceleration) / time + remaining @ trajectory.jerk
    jerk = trajectory.jerk - np.linalg.lstsq(effect, np.stack([last_acceleration, last_velocity]))[0]
    nodes = np.empty((3, task.horizon + 1, 3))
    position, velocity, acceleration = nodes
    acceleration[0], velocity[0], position[0] = task.acceleration, task.velocity, task.position
    acceleration[1:] = task.acceleration + time * np.cumsum(jerk, axis=0)
    change = time * (acceleration[:-1] + time / 2 * jerk)
    velocity[1:] = task.velocity + np.cumsum(change, axis=0)
    travelled = time * (velocity[:-1] + time * (acceleration[:-1] / 2 + time / 6 * jerk))
    position[1:] = task.position + np.cumsum(travelled, axis=0)
    return Trajectory(position, velocity, acceleration, jerk)


def best_guesses(
    goals: FloatArray, task: TrajectoryTask, count: int, objective: Callable[[Trajectory], FloatArray]
) -> list[Trajectory]:
    """Return the trajectories to those `count` of the goals (G, 3) whose guesses collect most, best first."""
    guesses = trajectories_to(goals, task)
    order = np.argsort(-objective(guesses), kind="stable")[:count] if len(goals) > 1 else range(len(goals))
    return [Trajectory(*(part[index] for part in guesses)) for index in order]
