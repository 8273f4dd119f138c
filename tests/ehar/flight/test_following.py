"""Paths: a camera flies them exactly where it can, comes back to them, and keeps its limits where it cannot."""

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.flight.limits import limit_shares
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion, heading, move
from ehar.steps import StepLimits, from_rest
from ehar.viewpoint import Workspace, cartesian

TIME = 0.04
PX4 = VEHICLES["px4-auto"]
START = np.array([[9.0, 6.2, 1.1], [12.0, 0.1, 0.5]])
FRAMES = 100
WAY = np.array([[1.0, 0.3, -0.2], [-0.8, -0.2, 0.1]])  # the azimuth of the first crosses 0


def path_to(way: FloatArray) -> FloatArray:
    """Return paths (B, F, 3, 3) from rest at the starts to rest `way` from there; the jerk steps every second."""
    position = velocity = acceleration = 0.0
    states = []
    for jerk in np.repeat([1.0, -1.0, -1.0, 1.0], FRAMES // 4):
        position += TIME * (velocity + TIME * (acceleration / 2 + TIME / 6 * jerk))
        velocity += TIME * (acceleration + TIME / 2 * jerk)
        acceleration += TIME * jerk
        states.append((position, velocity, acceleration))
    path = (np.array(states) / position)[None, :, :, None] * way[:, None, None]
    path[:, :, 0] += START[:, None]
    path[:, -1, 1:] = 0
    return path


def flying(start: FloatArray = START) -> FlightMotion:
    motion = FlightMotion(vehicle=PX4)
    motion.reset(start, TIME)
    return motion


def test_a_path_within_the_limits_is_flown_exactly() -> None:
    path, motion = path_to(WAY), flying()
    for frame in range(FRAMES):
        viewpoint = motion.follow(path[:, frame:])
        np.testing.assert_allclose(cartesian(viewpoint), cartesian(path[:, frame, 0]), atol=1e-6)
        np.testing.assert_allclose(motion.velocity, path[:, frame, 1], atol=1e-6)
    assert motion.telemetry.tracking_error.shape == (2, FRAMES)
    assert motion.telemetry.tracking_error.max() < 1e-6
    assert not motion.velocity.any()


def test_one_state_at_a_time_will_do() -> None:
    path, motion = path_to(WAY), flying()
    for frame in range(FRAMES):
        motion.follow(path[:, frame : frame + 1])
    assert np.median(motion.telemetry.tracking_error) < 1e-3
    assert motion.telemetry.tracking_error.max() < 0.05


def test_a_camera_off_its_path_comes_back_to_it() -> None:
    path, motion = path_to(WAY), flying(START + np.array([0.02, 0.0, 0.002]))
    for frame in range(FRAMES):
        motion.follow(path[:, frame:])
    assert motion.telemetry.tracking_error[:, 0].min() > 0.01
    assert motion.telemetry.tracking_error[:, 90:].max() < 1e-4


@pytest.mark.parametrize("faster", [2.0, 30.0])
def test_a_path_that_nothing_can_fly_breaks_no_limit(faster: float) -> None:
    rng, motion = np.random.default_rng(0), flying()
    path = path_to(faster * np.array([[3.0, 2.0, -0.8], [-5.0, -2.0, 0.9]]))
    times = np.linspace(0, TIME, 41)
    for frame in range(30):
        noise = rng.normal(0, 0.3, path[:, frame:].shape) * (frame % 3 == 0)
        viewpoint = motion.follow(path[:, frame:] + noise)
        assert limit_shares(PX4, motion.sample(times)).max() <= 1
        assert Workspace().contains(viewpoint).all()
    target = np.array([[8.0, 1.0, 1.0], [7.0, 2.0, 0.5]])
    for _ in range(250):
        viewpoint = motion.advance(target)
    np.testing.assert_allclose(viewpoint, target, atol=1e-6)


def test_the_end_of_a_path_that_is_a_little_too_fast_is_flown_to() -> None:
    """A planner who plans such a path again and again, from wherever the camera is, would else never get it away."""
    way, motion = np.array([[0.0, 0.8, 0.0], [-6.9, 0.0, 0.0]]), flying()
    path, times = path_to(way), np.linspace(0, TIME, 41)
    for frame in range(250):
        viewpoint = motion.follow(path[:, min(frame, FRAMES - 1) :])
        assert limit_shares(PX4, motion.sample(times)).max() <= 1
    assert motion.telemetry.tracking_error.max(axis=1).min() > 0.1, "the paths should be too fast"
    np.testing.assert_allclose(cartesian(viewpoint), cartesian(START + way), atol=1e-6)


def test_a_path_that_claims_an_end_to_which_it_does_not_lead_breaks_no_limit() -> None:
    path = path_to(WAY)[:, : FRAMES // 2]  # at its fastest
    path[:, -1, 1:] = 0  # and claimed to be at rest
    motion, way, times = flying(), [START], np.linspace(0, TIME, 41)
    for frame in range(120):
        way.append(motion.follow(path[:, min(frame, FRAMES // 2 - 1) :]))
        assert limit_shares(PX4, motion.sample(times)).max() <= 1
    assert StepLimits.of(motion, TIME).first_broken(from_rest(np.stack(way, axis=1)), 1e-9) is None


@pytest.mark.parametrize("other_at_rest", [True, False])
def test_rows_do_not_depend_on_each_other(other_at_rest: bool) -> None:
    path = path_to(np.array([[1.0, 0.3, -0.2], [-9.0, -2.0, 1.0]]))
    if not other_at_rest:  # the other's path ends at its fastest, this one's begins elsewhere
        path = np.stack([path_to(5 * WAY)[0, : FRAMES // 2], path_to(WAY / 2)[1, FRAMES // 2 :]])
    together, alone = flying(), flying(START[1:])
    for frame in range(FRAMES // 2):
        both, one = together.follow(path[:, frame:]), alone.follow(path[1:, frame:])
        np.testing.assert_allclose(both[1:], one, atol=1e-12)


def test_targets_leave_no_tracking_error() -> None:
    motion = flying()
    motion.advance(START)
    assert np.isnan(motion.telemetry.tracking_error).all()


def test_a_motion_that_follows_no_paths_heads_for_their_first_viewpoints() -> None:
    path = path_to(np.array([[6.0, 0.0, 0.0], [-6.0, 0.0, 0.0]]))
    grid, other = GridMotion(), GridMotion()
    cells = grid.workspace.from_cells(grid.workspace.to_cells(START))
    for motion in (grid, other):
        motion.reset(cells, TIME)
    np.testing.assert_array_equal(move(grid, path[:, 60:]), other.advance(path[:, 60, 0]))
    np.testing.assert_array_equal(heading(path), path[:, -1, 0])
    np.testing.assert_array_equal(heading(START), START)
