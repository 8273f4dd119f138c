"""Guesses: smooth ways to goals, and a plan moved on in time."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ehar.viewpoint import wrap_difference
from ehar.world import PAPER
from planners.search.guess import at_rest_at_the_end, best_guesses, moved_on, trajectories_to, trajectory_along
from planners.search.task import TrajectoryLimits
from tests.helpers.trajectory_tasks import FLIGHT, GRID, random_task

seeds = st.integers(0, 10_000)


@given(seeds, st.sampled_from([FLIGHT, GRID]))
def test_a_way_starts_as_the_camera_moves_and_ends_at_rest_at_the_goal(seed: int, limits: TrajectoryLimits) -> None:
    rng = np.random.default_rng(seed)
    task = random_task(rng, limits=limits, node_time=2.0, velocity=rng.uniform(-0.1, 0.1, 3), acceleration=np.ones(3))
    goals = PAPER.sample_starts(rng, 5)
    guess = trajectories_to(goals, task)
    np.testing.assert_allclose(guess.position[:, 0], np.tile(task.position, (5, 1)), atol=1e-9)
    np.testing.assert_allclose(guess.velocity[:, 0], np.tile(task.velocity, (5, 1)), atol=1e-9)
    np.testing.assert_allclose(guess.acceleration[:, 0], 1, atol=1e-9)
    error = guess.position[:, -1] - goals
    error[:, 1] = wrap_difference(error[:, 1])
    np.testing.assert_allclose(error, 0, atol=1e-6)
    np.testing.assert_allclose(guess.velocity[:, -1], 0, atol=1e-6)
    assert task.workspace.contains(guess.position).all()


@given(seeds, st.sampled_from([FLIGHT, GRID]))
def test_from_rest_a_way_keeps_the_limits_and_is_the_short_way_round(seed: int, limits: TrajectoryLimits) -> None:
    rng = np.random.default_rng(seed)
    task = random_task(rng, limits=limits)
    guess = trajectories_to(PAPER.sample_starts(rng, 5), task)
    assert (np.abs(guess.position[..., 1] - task.position[1]) <= np.pi + 1e-9).all()
    assert (np.abs(guess.velocity) <= limits.velocity + 1e-9).all()
    assert (np.abs(guess.acceleration) <= limits.acceleration + 1e-9).all()
    assert (np.abs(guess.jerk) <= limits.jerk + 1e-9).all()


def test_a_trajectory_along_a_way_is_where_the_way_is_and_rests_at_its_end() -> None:
    task = random_task(np.random.default_rng(0), limits=GRID, node_time=0.2)
    task = replace(task, position=np.array([8.0, 6.2, 1.1]))
    places = np.array([[7.0, 0.0, 1.2], [6.0, 0.3, 1.2]])  # at 1 s and at 2 s; the short way leads across 2 pi
    along = trajectory_along(places, np.array([1.0, 2.0]), task)
    np.testing.assert_array_equal(along.position[0], task.position)
    np.testing.assert_allclose(along.position[5], [7.0, 2 * np.pi, 1.2])
    np.testing.assert_allclose(along.position[10:], np.tile([6.0, 2 * np.pi + 0.3, 1.2], (6, 1)))
    np.testing.assert_allclose(along.velocity[7], [-1.0, 0.3, 0.0], atol=1e-9)
    assert not along.velocity[-1].any() and not along.acceleration[-1].any()


@given(seeds)
def test_goals_are_left_as_they_were_and_the_best_guesses_come_first(seed: int) -> None:
    rng = np.random.default_rng(seed)
    task, goals = random_task(rng), PAPER.sample_starts(rng, 6)
    before = goals.copy()
    worth = [float(task.objective(guess)) for guess in best_guesses(goals, task, 6, task.objective)]
    assert worth == sorted(worth, reverse=True)
    assert float(task.objective(best_guesses(goals, task, 1, task.objective)[0])) == worth[0]
    np.testing.assert_array_equal(goals, before)


@given(seeds, st.floats(0, 2))
def test_a_plan_moved_on_is_the_plan_seen_later(seed: int, elapsed: float) -> None:
    rng = np.random.default_rng(seed)
    task = random_task(rng, node_time=0.25, velocity=rng.normal(size=3), acceleration=rng.normal(size=3))
    jerk = rng.normal(size=(task.horizon, 3))
    times = np.arange(task.horizon + 1) * task.node_time

    def at(time: float) -> np.ndarray:
        """Return position, velocity and acceleration (3, 3), by adding up what each node's jerk contributes."""
        state = np.array([task.position, task.velocity, task.acceleration])
        before = np.clip(time - times[:-1], 0, None)
        after = np.clip(time - times[1:], 0, None)
        p, v, a = state
        return np.array(
            [
                p + v * time + a * time**2 / 2 + ((before**3 - after**3)[:, None] / 6 * jerk).sum(0),
                v + a * time + ((before**2 - after**2)[:, None] / 2 * jerk).sum(0),
                a + ((before - after)[:, None] * jerk).sum(0),
            ]
        )

    plan = task.hold()._replace(jerk=jerk)
    for part, name in enumerate(("position", "velocity", "acceleration")):
        plan = plan._replace(**{name: np.array([at(time)[part] for time in times])})
    # The camera reports its azimuth wrapped, whichever turn the plan is on.
    here = at(elapsed)[0] + np.array([0, 2 * np.pi * rng.integers(-2, 3), 0])
    later = moved_on(plan, elapsed, random_task(rng, node_time=0.25, position=here))
    np.testing.assert_allclose(later.position[0], here, atol=1e-8)
    flying = times + elapsed < times[-1] - 1e-6
    for part, name in enumerate(("position", "velocity", "acceleration")):
        expected = np.array([at(time + elapsed)[part] for time in times[flying]])
        if part == 0:
            expected[:, 1] += here[1] - at(elapsed)[0][1]
        np.testing.assert_allclose(getattr(later, name)[flying], expected, atol=1e-8)
    ended = times + elapsed > times[-1] + 1e-6
    assert not later.velocity[ended].any()
    assert not np.diff(later.position[ended], axis=0).any()


@given(seeds, st.integers(2, 20))
def test_what_is_brought_to_rest_is_a_motion_and_nearest_to_what_it_was(seed: int, horizon: int) -> None:
    rng = np.random.default_rng(seed)
    task = random_task(rng, horizon=horizon, velocity=rng.normal(size=3), acceleration=rng.normal(size=3))
    wanted = task.hold()._replace(jerk=rng.normal(size=(horizon, 3)))
    p, v, a, j = plan = at_rest_at_the_end(wanted, task)
    time = task.node_time
    np.testing.assert_allclose([p[0], v[0], a[0]], [task.position, task.velocity, task.acceleration])
    np.testing.assert_allclose(p[1:], p[:-1] + time * v[:-1] + time**2 / 2 * a[:-1] + time**3 / 6 * j, atol=1e-9)
    np.testing.assert_allclose(v[1:], v[:-1] + time * a[:-1] + time**2 / 2 * j, atol=1e-9)
    np.testing.assert_allclose(a[1:], a[:-1] + time * j, atol=1e-9)
    np.testing.assert_allclose([v[-1], a[-1]], 0, atol=1e-9)
    again = at_rest_at_the_end(plan, task)
    np.testing.assert_allclose(again.jerk, j, atol=1e-9)  # nothing is changed that need not be
    # The change is a line over time on every axis: of all changes with the same two effects, the smallest.
    change = j - wanted.jerk
    np.testing.assert_allclose(np.diff(change, 2, axis=0), 0, atol=1e-7 * np.abs(change).max())
