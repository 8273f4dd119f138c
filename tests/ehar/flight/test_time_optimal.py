"""Ruckig's flights, read from its phases."""

import numpy as np
import pytest

from ehar.flight.kinematics import SphericalState
from ehar.flight.profile import JerkProfile
from ehar.flight.time_optimal import AxisLimits, TimeOptimal

EPISODES = 200


@pytest.fixture
def start() -> SphericalState:
    rng = np.random.default_rng(0)
    velocity, acceleration = rng.uniform(-0.5, 0.5, (2, EPISODES, 3))
    return SphericalState(rng.normal(size=(EPISODES, 3)), velocity, acceleration, np.zeros((EPISODES, 3)))


@pytest.fixture
def limits() -> AxisLimits:
    return AxisLimits(*np.random.default_rng(1).uniform(1, 3, (3, EPISODES, 3)))


def test_flights_arrive_within_their_limits(start: SphericalState, limits: AxisLimits) -> None:
    target = np.random.default_rng(2).normal(size=(EPISODES, 3))
    optimal = TimeOptimal()
    phases, found = optimal.to_target(start, target, limits)
    flights = JerkProfile.from_phases(start, phases)
    assert found.all()
    np.testing.assert_allclose(flights.end.viewpoint, target, atol=1e-8)
    np.testing.assert_allclose(flights.duration, optimal.durations(start, target, limits))
    state = flights.at(np.linspace(0, 1, 200) * flights.duration[:, None])
    for value, limit in zip(state[1:], limits, strict=True):
        assert (np.abs(value) <= limit[:, None] + 1e-8).all()


def test_flights_to_rest_are_no_longer_than_those_to_where_they_end(start: SphericalState, limits: AxisLimits) -> None:
    optimal = TimeOptimal()
    phases, found = optimal.to_rest(start, limits)
    flights = JerkProfile.from_phases(start, phases)
    assert found.all()
    again = optimal.durations(start, flights.end.viewpoint, limits)
    assert (flights.duration <= again + 1e-8).all()


def test_from_rest_by_hand() -> None:
    """Speed 1, acceleration 1, jerk 1 over 3 m: d / v + v / a + a / j = 5 s."""
    rest, one = np.zeros((1, 3)), np.ones((1, 3))
    start = SphericalState(rest, rest, rest, rest)
    assert TimeOptimal().durations(start, 3 * one, AxisLimits(one, one, one)) == pytest.approx([5.0])


def test_what_ruckig_refuses_is_not_found(start: SphericalState, limits: AxisLimits) -> None:
    broken = limits._replace(jerk=np.where(np.arange(EPISODES)[:, None] == 3, 0.0, limits.jerk))
    optimal = TimeOptimal()
    _, found = optimal.to_target(start, start.viewpoint + 1, broken)
    np.testing.assert_array_equal(np.flatnonzero(~found), [3])
    np.testing.assert_array_equal(np.isinf(optimal.durations(start, start.viewpoint + 1, broken)), ~found)
