"""The solver: plans keep the limits, head for what is worth seeing, and every failure is named and counted."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ehar.errors import UsageError
from ehar.flight.kinematics import SphericalState
from ehar.flight.limits import limit_shares
from ehar.viewpoint import AZIMUTH, DISTANCE, POLAR, cartesian
from ehar.world import PAPER
from planners.search import solver as solver_module
from planners.search.guess import best_guesses, states_at
from planners.search.solver import ITERATIONS, TOLERANCE, SolveStatus, TrajectorySolver
from planners.search.task import Trajectory, TrajectoryLimits, TrajectoryTask
from planners.value.view_basis import BASIS_SIZE, PAPER_RANGE, view_basis
from tests.helpers.examples import share_of_examples
from tests.helpers.trajectory_tasks import FLIGHT, GRID, HORIZON, at_all_nodes, random_task

seeds = st.integers(0, 10_000)


@cache
def made_once(*, flown: bool, iterations: int | None) -> TrajectorySolver:
    return TrajectorySolver(max_iterations=iterations, flown=flown)


def solver_of(limits: TrajectoryLimits, iterations: int | None = None) -> TrajectorySolver:
    """Return a solver of plans in flight or on the grid, of at most so many iterations."""
    return made_once(flown=limits.vehicle is not None, iterations=iterations)


def largest_excess(task: TrajectoryTask, trajectory: Trajectory) -> float:
    """Return by how much a trajectory exceeds any limit, from scratch, in its units; of positions in [m], [rad]."""
    limits, time = task.limits, task.node_time
    p, v, a, j = trajectory
    excess = [
        np.abs(p[1:] - (p + time * v + time**2 / 2 * a)[:-1] - time**3 / 6 * j).max(),
        (np.abs(v[1:] - (v + time * a)[:-1] - time**2 / 2 * j) / limits.velocity).max(),
        (np.abs(a[1:] - a[:-1] - time * j) / limits.acceleration).max(),
        np.abs([p[0] - task.position, v[0] - task.velocity, a[0] - task.acceleration]).max(),
        (task.workspace.distance_min - p[1:, 0]).max(),
        (p[1:, 0] - task.workspace.distance_max).max(),
        (task.workspace.polar_min - p[1:, 2]).max(),
        (p[1:, 2] - task.workspace.polar_max).max(),
        np.abs([v[-1] / limits.velocity, a[-1] / limits.acceleration]).max(),
    ]
    axes = [AZIMUTH]
    if limits.vehicle is None:
        axes = [DISTANCE, AZIMUTH, POLAR]
        excess.append((np.abs(v[1:]) / limits.velocity).sum(axis=1).max() - 1)
    else:
        shares = limit_shares(limits.vehicle, SphericalState(p[:-1], v[:-1], a[:-1], j))
        excess += [shares[1:].max() - 1, shares[0, 2] - 1]  # speed and acceleration at the first node are given
    for part, most in ((v[1:], limits.velocity), (a[1:], limits.acceleration), (j, limits.jerk)):
        excess.append((np.abs(part) / most)[:, axes].max() - 1)
    return float(np.max(excess))


def peak_at(viewpoint: np.ndarray) -> np.ndarray:
    """Return weights of a field that is highest in one direction, the same at every distance."""
    _, y, z, x = view_basis(*viewpoint, PAPER_RANGE, np)[:4]
    weights = np.zeros(BASIS_SIZE)
    weights[1:4] = y, z, x
    return at_all_nodes(weights)


@share_of_examples(0.25)
@given(seeds, st.sampled_from([FLIGHT, GRID]))
def test_plans_keep_the_limits_and_can_be_followed_by_others(seed: int, limits: TrajectoryLimits) -> None:
    rng = np.random.default_rng(seed)
    task, previous = random_task(rng, limits=limits, node_time=0.08 if limits.vehicle is None else 0.4), None
    for _ in range(3):
        previous = solver_of(limits).solve_best(task, PAPER.sample_starts(rng, 8), previous, task.node_time)
        assert previous.status is SolveStatus.OPTIMAL
        assert previous.violation <= TOLERANCE
        assert largest_excess(task, previous.trajectory) <= 5 * TOLERANCE  # the position's unit is 5 m
        assert previous.objective == float(task.objective(previous.trajectory))
        assert previous.objective >= float(task.objective(task.hold())) or task.velocity.any()
        position, velocity, acceleration, _ = previous.trajectory
        task = replace(task, position=position[1], velocity=velocity[1], acceleration=acceleration[1])
        task = replace(task, field_weights=task.field_weights + 0.3 * rng.normal(size=(HORIZON, BASIS_SIZE)))


@share_of_examples(0.25)
@given(seeds, st.sampled_from([FLIGHT, GRID]))
@example(152, GRID)  # was stopped with a gap of 0.03 m/s between velocity and acceleration
def test_capped_plans_keep_the_limits_too(seed: int, limits: TrajectoryLimits) -> None:
    rng = np.random.default_rng(seed)
    task, previous = random_task(rng, limits=limits, node_time=0.08 if limits.vehicle is None else 0.4), None
    for iterations in (6, 6, 1):
        previous = solver_of(limits, iterations).solve_best(task, PAPER.sample_starts(rng, 8), previous, task.node_time)
        assert previous.status in (SolveStatus.CAPPED, SolveStatus.OPTIMAL)
        assert previous.violation <= TOLERANCE
        assert largest_excess(task, previous.trajectory) <= 5 * TOLERANCE  # the position's unit is 5 m
        position, velocity, acceleration, _ = previous.trajectory
        task = replace(task, position=position[1], velocity=velocity[1], acceleration=acceleration[1])


@share_of_examples(0.1)
@given(seeds)
def test_fatrop_and_ipopt_and_a_warm_start_find_the_same_optimum(seed: int) -> None:
    rng = np.random.default_rng(seed)
    task = random_task(rng)
    first = solver_of(FLIGHT).solve(task, task.hold())
    again = solver_of(FLIGHT).solve(task, first.trajectory)
    spread = task.stake
    assert again.objective == pytest.approx(first.objective, abs=1e-3 * spread)
    other = TrajectorySolver(solver="ipopt", flown=True).solve(task, first.trajectory)
    assert other.status is SolveStatus.OPTIMAL
    assert other.objective == pytest.approx(first.objective, abs=1e-3 * spread)


@pytest.mark.parametrize(
    ("start", "goal"),
    [
        ([10, 1.0, 1.2], [10, 2.0, 0.9]),
        ([10, 0.3, 1.2], [10, 2 * np.pi - 0.5, 1.2]),  # across azimuth 0
        ([10, 2 * np.pi - 0.3, 1.2], [10, 0.5, 1.2]),
        ([10, 2.0, 0.8], [10, 2.0, 0.0]),  # to the pole
        ([10, 2.0, 0.5], [10, 2.0 + np.pi, 0.7]),  # over the pole, or round it
        ([10, 1.0, 1.2], [10, 1.0, np.pi / 2]),  # to the edge of the workspace
    ],
)
@pytest.mark.parametrize("limits", [FLIGHT, GRID])
def test_a_plan_heads_for_the_only_peak_and_ends_there(start: list, goal: list, limits: TrajectoryLimits) -> None:
    goal = np.array(goal)
    task = random_task(
        np.random.default_rng(0),
        position=np.array(start),
        field_weights=peak_at(goal),
        limits=limits,
        node_time=0.3 if limits.vehicle is None else 0.8,
    )
    solution = solver_of(limits).solve_best(task, PAPER.sample_starts(np.random.default_rng(1), 16))
    assert solution.status is SolveStatus.OPTIMAL
    nodes = cartesian(solution.trajectory.position)
    cosine = nodes @ cartesian(goal) / np.linalg.norm(nodes, axis=1) / np.linalg.norm(cartesian(goal))
    angle = np.arccos(np.clip(cosine, -1, 1))
    assert angle[-1] < 0.02
    arrived = int(np.argmax(angle < 0.1))
    over_the_pole = start[2] == 0.5  # where a detour may pay: a turn costs the same everywhere, or nothing
    assert (np.diff(angle[: arrived + 1]) <= (0.2 if over_the_pole else 2e-3)).all()  # at the pole it turns on the spot
    assert (angle[arrived:] < 0.1).all()


def test_a_distance_that_is_best_is_gone_to() -> None:
    weights = np.zeros(BASIS_SIZE)
    weights[16:18] = 0.8, -1  # 0.8 s - s^2 is highest at s = 0.4, 12 m
    field, start = at_all_nodes(weights), np.array([6.0, 1, 1])
    task = random_task(np.random.default_rng(0), position=start, field_weights=field, node_time=0.5)
    position = solver_of(FLIGHT).solve(task, task.hold()).trajectory.position
    assert position[-1, 0] == pytest.approx(12, abs=0.05)
    assert (np.diff(position[: int(np.argmax(position[:, 0] > 11.5)) + 1, 0]) > 0).all()
    np.testing.assert_allclose(position[:, 1:], np.ones((HORIZON + 1, 2)), atol=0.2)


@pytest.mark.parametrize("changes", [{"field_weights": np.zeros((HORIZON, BASIS_SIZE))}, {"effort_weight": 1e9}])
@pytest.mark.parametrize("limits", [FLIGHT, GRID])
def test_where_nothing_is_to_win_the_camera_stays(changes: dict, limits: TrajectoryLimits) -> None:
    rng = np.random.default_rng(0)
    task = random_task(rng, limits=limits, **changes)
    solution = solver_of(limits).solve_best(task, PAPER.sample_starts(rng, 4))
    assert solution.status is SolveStatus.OPTIMAL
    np.testing.assert_allclose(solution.trajectory.position, task.hold().position, atol=1e-12)


def test_more_seeds_never_collect_less() -> None:
    rng = np.random.default_rng(2)
    many = TrajectorySolver(seeds=4)
    for _ in range(5):
        task, goals = random_task(rng, limits=GRID, node_time=0.16), PAPER.sample_starts(rng, 16)
        assert many.solve_best(task, goals).objective >= solver_of(GRID).solve_best(task, goals).objective - 1e-9


def test_a_first_flight_is_solved_from_its_best_guess_alone_and_a_first_plan_on_the_grid_from_every_one() -> None:
    rng = np.random.default_rng(3)
    goals = PAPER.sample_starts(rng, 16)
    for limits, solves in ((FLIGHT, 1), (GRID, 2)):
        solver = TrajectorySolver(flown=limits.vehicle is not None)
        task = random_task(rng, limits=limits, node_time=0.4)
        solution = solver.solve_best(task, goals)
        assert solution.status is SolveStatus.OPTIMAL
        assert len(solver.statistics.solve_seconds) == solves
        assert solution.objective >= task.objective(best_guesses(goals, task, 1, task.objective)[0])


@pytest.mark.parametrize("name", ["field_weights", "gain_weights"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_field_that_is_not_finite_holds_the_viewpoint_and_says_so(name: str, bad: float) -> None:
    task = random_task(np.random.default_rng(0), velocity=np.full(3, 0.1))
    getattr(task, name)[3] = bad
    solver = TrajectorySolver(flown=True)
    solution = solver.solve_best(task, PAPER.sample_starts(np.random.default_rng(0), 4))
    assert solution.status == "nan-field" and solution.held
    np.testing.assert_array_equal(solution.trajectory.position, task.hold().position)
    assert solver.statistics.counts == {SolveStatus.NAN_FIELD: 1} and solver.statistics.fallbacks == 1


@pytest.mark.parametrize(
    "changes",
    [
        {"position": np.array([4.0, 0, 1])},  # outside
        {"position": np.array([10.0, np.nan, 1])},
        {"position": np.array([14.9, 0, 1]), "velocity": np.array([5.0, 0, 0])},  # nothing stops it in time
    ],
)
@pytest.mark.parametrize("max_iterations", [None, 6])
def test_a_start_without_a_way_within_the_limits_holds_the_viewpoint_and_says_so(
    changes: dict, max_iterations: int | None, capfd: pytest.CaptureFixture[str]
) -> None:
    task = random_task(np.random.default_rng(0), **changes)
    solver = TrajectorySolver(max_iterations=max_iterations, flown=True)
    solution = solver.solve(task, task.hold())
    assert solution.status == "infeasible" and solution.held
    np.testing.assert_array_equal(solution.trajectory.position, task.hold().position)
    assert solver.statistics.fallbacks == 1
    assert capfd.readouterr().out == ""  # neither solver prints


def test_after_a_held_viewpoint_planning_goes_on() -> None:
    rng = np.random.default_rng(0)
    task, goals = random_task(rng), PAPER.sample_starts(rng, 8)
    held = solver_of(FLIGHT).solve_best(replace(task, field_weights=np.full((HORIZON, BASIS_SIZE), np.nan)), goals)
    assert solver_of(FLIGHT).solve_best(task, goals, held, task.node_time).status is SolveStatus.OPTIMAL


def test_what_no_solver_finished_is_a_fallback_if_it_keeps_the_limits() -> None:
    solver = TrajectorySolver(flown=True)
    task = random_task(np.random.default_rng(0))
    solver._solvers, solver._fallback = [solver._build("fatrop", 1)], None
    found = {solver.solve(task, task.hold()).status}
    for iterations in range(2, 8):
        solver._solvers = [solver._build("fatrop", iterations)]
        found.add(solver.solve(task, task.hold()).status)
    assert "unconverged" in found and "capped" not in found
    counts = solver.statistics.counts
    assert solver.statistics.fallbacks == counts["unconverged"] + counts["infeasible"]


def test_ipopt_takes_over_where_fatrop_fails() -> None:
    solver = TrajectorySolver(flown=True)
    task = random_task(np.random.default_rng(0))
    solver._solvers = [solver._build("fatrop", 1)]  # one that cannot converge
    solution = solver.solve(task, task.hold())
    assert solution.status == "ipopt-fallback" and not solution.held
    assert solution.violation <= TOLERANCE
    assert solution.objective == pytest.approx(solver_of(FLIGHT).solve(task, task.hold()).objective, rel=1e-3)
    assert solver.statistics.fallbacks == 1 and len(solver.statistics.solve_seconds) == 2


def test_a_solve_that_gets_no_nearer_ends_and_is_no_fallback(monkeypatch: pytest.MonkeyPatch) -> None:
    """As at a kink of the objective, where the tolerance is never reached: here, because it cannot be."""
    task = random_task(np.random.default_rng(0))
    usual = TrajectorySolver(flown=True).solve(task, task.hold())
    monkeypatch.setattr(solver_module, "OPTIMALITY", 1e-18)
    solver = TrajectorySolver(flown=True)
    solution = solver.solve(task, task.hold())
    assert solution.status is SolveStatus.OPTIMAL and solution.violation <= TOLERANCE
    assert solution.objective == pytest.approx(usual.objective, rel=1e-3)
    assert solver._solvers[0].stats()["iter_count"] < ITERATIONS / 2
    monkeypatch.setattr(solver_module, "NO_NEARER", 10 * ITERATIONS)
    assert TrajectorySolver(flown=True).solve(task, task.hold()).status is not SolveStatus.OPTIMAL


def test_exact_second_derivatives_take_over_where_quick_ones_fail() -> None:
    solver = TrajectorySolver(flown=True)
    task = random_task(np.random.default_rng(0))
    solver._solvers[0] = solver._build("fatrop", 2, {"nlp_hess_l": solver._problem.quick_hessian})
    solution = solver.solve(task, task.hold())
    assert solution.status is SolveStatus.OPTIMAL and solution.violation <= TOLERANCE
    assert solver.statistics.fallbacks == 0


def test_plans_by_quick_second_derivatives_collect_as_much() -> None:
    exact, found = TrajectorySolver(flown=True), []
    del exact._solvers[0]
    for seed in range(20):
        task = random_task(np.random.default_rng(seed))
        quick, slow = (solver.solve(task, task.hold()) for solver in (solver_of(FLIGHT), exact))
        assert quick.objective > slow.objective - 0.02 * task.stake
        found.append((quick.objective - slow.objective) / task.stake)
    assert abs(np.median(found)) < 1e-4


@pytest.mark.parametrize(
    ("position", "velocity", "acceleration"),
    [
        ([5.013, 0.1478, 0.8115], [-0.109, 0.1915, 0.1342], [0.5285, 0.0349, -0.5316]),
        ([5.0541, 0.2485, 0.7721], [-0.3909, 0.4216, 0.0189], [1.6727, -0.4883, 0.0849]),
    ],
)
def test_a_camera_that_brakes_just_before_a_bound_has_a_plan(
    position: list[float], velocity: list[float], acceleration: list[float]
) -> None:
    """Two states of flights between the nodes of a plan, whose next control points are given; flights check anew."""
    state = {"position": position, "velocity": velocity, "acceleration": acceleration}
    given = {name: np.array(values) for name, values in state.items()}
    task = random_task(np.random.default_rng(0), node_time=0.4, **given)
    solution = solver_of(FLIGHT).solve(task, task.hold())
    assert solution.status is SolveStatus.OPTIMAL
    flown = states_at(solution.trajectory, np.linspace(0, 6, 1201), 0.4)[0]
    assert flown[:, 0].min() > 5.0 - 1e-3


def test_a_task_of_another_horizon_is_refused() -> None:
    with pytest.raises(UsageError, match="expected 15 gain weights, got 3"):
        solver_of(FLIGHT).solve_best(random_task(np.random.default_rng(0), horizon=3), np.array([[10.0, 0, 1]]))


@pytest.mark.parametrize(("made_for", "limits", "expected"), [(FLIGHT, GRID, "a vehicle"), (GRID, FLIGHT, "the grid")])
def test_a_task_of_another_track_is_refused(
    made_for: TrajectoryLimits, limits: TrajectoryLimits, expected: str
) -> None:
    with pytest.raises(UsageError, match=f"expected limits of {expected}"):
        solver_of(made_for).solve_best(random_task(np.random.default_rng(0), limits=limits), np.array([[10.0, 0, 1]]))
