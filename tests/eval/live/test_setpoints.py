"""Setpoints keep the vehicle's limits: to targets that jump, through braking, and after it."""

import numpy as np
import pytest

from ehar.flight.vehicle import VEHICLES
from ehar.viewpoint import Workspace, cartesian
from eval.live.setpoints import LimitShares, Setpoint, Setpoints
from tests.helpers.live_worlds import START

FRAME_TIME = 1 / 30


def flying(vehicle: str = "px4-auto") -> Setpoints:
    setpoints = Setpoints(vehicle=VEHICLES[vehicle], workspace=Workspace(), frame_time=FRAME_TIME)
    assert setpoints.begin(START)
    return setpoints


def test_limits_hold_whatever_is_wanted() -> None:
    rng, setpoints, vehicle = np.random.default_rng(0), flying(), VEHICLES["px4-auto"]
    flown: list[Setpoint] = []
    for frame in range(240):
        if frame % 7 == 0:
            setpoints.aim(rng.uniform([0, -10, -1], [30, 10, 4]))
        if frame % 60 == 40:
            setpoints.brake()
        flown.append(setpoints.next())
    places = np.array([[*point.position] for point in flown])
    for order, limit in ((1, vehicle.speed), (2, vehicle.acceleration), (3, vehicle.jerk)):
        lengths = np.linalg.norm(np.diff(places, n=order, axis=0), axis=1) / FRAME_TIME**order
        assert lengths.max() <= limit * (1 + 1e-6)
    climbs = np.diff(places[:, 2]) / FRAME_TIME
    assert climbs.max() <= vehicle.climb_speed and -climbs.min() <= vehicle.descent_speed
    assert max(abs(point.yaw_rate) for point in flown) <= vehicle.yaw_rate
    assert Workspace().contains(np.array([point.viewpoint for point in flown])).all()


def test_velocity_acceleration_and_yaw_are_those_of_the_way() -> None:
    setpoints = flying()
    setpoints.aim(np.array([6.0, 2.5, 0.8]))
    flown = [setpoints.next() for _ in range(40)]
    places, rates = (np.array([getattr(point, name) for point in flown]) for name in ("position", "velocity"))
    pulls = np.array([point.acceleration for point in flown])
    np.testing.assert_allclose(np.gradient(places, FRAME_TIME, axis=0)[1:-1], rates[1:-1], atol=5e-3)
    np.testing.assert_allclose(np.gradient(rates, FRAME_TIME, axis=0)[1:-1], pulls[1:-1], atol=0.1)
    for point in flown:
        to_people = -np.array(point.position)
        assert point.yaw == pytest.approx(np.arctan2(to_people[1], to_people[0]))
        assert point.position == pytest.approx(tuple(cartesian(np.array(point.viewpoint))))
    assert [point.time for point in flown[:2]] == pytest.approx([FRAME_TIME, 2 * FRAME_TIME])


def test_around_people_who_walk_the_way_in_the_local_frame_is_theirs_and_the_flight_s() -> None:
    """Position, velocity and acceleration in the local frame belong together, and keep the vehicle's limits."""
    rng, setpoints, vehicle = np.random.default_rng(0), flying(), VEHICLES["px4-auto"]
    shares, walked, flown = LimitShares(vehicle), np.array([3.0, -2.0, 1.0]), []
    for frame in range(400):
        turn = 1.3 * FRAME_TIME * np.array([np.cos(frame / 60), np.sin(frame / 60), 0.0])
        walked += turn if frame < 200 else 0.0
        setpoints.follow(tuple(walked + 0.02 * rng.standard_normal(3)), frame * FRAME_TIME)
        if frame % 50 == 0:
            setpoints.aim(rng.uniform([5, -3, 0.5], [15, 3, 1.5]))
        flown.append(setpoints.next())
        shares.take(flown[-1])
    places, rates, pulls = (np.array([point.whole[order] for point in flown]) for order in range(3))
    np.testing.assert_allclose(np.gradient(places, FRAME_TIME, axis=0)[1:-1], rates[1:-1], atol=5e-3)
    np.testing.assert_allclose(np.gradient(rates, FRAME_TIME, axis=0)[1:-1], pulls[1:-1], atol=0.1)
    assert max(shares.greatest.values()) <= 1 and shares.greatest["speed"] > 0.5
    middles = np.array([point.centre.position for point in flown if point.centre])
    assert np.linalg.norm(middles[-1] - walked) < 0.3
    np.testing.assert_allclose(places - middles, [point.position for point in flown], atol=1e-9)
    assert np.linalg.norm(middles - places, axis=1).min() > 4.9, "the workspace is that of the people's frame"


def test_braking_is_sooner_at_rest_than_flying_on_and_then_it_hovers() -> None:
    setpoints = flying()
    setpoints.aim(np.array([8.0, 4.0, 1.2]))
    for _ in range(60):
        moving = setpoints.next()
    speed = np.linalg.norm(moving.velocity)
    assert speed > 2
    setpoints.brake()
    frames = 0
    while not setpoints.resting:
        frames += 1
        assert setpoints.next().braking and frames < 150
    assert frames * FRAME_TIME < 3.5  # 5 m/s at 3 m/s^2 and 4 m/s^3 takes 2.4 s
    hover = setpoints.next()
    assert hover.velocity == (0, 0, 0) and hover.position == setpoints.next().position
    setpoints.aim(np.array([8.0, 4.0, 1.2]))
    assert not [setpoints.next() for _ in range(30)][-1].braking
    assert not setpoints.resting


def test_nothing_begins_outside_of_the_workspace() -> None:
    setpoints = Setpoints(vehicle=VEHICLES["px4-auto"], workspace=Workspace(), frame_time=FRAME_TIME)
    assert not setpoints.begin(np.array([3.0, 0.0, 1.0])) and not setpoints.begun
    assert setpoints.begin(START)
    assert setpoints.begin(np.array([3.0, 0.0, 1.0])), "it has begun, and stays"


def test_what_hovers_flies_as_if_it_had_just_begun() -> None:
    old, new = flying(), flying()
    for _ in range(50):
        old.next()
    old.settle()
    for setpoints in (old, new):
        setpoints.aim(np.array([12.0, 5.0, 0.4]))
    for _ in range(60):
        assert old.next().position == new.next().position
    old.settle()  # in flight, it changes nothing
    assert old.next().position == new.next().position


def test_an_origin_that_is_told_in_flight_moves_no_setpoint_at_once() -> None:
    """The frame leaves where people were taken to be, and what is flown keeps the vehicle's limits."""
    vehicle, assumed, told = VEHICLES["px4-auto"], np.array([1.0, 2.0, 0.0]), (10.0, 5.0, 0.0)
    setpoints = Setpoints(vehicle=vehicle, workspace=Workspace(), frame_time=FRAME_TIME, origin=tuple(assumed))
    setpoints.begin(Workspace().origin)
    before = [np.array(setpoints.next().whole.position) + assumed for _ in range(50)]
    after = []
    for frame in range(400):
        setpoints.follow(told, frame * FRAME_TIME)
        after.append(setpoints.next())
    places = np.array([*before, *(point.whole.position for point in after)])
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() <= vehicle.speed * FRAME_TIME
    assert after[-1].centre is not None
    np.testing.assert_allclose(after[-1].centre.position, told, atol=0.05)
