"""Flight: limits at 1 kHz, targets reached, smoothness, and what it does not fly.

All 100,000 cases: `pytest -m slow tests/ehar/flight/test_motion.py`.
"""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.arrays import FloatArray
from ehar.errors import EpisodeError
from ehar.flight.kinematics import SphericalState
from ehar.flight.motion import FlightMotion
from ehar.flight.profile import JerkProfile
from ehar.flight.proposals import limits_to_rest
from ehar.flight.time_optimal import TimeOptimal
from ehar.flight.vehicle import VEHICLES, Vehicle
from ehar.viewpoint import AZIMUTH, Workspace, cartesian, wrap_difference
from ehar.world import INDOOR, PAPER, World
from tests.helpers.examples import share_of_examples
from tests.helpers.flight_cases import random_vehicle, random_viewpoints, worst_excess

FRAME_TIME = 0.04
LEVEL = np.pi / 2
STRAIGHT_ABOVE = 0.0


def flying(
    start: FloatArray, vehicle: Vehicle = VEHICLES["px4-auto"], *, frame_time: float = FRAME_TIME
) -> FlightMotion:
    motion = FlightMotion(vehicle=vehicle)
    motion.reset(start, frame_time)
    return motion


def off(viewpoint: FloatArray, target: FloatArray) -> FloatArray:
    """Return how far viewpoints are from targets on the worst axis, (B,)."""
    difference = viewpoint - target
    difference[:, AZIMUTH] = wrap_difference(difference[:, AZIMUTH])
    return np.abs(difference).max(axis=1)


def frames_to(motion: FlightMotion, target: FloatArray, *, at_most: int) -> int:
    """Hold the targets until they are reached, and return the number of frames."""
    for frame in range(at_most):
        if (off(motion.advance(target), target) < 1e-6).all():
            return frame + 1
    raise AssertionError(f"not reached within {at_most} frames")


@share_of_examples(0.04)
@given(st.integers(0, 10_000), st.sampled_from([PAPER, INDOOR]))
def test_any_vehicle_keeps_its_limits_at_1_khz(seed: int, world: World) -> None:
    excess = worst_excess(np.random.default_rng(seed), 2_000, workspace=world.workspace)
    assert excess.limits < 1e-6
    assert excess.workspace < 1e-9


@pytest.mark.parametrize("world", [PAPER, INDOOR], ids=str)
def test_the_ground_robot_keeps_its_limits_in_every_world(world: World) -> None:
    robot = VEHICLES["ground-robot"]
    excess = worst_excess(np.random.default_rng(0), 2_000, workspace=world.workspace, draw_vehicle=lambda _: robot)
    assert excess.limits < 1e-6
    assert excess.workspace < 1e-9


@pytest.mark.slow
def test_limits_hold_at_1_khz_in_100_000_cases() -> None:
    excess = worst_excess(np.random.default_rng(1), 100_000)
    assert excess.cases >= 100_000
    assert excess.limits < 1e-6
    assert excess.workspace < 1e-9


@pytest.mark.parametrize("name", VEHICLES)
def test_a_target_that_is_held_is_reached_and_kept(name: str) -> None:
    rng = np.random.default_rng(0)
    world = INDOOR if name == "ground-robot" else PAPER
    start, before, target = (world.sample_starts(rng, 16) for _ in range(3))
    motion = FlightMotion(vehicle=VEHICLES[name], workspace=world.workspace)
    motion.reset(start, 0.04)
    for _ in range(30):
        motion.advance(before)
    frames_to(motion, target, at_most=1500)
    for _ in range(3):
        assert (off(motion.advance(target), target) < 1e-6).all()
    assert not motion.velocity.any() and not motion.acceleration.any()


def test_any_vehicle_reaches_what_lies_on_the_bounds() -> None:
    rng = np.random.default_rng(3)
    for _ in range(3):
        vehicle = random_vehicle(rng)
        start, target = (random_viewpoints(rng, 10, Workspace()) for _ in range(2))
        frames_to(flying(start, vehicle, frame_time=0.2), target, at_most=1000)


@pytest.mark.parametrize(
    ("start", "target"),
    [
        ((8, 0.0, STRAIGHT_ABOVE), (8, 2.0, 1.0)),
        ((8, 2.0, 1.0), (8, 0.0, STRAIGHT_ABOVE)),
        ((8, 0.0, STRAIGHT_ABOVE), (8, 3.0, STRAIGHT_ABOVE)),
        ((5, 0.1, LEVEL), (5, 2 * np.pi - 0.1, LEVEL)),
        ((5, 0.0, LEVEL), (5, np.pi, LEVEL)),
        ((15, 0.0, STRAIGHT_ABOVE), (5, 0.0, LEVEL)),
        ((5, 1.0, 0.5), (5, 1.0, 0.5)),
        ((5, 1.0, 0.5), (5 + 1e-4, 1.0, 0.5)),
    ],
)
def test_special_places(start: tuple[float, float, float], target: tuple[float, float, float]) -> None:
    frames_to(flying(np.array([start])), np.array([target]), at_most=500)


