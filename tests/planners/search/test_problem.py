"""The optimal control problem: its derivatives, its dynamics, its limits, each against its own definition."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from ehar.errors import UsageError
from ehar.flight.costs import flight_costs
from ehar.flight.kinematics import CartesianMotion, SphericalState
from ehar.flight.limits import limit_shares, world_motion
from ehar.world import ROOM
from planners.search.costs import ROUNDED_SPEED, FlightShares
from planners.search.problem import REGULARISATION, TrajectoryProblem
from planners.search.scene import Scene
from planners.search.task import NO_COST, Trajectory, TrajectoryLimits, TrajectoryTask
from planners.value.view_basis import BASIS_SIZE, PAPER_RANGE
from tests.helpers.examples import share_of_examples
from tests.helpers.trajectory_tasks import FLIGHT, GRID, VEHICLE, random_task

HORIZON = 4
FLOWN, LED = TrajectoryProblem(HORIZON, flown=True), TrajectoryProblem(HORIZON)
SCENE = Scene.of(np.array([[0.1, -0.2, 0.0]]), ROOM.obstacles, np.array([[1.0, 2.0, 0.5, -1.0]]))
AMONG = TrajectoryProblem(HORIZON, scene=SCENE.size)
COUNTED = TrajectoryProblem(HORIZON, flown=True, body=VEHICLE.body)
COSTS = {"flight_weights": FlightShares(power=0.5, sound=0.2, speed=0.1)}
SHARES, TURNS = 5, 4  # of a node in flight


def function(problem: TrajectoryProblem, part: str) -> ca.Function:
    return ca.Function(part, [problem.nlp["x"], problem.nlp["p"]], [problem.nlp[part]])


CONSTRAINTS = function(FLOWN, "g")
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
        field_weights=rng.normal(size=(HORIZON, BASIS_SIZE)),
        velocity=rng.uniform(-0.3, 0.3, 3),
        acceleration=rng.uniform(-0.3, 0.3, 3),
        **changes,
    )


@share_of_examples(0.2)
@given(seeds, st.sampled_from([(FLOWN, FLIGHT), (LED, GRID), (AMONG, GRID), (COUNTED, FLIGHT)]))
def test_derivatives_are_those_of_finite_differences(
    seed: int, track: tuple[TrajectoryProblem, TrajectoryLimits]
) -> None:
    problem, limits = track
    rng = np.random.default_rng(seed)
    task = moving_task(
        rng, limits=limits, scene=SCENE if problem is AMONG else None, **(COSTS if problem is COUNTED else {})
    )
    numbers = problem.arguments(task, task.hold())
    variables = numbers["x0"] + rng.uniform(-0.3, 0.3, len(numbers["x0"]))
    for part in "fg":
        values = function(problem, part)
        symbols = values.mx_in()
        jacobian = ca.Function("jacobian", symbols, [ca.jacobian(values(*symbols), symbols[0])])
        analytic = jacobian(variables, numbers["p"]).full()
        step = 1e-6
        for column in rng.choice(len(variables), 8, replace=False):
            shift = step * np.eye(len(variables))[column]
            up, down = (values(variables + way, numbers["p"]).full().ravel() for way in (shift, -shift))
            np.testing.assert_allclose(analytic[:, column], (up - down) / (2 * step), rtol=1e-6, atol=1e-6)


@share_of_examples(0.2)
@given(seeds, st.sampled_from([(FLOWN, {}), (COUNTED, COSTS)]))
def test_quick_second_derivatives_leave_out_only_how_forces_bend_with_the_way(
    seed: int, kind: tuple[TrajectoryProblem, dict]
) -> None:
    problem, costs = kind
    rng = np.random.default_rng(seed)
    task = moving_task(rng, **costs)
    numbers = problem.arguments(task, task.hold())
    variables = numbers["x0"] + rng.uniform(-0.3, 0.3, len(numbers["x0"]))
    x, f, g, p = (problem.nlp[part] for part in "xfgp")
    weight, weights = ca.SX.sym("weight"), ca.SX.sym("weights", g.numel())
    hessian, gradient = ca.hessian(weight * f + ca.dot(weights, g), x)
    exact = ca.Function("exact", [x, p, weight, weights], [gradient, hessian])
    multipliers = rng.uniform(0.1, 1, g.numel())

    true, quick = (hessian(variables, numbers["p"], 1.0, multipliers) for hessian in (exact, problem.quick_hessian))
    np.testing.assert_allclose(quick[0].full(), true[0].full(), rtol=1e-9, atol=1e-12)
    left_out = true[1].full() - quick[1].full()
    np.testing.assert_allclose(left_out, left_out.T, atol=1e-9)
    assert np.abs(left_out).max() > 1e-3
    forced = [
        FLOWN.stage_size * node + axis
        for node in range(HORIZON)
        for axis in (*range(6, 9), *range(FLOWN.state_size, FLOWN.stage_size))
    ]
    np.testing.assert_allclose(left_out[np.ix_(forced, forced)], 0, atol=1e-9)

    is_force = np.flatnonzero(~np.array(problem.equality))  # of the first node the jerk; then jerk, speed, acceleration
    later = is_force[1:].reshape(HORIZON - 1, SHARES + TURNS)
    multipliers[[is_force[0], *later[:, 0], *later[:, 2]]] = 0
    true, quick = (
        hessian(variables, numbers["p"], 1.0, multipliers)[1].full() for hessian in (exact, problem.quick_hessian)
    )
    np.testing.assert_allclose(quick, true, rtol=1e-9, atol=1e-9)


@share_of_examples(0.2)
@given(seeds)
def test_dynamics_are_exact(seed: int) -> None:
    rng = np.random.default_rng(seed)
    task = moving_task(rng)
    trajectory = flown(task, rng.uniform(-1, 1, (HORIZON, 3)) * FLIGHT.jerk)
    numbers = FLOWN.arguments(task, trajectory)
    constraints = CONSTRAINTS(numbers["x0"], numbers["p"]).full().ravel()
    are_gaps = np.array(FLOWN.equality)
    are_gaps[-6:] = False  # at rest in the end, which this one need not be
    np.testing.assert_allclose(constraints[are_gaps], 0, atol=1e-9)
    np.testing.assert_allclose(constraints[-6:-3], trajectory.velocity[-1] / FLIGHT.velocity, atol=1e-12)
    np.testing.assert_allclose(constraints[-3:], trajectory.acceleration[-1] / FLIGHT.acceleration, atol=1e-12)


@given(seeds, st.booleans())
def test_the_cost_is_what_the_task_says_in_units_of_what_there_is_to_win(seed: int, counted: bool) -> None:
    rng = np.random.default_rng(seed)
    problem = COUNTED if counted else FLOWN
    task = moving_task(rng, effort_weight=0.3, spread_weight=0.4, **(COSTS if counted else {}))
    jerk = rng.uniform(-1, 1, (HORIZON, 3)) * FLIGHT.jerk
    position = rng.uniform(1, 6, (HORIZON + 1, 3))
    velocity, acceleration = rng.uniform(-1, 1, (2, HORIZON + 1, 3))
    trajectory = Trajectory(position, velocity, acceleration, jerk)
    numbers = problem.arguments(task, trajectory)
    unit = task.effort_weight / numbers["p"][FLOWN.state_size + (21 + 1) * HORIZON]
    regularisation = REGULARISATION * ((jerk / FLIGHT.jerk) ** 2).sum() / HORIZON
    # Node 0 of the guess is the present state, which no weight counts.
    cost = float(function(problem, "f")(numbers["x0"], numbers["p"])) - regularisation
    assert -unit * cost == pytest.approx(float(task.objective(trajectory)), abs=1e-9)


@given(seeds)
def test_costs_are_those_that_flights_are_recorded_with(seed: int) -> None:
    rng = np.random.default_rng(seed)
    task = moving_task(rng, **COSTS)
    position = rng.uniform([5, -4, 0.1], [15, 4, np.pi / 2], (HORIZON + 1, 3))
    velocity, acceleration = rng.normal(size=(2, HORIZON + 1, 3)) * np.array([2, 0.3, 0.3])
    trajectory = Trajectory(position, velocity, acceleration, np.zeros((HORIZON, 3)))
    state = SphericalState(position[1:], velocity[1:], acceleration[1:], np.zeros((HORIZON, 3)))
    motion = CartesianMotion(*(part[:, None].repeat(2, axis=1) for part in world_motion(state)))
    assert VEHICLE.body is not None
    costs = flight_costs(VEHICLE.body, motion, position[1:, :1].repeat(2, axis=1), 1.0)
    assert costs.energy is not None and costs.noise is not None
    at_10_m = VEHICLE.body.sound_power_level - 10 * np.log10(4 * np.pi * PAPER_RANGE.middle**2)
    energy, sound = costs.energy / VEHICLE.body.hover_power, 10 ** ((costs.noise - at_10_m) / 10)
    rounded = np.sqrt(costs.distance**2 + ROUNDED_SPEED**2) - ROUNDED_SPEED
    without = replace(task, flight_weights=NO_COST).objective(trajectory)
    expected = (0.5 * energy + 0.2 * sound + 0.1 * rounded).mean()
    assert without - task.objective(trajectory) == pytest.approx(expected)


def test_without_flight_weights_nothing_of_flights_costs_is_in_the_problem() -> None:
    task = random_task(np.random.default_rng(0), horizon=HORIZON)
    assert COUNTED.nlp["p"].numel() == FLOWN.nlp["p"].numel() + 3
    assert FLOWN.nlp["p"].numel() == len(FLOWN.arguments(task, task.hold())["p"])
    assert not any("price" in str(symbol) for symbol in ca.symvar(FLOWN.nlp["f"]))
    with pytest.raises(UsageError, match="expected flights that cost those of Multicopter"):
        COUNTED.arguments(task, task.hold())


def inequalities(problem: TrajectoryProblem, task: TrajectoryTask, trajectory: Trajectory) -> np.ndarray:
    """Return the values of the constraints that are no equations."""
    numbers = problem.arguments(task, trajectory)
    constraints = function(problem, "g")(numbers["x0"], numbers["p"]).full().ravel()
    return constraints[~np.array(problem.equality)]


@given(seeds, st.floats(0.5, 2))
def test_what_a_vehicle_may_not_exceed_is_what_its_flights_are_held_to(seed: int, scale: float) -> None:
    """Speed, acceleration, jerk, climb and descent, at the nodes but the last; of the first the jerk alone."""
    rng = np.random.default_rng(seed)
    task = moving_task(rng)
    position = rng.uniform([5, -4, 0], [15, 4, np.pi / 2], (HORIZON + 1, 3))
    velocity, acceleration = scale * rng.normal(size=(2, *position.shape)) * np.array([3, 0.5, 0.4])
    position[0], velocity[0], acceleration[0] = task.position, task.velocity, task.acceleration
    jerk = scale * rng.normal(size=(HORIZON, 3)) * np.array([2, 0.5, 0.3])
    values = inequalities(FLOWN, task, Trajectory(position, velocity, acceleration, jerk))
    nodes = SphericalState(position[:-1], velocity[:-1], acceleration[:-1], jerk)
    speed, force, jolt, vertical, _ = limit_shares(VEHICLE, nodes).T
    assert (values[0] <= 1) == (jolt[0] <= 1)
    found = values[1:].reshape(HORIZON - 1, SHARES + TURNS)
    for column, share in enumerate((jolt, speed, force)):
        np.testing.assert_array_equal(found[:, column] <= 1, share[1:] <= 1)
    np.testing.assert_allclose(found[:, 3:5].max(axis=1), vertical[1:])


@given(seeds)
def test_a_flight_stays_between_its_turning_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    task = random_task(rng, horizon=HORIZON, node_time=0.4)
    trajectory = flown(task, rng.uniform(-1, 1, (HORIZON, 3)) * FLIGHT.jerk)
    turning = inequalities(FLOWN, task, trajectory)[1:].reshape(HORIZON - 1, -1)[:, SHARES:].reshape(-1, 2, 2)
    times = np.linspace(0, task.node_time, 9)[:, None]
    for node in range(HORIZON - 1):
        p, v, a, j = (part[node] for part in trajectory)
        between = p + times * (v + times * (a / 2 + times * j / 6))
        for place, (axis, unit) in enumerate(((0, PAPER_RANGE.half), (2, 1.0))):
            ends = unit * turning[max(node - 1, 0) : node + 1, place].ravel()
            reach = [*ends, p[axis], trajectory.position[node + 1, axis]]
            assert min(reach) - 1e-9 <= between[:, axis].min() and between[:, axis].max() <= max(reach) + 1e-9


def test_the_axes_of_the_grid_share_one_step_a_frame() -> None:
    task = random_task(np.random.default_rng(0), horizon=HORIZON, limits=GRID)
    for shares, inside in (
        ((1, 0, 0), True),
        ((0, -0.4, 0.6), True),
        ((0.3, 0.3, -0.4), True),
        ((0, 0.6, 0.41), False),
        ((-0.4, 0.4, -0.4), False),
    ):
        velocity = np.tile((np.array(shares) * (1 - 1e-9)) * GRID.velocity, (HORIZON + 1, 1))
        values = inequalities(LED, task, task.hold()._replace(velocity=velocity))
        assert (values <= 1).all() == inside


@given(seeds, st.integers(1, HORIZON), st.sampled_from(range(FLOWN.stage_size)), st.floats(0.01, 1))
def test_a_violation_is_found_wherever_it_is(seed: int, node: int, variable: int, excess: float) -> None:
    rng = np.random.default_rng(seed)
    # Where nothing else is violated: at rest, from rest, amid the workspace.
    task = random_task(rng, horizon=HORIZON, position=np.array([10.0, 3.0, 0.8]))
    numbers = FLOWN.arguments(task, task.hold())
    assert FLOWN.violation(numbers["x0"], numbers) < 1e-12
    index = FLOWN.stage_size * node + variable
    if index >= len(numbers["x0"]) or not np.isfinite(numbers["ubx"][index]):
        return
    numbers["x0"][index] = numbers["ubx"][index] + excess
    assert FLOWN.violation(numbers["x0"], numbers) >= excess - 1e-12
    numbers["x0"][index] = np.nan
    assert np.isnan(FLOWN.violation(numbers["x0"], numbers))


@given(seeds)
def test_packing_is_undone_by_unpacking(seed: int) -> None:
    rng = np.random.default_rng(seed)
    task = moving_task(rng)
    trajectory = Trajectory(*(rng.normal(size=part.shape) for part in task.hold()))
    for part, now in zip(trajectory, (task.position, task.velocity, task.acceleration), strict=False):
        part[0] = now
    for part, expected in zip(FLOWN.unpack(FLOWN.arguments(task, trajectory)["x0"], task), trajectory, strict=True):
        np.testing.assert_allclose(part, expected, atol=1e-12)


def test_limits_of_another_track_are_refused() -> None:
    flown, grid = (random_task(np.random.default_rng(0), horizon=HORIZON, limits=limits) for limits in (FLIGHT, GRID))
    with pytest.raises(UsageError, match=r"expected limits of a vehicle, got those of the grid$"):
        FLOWN.arguments(grid, grid.hold())
    with pytest.raises(UsageError, match=f"expected limits of the grid, got those of {VEHICLE.name}$"):
        LED.arguments(flown, flown.hold())


def test_another_horizon_is_refused() -> None:
    task = random_task(np.random.default_rng(0), horizon=3)
    with pytest.raises(UsageError, match="expected 4 gain weights, got 3"):
        FLOWN.arguments(task, task.hold())
