"""States that a plan can start from: slow ones are left alone, others brought to where a solution exists."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planners.search.solver import TrajectorySolver
from planners.search.start import stoppable
from planners.search.task import TrajectoryLimits, TrajectoryTask
from tests.helpers.trajectory_tasks import FLIGHT, GRID, random_task

seeds = st.integers(0, 10_000)


def wild_task(rng: np.random.Generator, limits: TrajectoryLimits) -> TrajectoryTask:
    """Return a task whose camera may be much too fast."""
    return random_task(
        rng,
        limits=limits,
        velocity=1.5 * rng.uniform(-1, 1, 3) * limits.velocity,
        acceleration=1.5 * rng.uniform(-1, 1, 3) * limits.acceleration,
        node_time=0.08 if limits.vehicle is None else 0.32,
    )


@pytest.mark.parametrize("limits", [FLIGHT, GRID])
def test_nearly_all_states_become_ones_that_have_a_plan(limits: TrajectoryLimits) -> None:
    rng = np.random.default_rng(0)
    flown = limits.vehicle is not None
    solver, before = (TrajectorySolver(max_iterations=100, flown=flown) for _ in range(2))
    for _ in range(60):
        task = wild_task(rng, limits)
        before.solve(task, task.hold())
        task = stoppable(task)
        solver.solve(task, task.hold())
    assert before.statistics.fallbacks > 18
    assert solver.statistics.fallbacks <= 1


@given(seeds, st.sampled_from([FLIGHT, GRID]))
def test_it_takes_away_and_never_adds(seed: int, limits: TrajectoryLimits) -> None:
    task = wild_task(np.random.default_rng(seed), limits)
    slower = stoppable(task)
    for name in ("velocity", "acceleration"):
        was, became = getattr(task, name), getattr(slower, name)
        assert (np.abs(became) <= np.abs(was) + 1e-12).all() and (became * was >= 0).all()
    assert (np.abs(slower.acceleration) <= limits.acceleration).all()
    if limits.vehicle is None:
        again = stoppable(slower)
        np.testing.assert_allclose(again.velocity, slower.velocity, atol=1e-9)
        np.testing.assert_allclose(again.acceleration, slower.acceleration, atol=1e-6)


@given(seeds)
def test_slow_states_amid_the_workspace_stay_as_they_are(seed: int) -> None:
    rng = np.random.default_rng(seed)
    task = random_task(rng, position=np.array([10.0, 1.0, 0.8]), node_time=0.32)
    # At 10 m, 0.1 rad/s are 1 m/s, slower than the vehicle climbs or descends.
    task = replace(task, velocity=rng.uniform(-0.1, 0.1, 3), acceleration=rng.uniform(-0.2, 0.2, 3))
    np.testing.assert_array_equal(stoppable(task).velocity, task.velocity)
    np.testing.assert_array_equal(stoppable(task).acceleration, task.acceleration)


def test_at_a_bound_nothing_is_left_that_leads_outside() -> None:
    task = random_task(np.random.default_rng(0), position=np.array([15.0, 1.0, 0.0]))
    task = stoppable(replace(task, velocity=np.array([1.0, 0.1, -0.1]), acceleration=np.array([1.0, 0.1, -0.1])))
    np.testing.assert_array_equal(task.velocity, [0, 0.1, 0])
    np.testing.assert_array_equal(task.acceleration, [0, 0.1, 0])
    inwards = stoppable(replace(task, velocity=np.array([-1.0, 0.1, 0.1])))
    np.testing.assert_array_equal(inwards.velocity, [-1, 0.1, 0.1])