def test_azimuths_go_the_short_way_round() -> None:
    motion = flying(np.array([[6.0, 0.2, LEVEL]]))
    azimuths = [motion.advance(np.array([[6.0, 2 * np.pi - 0.2, LEVEL]]))[0, AZIMUTH] for _ in range(200)]
    assert np.abs(wrap_difference(np.array(azimuths))).max() <= 0.2 + 1e-9
    assert all(0 <= azimuth < 2 * np.pi for azimuth in azimuths)


def test_a_target_outside_of_the_workspace_is_flown_to_its_edge() -> None:
    motion = flying(np.array([[6.0, 0.2, 1.0]]))
    frames_to_edge = [motion.advance(np.array([[99.0, 0.2, 1.0]])) for _ in range(400)]
    assert frames_to_edge[-1][0] == pytest.approx([15.0, 0.2, 1.0])


def test_frames_join_smoothly() -> None:
    """Position, velocity and acceleration go on where they were; jerk alone may step. Targets jump in each frame."""
    rng = np.random.default_rng(0)
    motion = flying(PAPER.sample_starts(rng, 8), VEHICLES["tracking-drone"])
    motion.advance(PAPER.sample_starts(rng, 8))
    for _ in range(40):
        before = motion.sample(np.array([FRAME_TIME]))
        viewpoint = motion.advance(PAPER.sample_starts(rng, 8))
        after = motion.sample(np.array([0.0, FRAME_TIME]))
        for one, other in zip(before[:3], after[:3], strict=True):
            np.testing.assert_allclose(one[:, 0], other[:, 0], atol=1e-9)
        np.testing.assert_array_equal(motion.velocity, after.velocity[:, 1])
        np.testing.assert_array_equal(motion.acceleration, after.acceleration[:, 1])
        assert (off(viewpoint, after.viewpoint[:, 1]) < 1e-12).all()


def test_a_radial_flight_takes_hardly_longer_than_one_in_a_straight_line_can() -> None:
    """6 m along a ray, level, by px4-auto: d / v' + v' / a + a / j is reached by no camera; 25 % more by ours."""
    motion = flying(np.array([[6.0, 1.0, LEVEL]]))
    frames = frames_to(motion, np.array([[12.0, 1.0, LEVEL]]), at_most=200)
    # Speed 5 is not reached over 6 m: v' / a + a / j = 6 / v'.
    speed = (-3 / 4 + np.sqrt((3 / 4) ** 2 + 4 * 6 / 3)) / 2 * 3
    bound = 6 / speed + speed / 3 + 3 / 4
    assert bound - FRAME_TIME <= frames * FRAME_TIME < 1.25 * bound


def test_a_new_target_is_reached_sooner_than_by_stopping_first() -> None:
    rng = np.random.default_rng(0)
    start, first, then = (PAPER.sample_starts(rng, 24) for _ in range(3))
    motion = flying(start)
    for _ in range(50):
        motion.advance(first)
    rest, stopping = stop(motion)
    turning, again = arrivals(motion, then), arrivals(flying(rest), then)
    assert turning.mean() < 0.95 * (again + stopping).mean()


def stop(motion: FlightMotion) -> tuple[FloatArray, FloatArray]:
    """Return where a camera stops that brakes as soon as it may at 60 % of its limits, and after how many frames."""
    state = motion.sample(np.array([FRAME_TIME]))
    state = SphericalState(*(part[:, 0] for part in state))
    phases, _ = TimeOptimal().to_rest(state, limits_to_rest(motion.vehicle, state).select(1))
    braking = JerkProfile.from_phases(state, phases)
    return motion.workspace.clip(braking.end.viewpoint), np.floor(braking.duration / FRAME_TIME)


def arrivals(motion: FlightMotion, target: FloatArray) -> FloatArray:
    """Hold the targets and return after how many frames each is reached, (B,)."""
    reached = np.array([off(motion.advance(target), target) < 1e-6 for _ in range(600)])
    assert reached[-1].all()
    return np.argmax(reached, axis=0) + 1.0


def test_flights_do_not_depend_on_their_neighbours() -> None:
    rng = np.random.default_rng(0)
    start, targets = PAPER.sample_starts(rng, 5), [PAPER.sample_starts(rng, 5) for _ in range(12)]
    together, alone = flying(start), flying(start[3:4])
    for target in targets:
        np.testing.assert_allclose(together.advance(target)[3:4], alone.advance(target[3:4]), atol=1e-12)


def test_a_copy_flies_on_alike() -> None:
    """So that environments and motions can be sent to worker processes."""
    rng = np.random.default_rng(0)
    motion, target = flying(PAPER.sample_starts(rng, 4)), PAPER.sample_starts(rng, 4)
    motion.advance(target)
    copied = pickle.loads(pickle.dumps(motion))
    for _ in range(5):
        np.testing.assert_array_equal(motion.advance(target), copied.advance(target))


