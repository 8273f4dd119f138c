"""The optimal control problem: its derivatives, its dynamics, its limits, each against its own definition."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from ehar.errors import UsageError
from ehar.viewpoint import cartesian
from planners.search.problem import REGULARISATION, STAGE, STATE, TrajectoryProblem
from planners.search.task import Trajectory, TrajectoryTask
from tests.helpers.examples import share_of_examples
from tests.helpers.trajectory_tasks import FLIGHT, GRID, random_task

HORIZON = 4
PROBLEM = TrajectoryProblem(HORIZON)
OBJECTIVE = ca.Function("objective", [PROBLEM.nlp["x"], PROBLEM.nlp["p"]], [PROBLEM.nlp["f"]])
CONSTRAINTS = ca.Function("constraints", [PROBLEM.nlp["x"], PROBLEM.nlp["p"]], [PROBLEM.nlp["g"]])
seeds = st.integers(0, 10_000)


def flown(task: TrajectoryTask, jerk: np.ndarray) -> Trajectory:
    """Return where a camera gets with these jerks (H, 3), integrated numerically."""
    states = [np.concatenate([task.position, task.velocity, task.acceleration])]
    for control in jerk:
        result = solve_ivp(
            lambda _, state, control=control: np.concatenate([state[3:], control]),
            (0, task.node_time),
            states[-1],
            rtol=1e-11,
            atol=1e-12,
        )
        states.append(result.y[:, -1])
    nodes = np.array(states)
    return Trajectory(nodes[:, :3], nodes[:, 3:6], nodes[:, 6:], jerk)


def moving_task(rng: np.random.Generator, **changes: object) -> TrajectoryTask:
    """Return a task whose camera is in motion."""
    return random_task(
        rng,
        horizon=HORIZON,
        velocity=rng.uniform(-0.3, 0.3, 3),
        acceleration=rng.uniform(-0.3, 0.3, 3),
        **changes,
    )


@share_of_examples(0.2)
@given(seeds, st.sampled_from([FLIGHT, GRID]))
def test_derivatives_are_those_of_finite_differences(seed: int, limits: object) -> None:
    rng = np.random.default_rng(seed)
    task = moving_task(rng, limits=limits)
    numbers = PROBLEM.arguments(task, task.hold())
    variables = numbers["x0"] + rng.uniform(-0.3, 0.3, len(numbers["x0"]))
    for function in (OBJECTIVE, CONSTRAINTS):
        symbols = function.mx_in()
        jacobian = ca.Function("jacobian", symbols, [ca.jacobian(function(*symbols), symbols[0])])
        analytic = jacobian(variables, numbers["p"]).full()
        step = 1e-6
        for column in rng.choice(len(variables), 8, replace=False):
            shift = step * np.eye(len(variables))[column]
            up, down = (function(variables + way, numbers["p"]).full().ravel() for way in (shift, -shift))
            np.testing.assert_allclose(analytic[:, column], (up - down) / (2 * step), atol=1e-7)


@share_of_examples(0.2)
@given(seeds)
def test_dynamics_are_exact(seed: int) -> None:
    rng = np.random.default_rng(seed)
    task = moving_task(rng)
    trajectory = flown(task, rng.uniform(-1, 1, (HORIZON, 3)) * FLIGHT.jerk)
    numbers = PROBLEM.arguments(task, trajectory)
    constraints = CONSTRAINTS(numbers["x0"], numbers["p"]).full().ravel()
    are_gaps = np.array(PROBLEM.equality)
    are_gaps[-6:] = False  # at rest in the end, which this one need not be
    np.testing.assert_allclose(constraints[are_gaps], 0, atol=1e-9)
    np.testing.assert_allclose(constraints[-6:-3], trajectory.velocity[-1] / FLIGHT.velocity, atol=1e-12)
    np.testing.assert_allclose(constraints[-3:], trajectory.acceleration[-1] / FLIGHT.acceleration, atol=1e-12)


@given(seeds)
def test_the_cost_is_what_the_task_says_in_units_of_what_there_is_to_win(seed: int) -> None:
    rng = np.random.default_rng(seed)
    task = moving_task(rng, effort_weight=0.3, spread_weight=0.4)
    jerk = rng.uniform(-1, 1, (HORIZON, 3)) * FLIGHT.jerk
    trajectory = task.hold()._replace(position=rng.uniform(1, 6, (HORIZON + 1, 3)), jerk=jerk)
    numbers = PROBLEM.arguments(task, trajectory)
    unit = task.effort_weight / numbers["p"][STATE + 21 + HORIZON]
    regularisation = REGULARISATION * ((jerk / FLIGHT.jerk) ** 2).sum() / HORIZON
    # Node 0 of the guess is the present state, which no weight counts.
    cost = float(OBJECTIVE(numbers["x0"], numbers["p"])) - regularisation
    assert -unit * cost == pytest.approx(float(task.objective(trajectory)), abs=1e-9)


@given(seeds)
def test_the_pace_is_the_cartesian_speed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    task = moving_task(rng)
    position = rng.uniform([5, -4, 0], [15, 4, np.pi / 2], (HORIZON + 1, 3))
    direction = rng.normal(size=position.shape)
    step = 1e-6
    speed = np.linalg.norm(cartesian(position + step * direction) - cartesian(position - step * direction), axis=1)
    for share in (0.999, 1.001):
        velocity = direction * (share * FLIGHT.speed * 2 * step / speed)[:, None]
        numbers = PROBLEM.arguments(task, task.hold()._replace(position=position, velocity=velocity))
        constraints = CONSTRAINTS(numbers["x0"], numbers["p"]).full().ravel()
        pace = constraints[~np.array(PROBLEM.equality)]
        assert ((pace <= 1) == (share <= 1)).all()


def test_the_axes_of_the_grid_share_one_step_a_frame() -> None:
    task = random_task(np.random.default_rng(0), horizon=HORIZON, limits=GRID)
    for shares, inside in (((1, 0, 0), True), ((0, 0.6, 0.8), True), ((0, 0.61, 0.8), False), ((0.6, 0.6, 0.6), False)):
        velocity = np.tile((np.array(shares) - 1e-9) * GRID.velocity, (HORIZON + 1, 1))
        numbers = PROBLEM.arguments(task, task.hold()._replace(velocity=velocity))
        constraints = CONSTRAINTS(numbers["x0"], numbers["p"]).full().ravel()
        assert (constraints[~np.array(PROBLEM.equality)] <= 1).all() == inside


@given(seeds, st.integers(1, HORIZON), st.sampled_from(range(STAGE)), st.floats(0.01, 1))
def test_a_violation_is_found_wherever_it_is(seed: int, node: int, variable: int, excess: float) -> None:
    rng = np.random.default_rng(seed)
    # Where nothing else is violated: at rest, from rest, amid the workspace.
    task = random_task(rng, horizon=HORIZON, position=np.array([10.0, 3.0, 0.8]))
    numbers = PROBLEM.arguments(task, task.hold())
    assert PROBLEM.violation(numbers["x0"], numbers) < 1e-12
    index = STAGE * node + variable
    if index >= len(numbers["x0"]) or not np.isfinite(numbers["ubx"][index]):
        return
    numbers["x0"][index] = numbers["ubx"][index] + excess
    assert PROBLEM.violation(numbers["x0"], numbers) >= excess - 1e-12
    numbers["x0"][index] = np.nan
    assert np.isnan(PROBLEM.violation(numbers["x0"], numbers))


@given(seeds)
def test_packing_is_undone_by_unpacking(seed: int) -> None:
    rng = np.random.default_rng(seed)
    task = moving_task(rng)
    trajectory = Trajectory(*(rng.normal(size=part.shape) for part in task.hold()))
    for part, expected in zip(PROBLEM.unpack(PROBLEM.pack(trajectory, task), task), trajectory, strict=True):
        np.testing.assert_allclose(part, expected, atol=1e-12)


def test_another_horizon_is_refused() -> None:
    task = random_task(np.random.default_rng(0), horizon=HORIZON)
    with pytest.raises(UsageError, match="expected 4 gain weights, got 3"):
        PROBLEM.arguments(replace(task, gain_weights=np.ones(3)), task.hold())
