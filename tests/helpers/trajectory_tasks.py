"""Planning tasks, drawn at random, for the tests of what plans trajectories."""

from dataclasses import replace
from typing import Any

import numpy as np

from ehar.arrays import FloatArray
from ehar.flight.vehicle import VEHICLES
from ehar.viewpoint import Workspace
from ehar.world import PAPER
from planners.search.task import TrajectoryLimits, TrajectoryTask, grid_limits
from planners.value.view_basis import BASIS_SIZE

HORIZON = 15
GRID = grid_limits(PAPER.workspace, 0.04, 0.08)
VEHICLE = VEHICLES["px4-auto"]
FLIGHT = TrajectoryLimits(
    np.array([5, VEHICLE.yaw_rate, 0.5]), np.array([3, 1.0, 0.4]), np.array([4, 1.4, 0.6]), vehicle=VEHICLE
)


def at_all_nodes(weights: FloatArray, horizon: int = HORIZON) -> FloatArray:
    """Return the weights (21,) of a field that is the same at all nodes, (H, 21)."""
    return np.tile(weights, (horizon, 1))


def random_task(rng: np.random.Generator, *, horizon: int = HORIZON, **changes: Any) -> TrajectoryTask:
    """Return a task from rest at one of the paper's starts, in flight unless `changes` say otherwise."""
    task = TrajectoryTask(
        position=PAPER.sample_starts(rng, 1)[0],
        velocity=np.zeros(3),
        acceleration=np.zeros(3),
        field_weights=at_all_nodes(rng.normal(size=BASIS_SIZE), horizon),
        gain_weights=np.full(horizon, 1 / horizon),
        effort_weight=0.01,
        node_time=0.2,
        limits=FLIGHT,
        workspace=Workspace(),
    )
    return replace(task, **changes)