def test_forks_fly_what_the_camera_would() -> None:
    """Forked in the middle of a flight: the first path of each camera is what it flies, the second is another."""
    rng = np.random.default_rng(0)
    motion, targets = flying(PAPER.sample_starts(rng, 4)), [PAPER.sample_starts(rng, 4) for _ in range(6)]
    for _ in range(8):
        motion.advance(targets[0])
    fork, before = motion.forked(2), motion.telemetry
    for _ in range(10):
        goals = np.stack([targets[1], targets[2]], axis=1)
        tried = fork.advance(goals.reshape(-1, 3)).reshape(goals.shape)
    assert motion.telemetry is before, "a fork should not move the camera"
    for _ in range(10):
        flown = motion.advance(targets[1])
    np.testing.assert_allclose(tried[:, 0], flown, atol=1e-12)
    assert np.abs(tried[:, 1] - flown).max(axis=1).min() > 1e-3
    with pytest.raises(EpisodeError, match="'px4-auto': expected one that is measured, got a fork"):
        fork.telemetry  # noqa: B018


def test_telemetry_adds_up() -> None:
    rng = np.random.default_rng(0)
    vehicle, start = VEHICLES["tracking-drone"], PAPER.sample_starts(rng, 6)
    motion = flying(start, vehicle)
    assert motion.telemetry.frames == 0
    assert not motion.telemetry.share_at_limit.any()
    positions = [cartesian(start)[:, None]]
    for frame in range(50):
        motion.advance(PAPER.sample_starts(np.random.default_rng(frame // 10), 6))
        states = motion.sample(np.linspace(0, FRAME_TIME, 41)[1:])
        positions.append(cartesian(states.viewpoint))
    position = np.concatenate(positions, axis=1)
    velocity = np.diff(position, axis=1) / 1e-3
    acceleration = np.diff(velocity, axis=1) / 1e-3
    jerk = np.diff(acceleration, axis=1) / 1e-3
    telemetry = motion.telemetry
    assert telemetry.frames == 50
    for peak, vector, tolerance in (
        (telemetry.peak_speed, velocity, 1e-3),
        (telemetry.peak_acceleration, acceleration, 1e-2),
        (telemetry.peak_jerk, jerk, 1e-2),
    ):
        np.testing.assert_allclose(np.linalg.norm(vector, axis=-1).max(axis=1), peak, rtol=tolerance)
    np.testing.assert_allclose((acceleration**2).sum(axis=(1, 2)) * 1e-3, telemetry.effort, rtol=1e-2)
    assert ((telemetry.share_at_limit >= 0) & (telemetry.share_at_limit <= 1)).all()
    assert vehicle.body is not None and telemetry.costs is not None and telemetry.costs.energy is not None
    way = np.linalg.norm(np.diff(position, axis=1), axis=-1).sum(axis=1)
    np.testing.assert_allclose(way, telemetry.costs.distance, rtol=1e-5)
    changing = (list(np.moveaxis(part, -1, 0)) for part in (velocity[:, 1:], acceleration))
    power, _ = vehicle.body.demands(*changing, np)
    np.testing.assert_allclose(1e-3 * power.sum(axis=1), telemetry.costs.energy, rtol=1e-2)
    assert (telemetry.peak_speed <= vehicle.speed).all()


def test_a_long_turn_is_at_its_limit() -> None:
    slow = Vehicle(name="slow", speed=1, acceleration=3, jerk=9, climb_speed=3, descent_speed=3, yaw_rate=1)
    motion = flying(np.array([[10.0, 0.0, LEVEL]]), slow)
    for _ in range(200):
        motion.advance(np.array([[10.0, 1.5, LEVEL]]))
    assert motion.telemetry.share_at_limit > 0.7
    assert motion.telemetry.peak_speed == pytest.approx(0.994, abs=1e-3)


@pytest.mark.parametrize("start", [(4.9, 0, 1), (15.1, 0, 1), (8, 0, -0.1), (8, 0, 1.6), (np.nan, 0, 1)])
def test_a_start_outside_of_the_workspace(start: tuple[float, float, float]) -> None:
    starts = np.array([(8.0, 0.0, 1.0), start])
    with pytest.raises(EpisodeError, match=r"flight of 'px4-auto', episode 1: expected a start within 5 to 15 m"):
        flying(starts)


@pytest.mark.parametrize("frame_time", [0.0, -0.04, np.nan, np.inf])
def test_a_frame_time_that_is_none(frame_time: float) -> None:
    motion = FlightMotion(vehicle=VEHICLES["px4-auto"])
    with pytest.raises(EpisodeError, match="expected a positive, finite frame time, got"):
        motion.reset(np.array([[8.0, 0.0, 1.0]]), frame_time)
