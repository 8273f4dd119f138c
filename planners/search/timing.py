"""How long solves take, and how many fail: re-planned flights over random gain fields that change as they go."""

import numpy as np

from ehar.viewpoint import Workspace, sample_starts
from planners.search.solver import SolverStatistics, TrajectorySolver
from planners.search.task import TrajectoryLimits, TrajectoryTask
from planners.value.view_basis import BASIS_SIZE

FIELD_MEMORY = 0.97  # how much of a field is left one node later; the rest is new


def measure_solves(
    rng: np.random.Generator,
    solver: TrajectorySolver,
    limits: TrajectoryLimits,
    *,
    node_time: float,
    effort_weight: float = 0.01,
    episodes: int = 20,
    plans: int = 15,
) -> SolverStatistics:
    """Return what became of `episodes * plans` solves, each warm-started from the one before it.

    In each episode the camera starts at rest at one of the paper's starts and follows every plan for one node.
    """
    solver.statistics = SolverStatistics()
    horizon = solver.horizon
    gain_weights = np.full(horizon, 1 / horizon)
    for start in sample_starts(rng, episodes):
        state, previous = (start, np.zeros(3), np.zeros(3)), None
        field = rng.normal(size=BASIS_SIZE)
        for _ in range(plans):
            task = TrajectoryTask(*state, field, gain_weights, effort_weight, node_time, limits, Workspace())
            previous = solver.solve_best(task, sample_starts(rng, 16), previous, node_time)
            position, velocity, acceleration, _ = previous.trajectory
            state = (position[1], velocity[1], acceleration[1])
            change = np.sqrt(1 - FIELD_MEMORY**2)
            field = FIELD_MEMORY * field + change * rng.normal(size=BASIS_SIZE)
    return solver.statistics
