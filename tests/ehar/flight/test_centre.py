"""Following people in flight: limits in the world's frame, nothing from the future, and what is left for flights.

The long ones: `pytest -m slow tests/ehar/flight/test_centre.py`.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.flight.centre import KEEP_ON, SPEED_UP, around_centre, centre_limits, ways_ahead
from ehar.flight.kinematics import CartesianMotion, SphericalState
from ehar.flight.limits import limit_shares
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.localisation import CentreLimits, CentreMotion, Localisation, smoothed
from ehar.world import ROOM
from tests.helpers.examples import share_of_examples
from tests.helpers.flight_cases import worst_stream_excess

FPS = 25.0
PX4 = VEHICLES["px4-auto"]
seeds = st.integers(0, 10_000)


def walk(rng: np.random.Generator, frames: int, pace: float) -> np.ndarray:
    return np.cumsum(rng.normal(0, pace / FPS, (frames, 3)), axis=0)


@share_of_examples(0.3)
@given(seeds, st.floats(0.1, 50))
def test_the_centre_keeps_its_limits_and_its_jerk_leads_on(seed: int, pace: float) -> None:
    rng = np.random.default_rng(seed)
    speed, vertical, acceleration_limit, jerk_limit = np.exp(rng.uniform(-2, 2, 4)).tolist()
    limits = CentreLimits(speed=speed, vertical_speed=vertical, acceleration=acceleration_limit, jerk=jerk_limit)
    position, velocity, acceleration, jerk = smoothed(
        *Localisation().estimated(walk(rng, 60, pace), FPS, seed), 1 / FPS, limits
    )
    for vectors, most in ((velocity, limits.speed), (acceleration, limits.acceleration), (jerk, limits.jerk)):
        assert np.linalg.norm(vectors, axis=1).max() <= most * (1 + 1e-9)
    assert np.abs(velocity[:, 2]).max() <= limits.vertical_speed * (1 + 1e-9)
    time = 1 / FPS
    for vectors, change in (
        (position, time * (velocity + time * (acceleration / 2 + time / 6 * jerk))),
        (velocity, time * (acceleration + time / 2 * jerk)),
        (acceleration, time * jerk),
    ):
        np.testing.assert_allclose(vectors[1:], (vectors + change)[:-1], atol=1e-9)


def test_the_centre_goes_after_people_who_walk_on() -> None:
    walking = np.stack([1.2 / FPS * np.arange(500), np.zeros(500), np.zeros(500)], axis=1)
    centre = smoothed(*Localisation(noise=0.0).estimated(walking, FPS, 0), 1 / FPS, centre_limits(PX4)).position
    assert np.linalg.norm(centre - walking, axis=1).max() < 2.5
    assert np.linalg.norm(centre - walking, axis=1)[-1] < 0.1


def test_what_people_do_later_changes_nothing_before() -> None:
    rng = np.random.default_rng(0)
    one = walk(rng, 80, 1.0)
    other = one.copy()
    other[50:] += 5.0
    before, after = (
        smoothed(*Localisation().estimated(way, FPS, 3), 1 / FPS, centre_limits(PX4)) for way in (one, other)
    )
    late = 2  # frames of 0.1 s at 25 to a second, rounded
    for part, changed in zip(before, after, strict=True):
        np.testing.assert_array_equal(part[: 50 + late], changed[: 50 + late])
    assert not np.array_equal(before.position[60:], after.position[60:])


@pytest.mark.parametrize("name", VEHICLES)
def test_centre_and_flight_together_have_the_whole_limits(name: str) -> None:
    vehicle, left, centre = VEHICLES[name], around_centre(VEHICLES[name]), centre_limits(VEHICLES[name])
    for limit in ("speed", "acceleration", "jerk"):
        assert getattr(left, limit) + getattr(centre, limit) == pytest.approx(getattr(vehicle, limit))
    for limit in ("climb_speed", "descent_speed"):
        assert getattr(left, limit) + centre.vertical_speed <= getattr(vehicle, limit) * (1 + 1e-9)
    assert left.yaw_rate == vehicle.yaw_rate


def test_shares_in_the_world_by_hand() -> None:
    """Level at 10 m to the north, circling at 0.2 rad/s, which is to the west; the centre goes west at 1 m/s."""
    state = SphericalState(np.array([10, np.pi / 2, np.pi / 2]), np.array([0, 0.2, 0]), np.zeros(3), np.zeros(3))
    centre = CartesianMotion(np.array([-1.0, 0, 0]), np.array([0, 0.4, 0]), np.array([0, 0, 0.5]))
    shares = limit_shares(PX4, state, centre)
    assert shares[0] == pytest.approx((10 * 0.2 + 1) / 5)
    assert shares[1] == pytest.approx(abs(-10 * 0.2**2 + 0.4) / 3, abs=1e-12)
    assert shares[2] == pytest.approx(np.hypot(10 * 0.2**3, 0.5) / 4)


@share_of_examples(0.01)
@given(seeds, st.booleans())
def test_limits_hold_in_the_world_in_whole_streams(seed: int, paths: bool) -> None:
    excess = worst_stream_excess(np.random.default_rng(seed), 50, 40, paths=paths)
    assert excess.limits < 1e-6
    assert excess.workspace == 0


@pytest.mark.slow
@pytest.mark.parametrize(("streams", "frames"), [(960, 60), (40, 750)])
def test_limits_hold_in_the_world_in_1000_streams(streams: int, frames: int) -> None:
    """Most are short, as starts are hardest; the others last 30 s, as those of the benchmark do."""
    excess = worst_stream_excess(np.random.default_rng(1), streams, frames)
    assert excess.cases >= streams * frames
    assert excess.limits < 1e-6
    assert excess.workspace == 0


@pytest.mark.slow
def test_limits_hold_in_the_world_along_paths() -> None:
    excess = worst_stream_excess(np.random.default_rng(3), 100, 60, paths=True)
    assert excess.limits < 1e-6
    assert excess.workspace == 0


@pytest.mark.slow
@pytest.mark.parametrize("paths", [False, True])
def test_limits_hold_in_the_world_among_obstacles(paths: bool) -> None:
    """Whoever evades what people carry it towards keeps its limits too, off a path as well."""
    excess = worst_stream_excess(np.random.default_rng(2), 4, 20, ROOM.obstacles, flights=4, paths=paths)
    assert excess.limits < 1e-6
    assert excess.workspace == 0


def test_telemetry_counts_the_centre() -> None:
    still = np.array([[10.0, 0.0, 1.2]])
    motion = FlightMotion(vehicle=PX4, moving_centre=True)
    forwards = np.broadcast_to([1.5, 0.0, 0.0], (1, 10, 3))
    none = np.zeros((1, 10, 3))
    motion.centre = CentreMotion(none, forwards, none, none)
    motion.reset(still, 0.04)
    for _ in range(5):
        motion.advance(still)
    assert motion.telemetry.peak_speed == pytest.approx(1.5)
    costs = motion.telemetry.costs
    assert costs is not None and PX4.body is not None
    assert costs.distance == pytest.approx(5 * 0.04 * 1.5)
    assert costs.energy == pytest.approx(5 * 0.04 * PX4.body.demands((1.5, 0, 0), (0, 0, 0), np)[0])
    assert costs.noise == pytest.approx(PX4.body.sound_power_level - 10 * np.log10(4 * np.pi * 100), abs=0.1)


@given(seeds)
def test_where_people_will_be_is_the_integral_of_their_fading_velocity(seed: int) -> None:
    velocity, acceleration = np.random.default_rng(seed).normal(size=(2, 4, 3))
    times = np.linspace(0, 12, 6001)
    ways = ways_ahead(np.broadcast_to(times, (4, len(times))), velocity, acceleration)
    gained = SPEED_UP * (1 - np.exp(-times / SPEED_UP))[:, None] * acceleration[:, None]
    fading = np.exp(-times / KEEP_ON)[:, None]
    paces = np.stack([0 * gained, fading * velocity[:, None] + 0 * gained, fading * (velocity[:, None] + gained)])
    steps = (paces[:, :, 1:] + paces[:, :, :-1]) / 2 * times[1]
    np.testing.assert_allclose(ways[:, :, 1:], np.cumsum(steps, axis=2), atol=1e-5)
    assert not ways[:, :, 0].any()
