"""What a vehicle is held to: shares by hand, and flights that break one limit."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.flight.kinematics import CartesianMotion, SphericalState
from ehar.flight.limits import keeps_limits, limit_shares
from ehar.flight.profile import JerkProfile, Phases, phases_to_rest
from ehar.flight.time_optimal import AxisLimits, TimeOptimal
from ehar.flight.vehicle import LIMITS, VEHICLES, Vehicle
from ehar.viewpoint import AZIMUTH, DISTANCE, Workspace

GENEROUS = Vehicle(
    name="generous", speed=100, acceleration=100, jerk=100, climb_speed=100, descent_speed=100, yaw_rate=100
)


def flight(start: list[float], target: list[float]) -> JerkProfile:
    """Return the flight from rest to rest with limits of 1 on each axis."""
    at, rest, one = np.array([start]), np.zeros((1, 3)), np.ones((1, 3))
    state = SphericalState(at, rest, rest, rest)
    phases, _ = TimeOptimal().to_target(state, np.array([target]), AxisLimits(one, one, one))
    return JerkProfile.from_phases(state, phases)


def test_shares_by_hand() -> None:
    """Level at 10 m, circling at 0.3 rad/s and rising at 1 m/s (the polar angle falls by 0.1 rad/s)."""
    zero = np.zeros(3)
    state = SphericalState(np.array([10, 0, np.pi / 2]), np.array([0, 0.3, -0.1]), zero, zero)
    shares = limit_shares(VEHICLES["px4-auto"], state)
    assert shares[0] == pytest.approx(np.hypot(3, 1) / 5)
    assert shares[1] == pytest.approx(10 * (0.3**2 + 0.1**2) / 3)
    assert shares[3] == pytest.approx(1 / 3)
    assert shares[4] == pytest.approx(0.3 / np.radians(45))
    down = limit_shares(VEHICLES["px4-auto"], state._replace(velocity=np.array([0, 0, 0.1])))
    assert down[3] == pytest.approx(1 / 1.5)


def test_a_centre_that_moves_adds_its_motion_by_hand() -> None:
    """At 120 degrees, level at 10 m, circling at 0.1 rad/s: a centre as fast, the same way, across and aside."""
    azimuth, zero = np.radians(120), np.zeros(3)
    across, out = np.array([-np.sin(azimuth), np.cos(azimuth), 0]), np.array([np.cos(azimuth), np.sin(azimuth), 0])
    state = SphericalState(np.array([10, azimuth, np.pi / 2]), np.array([0, 0.1, 0]), zero, zero)
    expected = {1.0: (across, 2.0), -1.0: (across, 0.0), 0.75: (out, 1.25)}
    for speed, (way, sum_of_both) in expected.items():
        centre = CartesianMotion(speed * way, zero, zero)
        assert limit_shares(VEHICLES["px4-auto"], state, centre)[0] == pytest.approx(sum_of_both / 5)
    pushed = CartesianMotion(zero, 0.1 * out, zero)  # against the 0.1 m/s² that hold the camera on its circle
    assert limit_shares(VEHICLES["px4-auto"], state, pushed)[1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("limit", LIMITS)
def test_one_limit_that_is_not_kept_is_enough(limit: str) -> None:
    """The flight down reaches the axes' limits: 1 m/s outwards, 1 rad/s round and down."""
    down = flight([6, 0, 0.2], [9, 3, 1.5])
    assert keeps_limits(down, GENEROUS, Workspace()).all()
    tight = keeps_limits(down, replace(GENEROUS, **{limit: 0.4}), Workspace()).all()
    assert tight == (limit == "climb_speed")
    up = flight([9, 3, 1.5], [6, 0, 0.2])
    assert keeps_limits(up, replace(GENEROUS, **{limit: 0.4}), Workspace()).all() == (limit == "descent_speed")


def test_a_flight_out_of_the_workspace() -> None:
    out = flight([6, 0, 1.0], [9, 0, 1.0])
    assert keeps_limits(out, GENEROUS, Workspace()).all()
    assert not keeps_limits(out, GENEROUS, Workspace(distance_max=8.999)).any()
    assert not keeps_limits(out, GENEROUS, Workspace(polar_max=0.999)).any()


@pytest.mark.parametrize("name", ["climb_speed", "yaw_rate"])
@pytest.mark.parametrize(("peak", "kept"), [(0.99, True), (1.004, False)])
def test_a_rate_that_is_greatest_between_samples(name: str, peak: float, kept: bool) -> None:
    """Straight above people: at first a constant jerk makes one axis faster and then slower again, symmetrically."""
    slow = replace(GENEROUS, acceleration=1.0, jerk=2.1, yaw_rate=0.5)  # so a radian takes it 2 s
    vehicle = replace(slow, **{name: 1.0})
    axis, jerk, duration = (DISTANCE, 2.0, 0.6) if name == "climb_speed" else (AZIMUTH, 2000.0, 0.02)
    one, rest = np.eye(3)[axis], np.zeros((1, 3))
    slower = Phases(np.full((1, 1, 3), duration), -jerk * one[None, None])
    first, push = peak - jerk * duration**2 / 8, jerk * duration / 2
    start = SphericalState(np.array([[6.0, 0, 0]]), first * one[None], push * one[None], rest)
    turned = JerkProfile.from_phases(start, slower).at(np.array([[duration / 3, duration / 2]])).velocity[0, :, axis]
    assert turned[1] == pytest.approx(peak) and turned[0] < 0.995
    end = start._replace(acceleration=-start.acceleration)
    stop = phases_to_rest(end, np.array([2 * first / push]))
    flown = JerkProfile.from_phases(start, Phases.joined([slower, stop]))
    assert keeps_limits(flown, vehicle, Workspace()).all() == kept


def test_many_flights_are_checked_one_by_one() -> None:
    starts = np.full((200, 3), [6.0, 0.0, 1.0])
    targets = starts + np.linspace(0, 5, 200)[:, None] * [1, 0, 0]
    rest, one = np.zeros((200, 3)), np.ones((200, 3))
    state = SphericalState(starts, rest, rest, rest)
    phases, _ = TimeOptimal().to_target(state, targets, AxisLimits(one, one, one))
    keeps = keeps_limits(JerkProfile.from_phases(state, phases), GENEROUS, Workspace(distance_max=8.0))
    np.testing.assert_array_equal(keeps, targets[:, 0] <= 8.0)
