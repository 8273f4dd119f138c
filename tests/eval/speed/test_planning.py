"""The measurement of the solver: it plans as often as it says, and counts it."""

import numpy as np

from eval.speed.planning import measure_solves
from planners.search.solver import TOLERANCE, TrajectorySolver
from tests.helpers.trajectory_tasks import GRID


def test_every_plan_is_counted_and_only_those_measured() -> None:
    solver = TrajectorySolver(seeds=2)
    for _ in range(2):
        measured = measure_solves(np.random.default_rng(0), solver, GRID, node_time=0.16, episodes=2, plans=3)
        assert measured.counts.total() == len(measured.plan_seconds) == 6
        # All three guesses at the start of an episode, and then at least the plan before.
        assert 2 * 3 + 4 <= len(measured.solve_seconds) <= 3 * 6
        assert measured.fallbacks == 0
        assert measured.violation <= TOLERANCE
