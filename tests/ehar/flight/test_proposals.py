"""How limits are shared out: what is timid always flies, what is bold is sooner."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ehar.arrays import FloatArray
from ehar.flight.kinematics import SphericalState
from ehar.flight.limits import keeps_limits
from ehar.flight.profile import JerkProfile
from ehar.flight.proposals import BRAKING, PROPOSALS, STRAIGHT, limits_to_rest, limits_to_target
from ehar.flight.time_optimal import TimeOptimal
from ehar.flight.vehicle import VEHICLES
from ehar.viewpoint import AZIMUTH, Workspace, cartesian, wrap_difference
from tests.helpers.examples import share_of_examples
from tests.helpers.flight_cases import random_vehicle, random_viewpoints

FLIGHTS = 40
LEVEL = np.pi / 2


def at_rest(viewpoint: FloatArray) -> SphericalState:
    rest = np.zeros(viewpoint.shape)
    return SphericalState(viewpoint, rest, rest, rest)


def flown_from_rest(seed: int, proposal: int) -> tuple[JerkProfile, FloatArray]:
    """Return the flights of a random vehicle with a proposal, which keep all its limits, and their ways, (B, 3)."""
    rng = np.random.default_rng(seed)
    vehicle, workspace = random_vehicle(rng), Workspace()
    start, target = (random_viewpoints(rng, FLIGHTS, workspace) for _ in range(2))
    way = target - start
    way[:, AZIMUTH] = wrap_difference(way[:, AZIMUTH])
    state = at_rest(start)
    limits = limits_to_target(vehicle, state, way).select(proposal)
    phases, found = TimeOptimal().to_target(state, start + way, limits)
    flights = JerkProfile.from_phases(state, phases)
    assert found.all()
    assert keeps_limits(flights, vehicle, workspace).all()
    return flights, way


@share_of_examples(0.25)
@given(st.integers(0, 10_000))
def test_from_rest_the_most_timid_proposal_may_always_be_flown(seed: int) -> None:
    """Why any target that is held is reached."""
    flown_from_rest(seed, len(PROPOSALS) - 1)


@share_of_examples(0.25)
@given(st.integers(0, 10_000))
def test_from_rest_the_last_proposal_flies_straight(seed: int) -> None:
    """Why a camera among obstacles gets to any place that is in sight."""
    flights, way = flown_from_rest(seed, len(PROPOSALS + STRAIGHT) - 1)
    moves = np.abs(way).max(axis=1) > 1e-6
    flown = flights.at(flights.duration[:, None] * np.linspace(0, 1, 101)).viewpoint[moves]
    begin, way = flown[:, :1], way[moves, None]
    share = ((flown - begin) * way).sum(axis=-1, keepdims=True) / (way**2).sum(axis=-1, keepdims=True)
    off = cartesian(flown) - cartesian(begin + share * way)
    assert np.linalg.norm(off, axis=-1).max() < 0.005


def test_shapes_and_order() -> None:
    rng = np.random.default_rng(0)
    state = at_rest(random_viewpoints(rng, FLIGHTS, Workspace()))
    way = rng.normal(size=(FLIGHTS, 3))
    for limits, ways in (
        (limits_to_target(VEHICLES["px4-max"], state, way), PROPOSALS + STRAIGHT),
        (limits_to_rest(VEHICLES["px4-max"], state), BRAKING),
    ):
        for limit in limits:
            assert limit.shape == (len(ways), FLIGHTS, 3)
            assert (limit > 0).all() and np.isfinite(limit).all()
            assert (limit[0] >= limit[-1]).all()


def test_a_move_along_one_axis_gets_what_the_vehicle_has() -> None:
    """Outwards there is no curve: the speed, and 96 % of the acceleration that 0.8 times 1.2 makes."""
    vehicle = VEHICLES["px4-auto"]
    limits = limits_to_target(vehicle, at_rest(np.array([[6.0, 0.0, LEVEL]])), np.array([[5.0, 0.0, 0.0]]))
    safe = [k for k, boldness in enumerate(PROPOSALS) if boldness.speed == 1]
    np.testing.assert_allclose(limits.velocity[safe, 0, 0], 0.994 * vehicle.speed)
    assert (limits.acceleration[:, 0, 0] <= 1.2 * 0.85 * vehicle.acceleration + 1e-9).all()


def test_descending_is_as_slow_as_the_vehicle_descends() -> None:
    vehicle = VEHICLES["px4-auto"]
    start = at_rest(np.array([[10.0, 0.0, 1.2], [10.0, 0.0, LEVEL]]))
    limits = limits_to_target(vehicle, start, np.array([[0.0, 0.0, LEVEL - 1.2], [0.0, 0.0, 1.2 - LEVEL]]))
    safe = next(k for k, boldness in enumerate(PROPOSALS) if boldness.speed == 1)
    down, up = 10 * limits.velocity[safe, :, 2]
    assert down == 0.994 * vehicle.descent_speed
    assert up > 1.9 * down
