"""Piecewise constant jerk: continuity, exact extremes, and samples on both sides of every step."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.flight.kinematics import SphericalState
from ehar.flight.profile import SAMPLES, JerkProfile, Phases

FLIGHTS = 4
seeds = st.integers(0, 10_000)


def profile(seed: int) -> JerkProfile:
    """Return random flights from rest to rest: a push, its opposite, and both again in reverse."""
    rng = np.random.default_rng(seed)
    push = rng.uniform(0, 1, (FLIGHTS, 2, 3)) * (rng.random((FLIGHTS, 2, 3)) < 0.8)
    sign = np.array([1, -1, -1, 1, -1, 1, 1, -1])[:, None]
    durations = push[:, [0, 0, 0, 0, 1, 1, 1, 1]]
    strength = rng.normal(size=(FLIGHTS, 2, 3))[:, [0, 0, 0, 0, 1, 1, 1, 1]]
    rest = np.zeros((FLIGHTS, 3))
    start = SphericalState(rng.normal(size=(FLIGHTS, 3)), rest, rest, rest)
    return JerkProfile.from_phases(start, Phases(durations, sign * strength))


@given(seeds)
def test_each_derivative_is_the_slope_of_the_one_before(seed: int) -> None:
    flights, step = profile(seed), 1e-3
    times = np.tile(np.arange(0, 4.5, step), (FLIGHTS, 1))
    state = flights.at(times)
    for value, slope in pairwise(state):
        middle = (slope[:, 1:] + slope[:, :-1]) / 2
        largest_change = np.abs(np.diff(slope, axis=1)).max(initial=0)  # where the jerk steps
        np.testing.assert_allclose(np.diff(value, axis=1) / step, middle, atol=largest_change + 1e-6)


@given(seeds)
def test_flights_end_at_rest_and_stay_there(seed: int) -> None:
    flights = profile(seed)
    late = flights.at(flights.duration[:, None] + np.array([0.0, 1.0, 50.0]))
    assert not late.velocity.any() and not late.acceleration.any() and not late.jerk.any()
    np.testing.assert_array_equal(late.viewpoint[:, 0], late.viewpoint[:, 2])
    np.testing.assert_array_equal(flights.end.viewpoint, late.viewpoint[:, 0])


@given(seeds)
def test_extremes_are_exact(seed: int) -> None:
    flights = profile(seed)
    low, high = flights.extremes()
    dense = flights.at(np.tile(np.linspace(0, 9, 5000), (FLIGHTS, 1))).viewpoint
    assert (low <= dense.min(axis=1) + 1e-12).all() and (high >= dense.max(axis=1) - 1e-12).all()
    np.testing.assert_allclose(low, dense.min(axis=1), atol=1e-4)
    np.testing.assert_allclose(high, dense.max(axis=1), atol=1e-4)


def test_a_jerk_next_to_none_is_as_none() -> None:
    start = SphericalState(*(np.array([part]) for part in ([8.0, 0, 1], [1.0, 2, 0], [-1.0, 0.5, 1], [0.0, 0, 0])))
    durations, jerks = np.full((1, 1, 3), 2.0), np.array([[[5e-324, -5e-324, 5e-324]]])
    flights = [JerkProfile.from_phases(start, Phases(durations, jerk)) for jerk in (0 * jerks, jerks)]
    for without, with_least in zip(*(flight.extremes() for flight in flights), strict=True):
        np.testing.assert_array_equal(without, with_least)


@given(seeds, st.floats(0.01, 3) | st.just(np.inf))
def test_samples_are_close_and_see_both_sides_of_every_step_of_the_jerk(seed: int, longest: float) -> None:
    flights = profile(seed)
    flight, state = flights.samples(longest)
    assert state.viewpoint.shape == state.jerk.shape == (len(flight), SAMPLES, 3)
    for one in range(FLIGHTS):
        pieces = SphericalState(*(part[flight == one] for part in state))
        changes = np.unique(np.round(flights.times[one], 9))
        assert len(pieces.jerk) >= len(changes) - 1
        assert (np.ptp(pieces.jerk, axis=1) == 0).all(), "a piece has one jerk"
        for value in pieces[:3]:
            np.testing.assert_allclose(value[1:, 0], value[:-1, -1], atol=1e-7)
        middles = (changes[1:] + changes[:-1]) / 2
        seen = {tuple(jerk) for jerk in pieces.jerk[:, 0]}
        assert {tuple(jerk) for jerk in flights.at(np.tile(middles, (FLIGHTS, 1))).jerk[one]} == seen


def test_select_and_replace() -> None:
    flights, others = profile(0), profile(1)
    kept = flights.at(np.full((FLIGHTS, 1), 0.7))
    flights.replace(np.array([2]), others.select(np.array([1])))
    now = flights.at(np.full((FLIGHTS, 1), 0.7))
    np.testing.assert_array_equal(now.viewpoint[2], others.at(np.full((FLIGHTS, 1), 0.7)).viewpoint[1])
    np.testing.assert_array_equal(now.viewpoint[[0, 1, 3]], kept.viewpoint[[0, 1, 3]])


def test_one_push_by_hand() -> None:
    """1 m/s^3 for 1 s, back to no acceleration, and all of it undone: t = 4 s, x = 2 m, at most 1 m/s."""
    phases = Phases(np.ones((1, 4, 3)), np.tile(np.array([1.0, -1, -1, 1])[:, None], (1, 1, 3)))
    rest = np.zeros((1, 3))
    flight = JerkProfile.from_phases(SphericalState(rest, rest, rest, rest), phases)
    assert flight.duration == pytest.approx(4)
    assert flight.end.viewpoint[0] == pytest.approx(2)
    middle = flight.at(np.array([[2.0]]))
    assert middle.velocity[0, 0] == pytest.approx(1)
    assert middle.viewpoint[0, 0] == pytest.approx(1)


def test_flights_of_many_phases_are_found_in_each_of_them() -> None:
    """More than a byte counts."""
    rest, phases = np.zeros((1, 3)), 300
    flight = JerkProfile.from_phases(
        SphericalState(rest, rest, rest, rest), Phases(np.ones((1, phases, 3)), np.arange(phases)[None, :, None] + rest)
    )
    jerk = flight.at(np.arange(phases)[None] + 0.5).jerk
    np.testing.assert_array_equal(jerk[0], np.arange(phases)[:, None] + np.zeros(3))
