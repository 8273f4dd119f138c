"""The pace along ways: from the present speed to rest, within limits, and about as a vehicle flies."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.arrays import FloatArray
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.planner import Context, Observation
from ehar.viewpoint import Workspace, cartesian
from ehar.world import PAPER
from planners.search.pace import pace_of, way_made
from planners.search.ways import Ways
from tests.helpers.fakes import tiny_context

FRAME_TIME = 0.04
SPEEDS = st.floats(-1, 1)


@given(st.floats(-200, 200), st.floats(0, 60), SPEEDS)
def test_ways_are_made_within_the_limits_and_end_at_rest(way: float, ramp: float, along: float) -> None:
    frames = np.linspace(0, 2 * abs(way) + 5 * ramp + 1, 800)
    made = np.array([way_made(frame, np.array(way), ramp, along) for frame in frames])
    assert made[0] == 0
    assert made[-1] == pytest.approx(way, abs=1e-6)
    step = frames[1] - frames[0]
    speed = np.diff(made) / step
    assert (np.abs(speed) <= 1 + 1e-6).all()
    if ramp > 1:
        assert speed[0] == pytest.approx(along, abs=step / ramp + 1e-6)
        assert (np.abs(np.diff(speed) / step) <= 1 / ramp + 1e-5).all()


@given(st.floats(0, 200), st.floats(0, 60))
def test_from_rest_nobody_goes_back_or_too_far(way: float, ramp: float) -> None:
    made = np.array([way_made(frame, np.array(way), ramp) for frame in np.linspace(0, 2 * (way + ramp) + 1, 400)])
    assert (np.diff(made) >= -1e-9).all()
    assert made[-1] == pytest.approx(way, abs=1e-6)


@given(st.floats(0, 100), st.floats(1, 50), st.floats(0.1, 1))
def test_who_is_too_fast_to_stop_passes_the_goal_and_comes_back(way: float, ramp: float, along: float) -> None:
    frames = np.linspace(0, 2 * way + 5 * ramp, 500)
    made = [way_made(frame, np.array(way), ramp, along) for frame in frames]
    assert max(made) == pytest.approx(max(way, ramp * along**2 / 2), rel=1e-2)


def test_without_a_ramp_the_pace_is_steady_until_the_goal() -> None:
    made = [way_made(frame, np.array(8.0), 0.0) for frame in (0, 2, 4, 8, 20)]
    np.testing.assert_allclose(made, [0, 2, 4, 8, 8])


@given(st.floats(1, 100), st.floats(1, 100), st.floats(0, 150))
def test_until_one_brakes_it_does_not_matter_how_far_the_goal_is(near: float, more: float, frames: float) -> None:
    made = way_made(frames, np.array([near, near + more]), 20.0)
    if made[0] < near / 2 - 1e-9:
        assert made[1] == pytest.approx(made[0])


def context_of(vehicle: str, episodes: int) -> Context:
    return replace(tiny_context(episodes=episodes), vehicle=VEHICLES[vehicle], frame_time=FRAME_TIME)


def at_rest(here: FloatArray) -> Observation:
    blank = np.zeros((len(here), 1))
    return Observation(0, 10, *[blank] * 2, here, *[blank] * 2, *[np.zeros(here.shape)] * 2)


def test_a_way_down_takes_as_long_as_the_descent_does() -> None:
    """It is 6 m down at 1.5 m/s, and up as fast as it climbs; around it is as fast as the vehicle."""
    low, high = np.array([8.0, 0, np.pi / 2]), np.array([8.0, 0, np.arccos(0.75)])
    ways = Ways.to(np.stack([low, high])[::-1, None], np.stack([low, high]))
    needed = pace_of(ways, at_rest(np.stack([low, high])), context_of("px4-auto", 2)).needed[:, 0] * FRAME_TIME
    vehicle = VEHICLES["px4-auto"]
    assert needed[1] > 6 / vehicle.descent_speed
    assert needed[0] > 6 / vehicle.climb_speed
    assert needed[1] / needed[0] == pytest.approx(vehicle.climb_speed / vehicle.descent_speed)


def test_who_stays_brakes_and_comes_back() -> None:
    here = np.array([[8.0, 1.0, 1.2]])
    moving = replace(at_rest(here), velocity=np.array([[0.0, 0.3, 0.0]]))
    ways = Ways.to(here[:, None], here)
    pace = pace_of(ways, moving, context_of("px4-auto", 1))
    azimuth = pace.places(ways, np.arange(0, 150, 5), Workspace())[0, :, 0, 1]
    assert azimuth[0] == pytest.approx(1.0)
    assert (azimuth[1] - 1.0) / (5 * FRAME_TIME) == pytest.approx(0.3, rel=0.3)
    assert 1.05 < max(azimuth) < 1.5
    assert azimuth[-1] == pytest.approx(1.0)


@pytest.mark.parametrize("vehicle", ["px4-auto", "tracking-drone"])
def test_from_rest_cameras_are_where_a_vehicle_flies_them(vehicle: str) -> None:
    rng = np.random.default_rng(6)
    start, goal = (drawn(rng, 60) for _ in range(2))
    motion = FlightMotion(vehicle=VEHICLES[vehicle])
    motion.reset(start, FRAME_TIME)
    ways = Ways.to(goal[:, None], start)
    places = pace_of(ways, at_rest(start), context_of(vehicle, 60)).places(ways, np.arange(1, 101), PAPER.workspace)
    for frame in range(1, 101):
        flown = motion.advance(goal)
        off = np.linalg.norm(cartesian(places[:, frame - 1, 0]) - cartesian(flown), axis=-1)
        assert np.median(off) < 1.2


@pytest.mark.parametrize("vehicle", ["px4-auto", "tracking-drone"])
def test_cameras_are_about_where_a_vehicle_flies_them(vehicle: str) -> None:
    """After a second of flight to one goal, the next goal's way begins in motion."""
    rng = np.random.default_rng(5)
    episodes, workspace = 60, PAPER.workspace
    start, first, second = (drawn(rng, episodes) for _ in range(3))
    motion = FlightMotion(vehicle=VEHICLES[vehicle])
    motion.reset(start, FRAME_TIME)
    for _ in range(25):
        here = motion.advance(first)
    resting = at_rest(here)
    moving = replace(resting, velocity=motion.velocity, acceleration=motion.acceleration)
    ways = Ways.to(second[:, None], here)
    paces = [pace_of(ways, seen, context_of(vehicle, episodes)) for seen in (moving, resting)]
    both = [pace.places(ways, np.arange(1, 26), workspace) for pace in paces]
    for frame in range(1, 26):
        flown = motion.advance(second)
        if frame in (10, 15, 25):
            off, if_at_rest = (
                np.median(np.linalg.norm(cartesian(places[:, frame - 1, 0]) - cartesian(flown), axis=-1))
                for places in both
            )
            assert off < 0.6 * if_at_rest


def drawn(rng: np.random.Generator, count: int) -> FloatArray:
    return rng.uniform([6, 0, 0.4], [14, 2 * np.pi, 1.5], size=(count, 3))
