"""Evading what people walk towards: the clearest of all valid flights is flown, and soon enough."""

import numpy as np
import pytest

from ehar.flight.centre import centre_limits
from ehar.flight.clearance import Around
from ehar.flight.evasion import AMPLE, SOONER, _places_around, clearance_ahead, clearest
from ehar.flight.kinematics import SphericalState
from ehar.flight.limits import keeps_limits
from ehar.flight.motion import FlightMotion
from ehar.flight.profile import JerkProfile
from ehar.flight.proposals import PROPOSALS, braking_way, limits_to_target
from ehar.flight.time_optimal import TimeOptimal
from ehar.flight.vehicle import VEHICLES
from ehar.localisation import CentreMotion, Localisation, smoothed
from ehar.obstacles import Obstacles, Surroundings
from ehar.obstacles.shapes import MARGIN
from ehar.viewpoint import cartesian
from ehar.world import PAPER, ROOM
from tests.helpers.passers import walking

PX4 = VEHICLES["px4-auto"]


def case(count: int = 4) -> tuple[SphericalState, Around]:
    rng = np.random.default_rng(0)
    velocity, acceleration = rng.normal(0, [0.8, 0.1, 0.1], (count, 3)), rng.normal(0, [0.5, 0.05, 0.05], (count, 3))
    velocity[-1] = [9.0, 0.0, 0.0]  # faster than the vehicle may be
    state = SphericalState(ROOM.sample_starts(rng, count), velocity, acceleration, np.zeros((count, 3)))
    return state, Around(ROOM.obstacles, *(rng.normal(size=(3, count, 3)) * [1, 1, 0]))


def best_by_hand(state: SphericalState, around: Around, row: int) -> float:
    """Return the greatest worth of the valid flights of one state, each checked; -inf if there is none."""
    start, here, time_optimal = state.select(np.array([row])), around.select(np.array([row])), TimeOptimal()
    worth = -np.inf
    for place in _places_around(start.viewpoint + braking_way(PX4, start), ROOM.workspace):
        limits = limits_to_target(PX4, start, place - start.viewpoint)
        for proposal in range(len(PROPOSALS)):
            phases, found = time_optimal.to_target(start, place, limits.select(np.array([proposal]), np.array([0])))
            flight = JerkProfile.from_phases(start, phases)
            if found[0] and keeps_limits(flight, PX4, ROOM.workspace)[0]:
                clear = clearance_ahead(flight, np.zeros(1), here)[0]
                worth = max(worth, clear - SOONER * flight.duration[0])
    return worth


def test_the_clearest_of_all_valid_flights_is_returned() -> None:
    state, around = case()
    flights, clearance = clearest(state, PX4, ROOM.workspace, TimeOptimal(), around)
    found = np.isfinite(clearance)
    assert keeps_limits(flights.select(found), PX4, ROOM.workspace).all()
    assert (clearance <= AMPLE).all()
    np.testing.assert_array_equal(clearance_ahead(flights, np.zeros(len(found)), around)[found], clearance[found])
    worth = np.where(found, clearance - SOONER * flights.duration, -np.inf)
    np.testing.assert_allclose(worth, [best_by_hand(state, around, row) for row in range(len(found))], atol=1e-9)
    assert found.any() and not found.all(), "the last should be without a valid flight"


def test_who_begins_to_walk_is_evaded_in_time() -> None:
    """Eight people each begin to walk another way, and a fast camera that flies there, towards a wall, evades it."""
    drone, count, frames, fps = VEHICLES["tracking-drone"], 8, 75, 15
    azimuth = 2 * np.pi * (1 / 24 + np.arange(count) / count)
    way = 1.4 * np.clip(np.arange(frames) / fps - 1, 0, 1.6)  # [m], after a second
    ways = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(count)], axis=-1)[:, None] * way[:, None]
    centres = [smoothed(*Localisation().estimated(each, fps, 0), 1 / fps, centre_limits(drone)) for each in ways]
    motion = FlightMotion(vehicle=drone, workspace=ROOM.workspace, moving_centre=True)
    motion.centre = CentreMotion(*(np.stack(parts) for parts in zip(*centres, strict=True)))
    surroundings = Surroundings(ROOM.obstacles, motion.centre.position)
    motion.keep_clear(surroundings)
    start = np.stack([np.full(count, 5.5), azimuth + 1.2, np.full(count, 1.2)], axis=1)
    assert surroundings.clearance(start, 0).min() > MARGIN
    motion.reset(start, 1 / fps)
    target = np.stack([np.full(count, 9.0), azimuth, np.full(count, 1.3)], axis=1)
    flown = [surroundings.clearance(motion.advance(target), frame) for frame in range(1, frames)]
    assert np.min(flown) > MARGIN - 1e-9


@pytest.mark.parametrize("name", ["px4-auto", "tracking-drone"])
@pytest.mark.parametrize("flies", [False, True])
def test_passers_by_who_come_near_are_evaded(name: str, flies: bool) -> None:
    """They walk to where cameras stay or fly to, from people or from behind, and are told with errors as in worlds."""
    rng, count, frames, fps = np.random.default_rng(4), 6, 140, 15
    azimuth = 2 * np.pi * np.arange(count) / count
    start = np.stack([np.full(count, 6.0), azimuth, np.full(count, np.pi / 2)], axis=1)
    target = start + np.array([0.0, 0.5, 0.0]) * flies
    there = cartesian(target)[:, None, :2]
    outwards = there / np.linalg.norm(there, axis=-1, keepdims=True) * rng.choice([-1, 1], (count, 1, 1))
    velocity = rng.uniform(1.0, 1.6, (count, 1, 1)) * outwards
    noise = rng.normal(size=(count, frames, 1, 4)) * np.repeat([0.05, 0.1], 2)
    passers = walking(there - 2.5 * velocity, velocity, frames, fps, noise)
    around = Surroundings(Obstacles(), None, passers)
    motion = FlightMotion(vehicle=VEHICLES[name], workspace=PAPER.workspace)
    motion.keep_clear(around)
    motion.reset(start, 1 / fps)
    reached = [motion.advance(target) for _ in range(1, frames)]
    clearance = [around.clearance(viewpoint, frame) for frame, viewpoint in enumerate(reached, 1)]
    assert np.min(clearance) > MARGIN - 1e-6
    np.testing.assert_allclose(reached[-1], target, atol=1e-3)  # and when they are gone it goes on
