"""Flights among obstacles: none comes too near, none through, and all arrive."""

import numpy as np
import pytest

from ehar.errors import UsageError
from ehar.flight.clearance import (
    FORESEEN,
    PLANNED,
    Around,
    first_towards,
    free_space_of_flights,
    keeps_clear,
    leads_nearer,
)
from ehar.flight.kinematics import SphericalState
from ehar.flight.motion import FlightMotion
from ehar.flight.profile import JerkProfile
from ehar.flight.time_optimal import AxisLimits, TimeOptimal
from ehar.flight.vehicle import VEHICLES
from ehar.localisation import CentreMotion
from ehar.obstacles import MARGIN, Box, Cylinder, FreeSpace, Obstacles, Surroundings
from ehar.viewpoint import AZIMUTH, Workspace, cartesian, wrap_difference
from ehar.world import ROOM

PILLARS = Obstacles(
    cylinders=tuple(Cylinder(centre=(7 * np.cos(a), 7 * np.sin(a), 0), radius=0.6, height=30) for a in (0.3, 2.0, 4.4))
)
SPACE = Workspace(distance_max=9.0, polar_min=0.9, distance_step=0.2)
FREE = FreeSpace.of(SPACE, PILLARS)
WAYS = free_space_of_flights(SPACE, PILLARS)


def anywhere(rng: np.random.Generator, count: int) -> np.ndarray:
    cells = np.argwhere(FREE.free)
    return SPACE.from_cells(cells[rng.integers(len(cells), size=count)])


def test_a_flight_keeps_clear_if_all_its_points_do() -> None:
    rng = np.random.default_rng(0)
    start, target = anywhere(rng, 200), anywhere(rng, 200)
    rest = np.zeros((200, 3))
    state = SphericalState(start, rest, rest, rest)
    limits = AxisLimits(*(np.full((200, 3), value) for value in (1.5, 1.0, 1.5)))
    phases, found = TimeOptimal().to_target(state, target, limits)
    assert found.all()
    profile = JerkProfile.from_phases(state, phases)
    moved = np.zeros((200, 3))
    moved[100:, 0] = 1.0
    kept = keeps_clear(profile, Around(PILLARS, moved, *np.zeros((2, *moved.shape))), 15.0)
    places = cartesian(profile.at(profile.duration[:, None] * np.linspace(0, 1, 3001)).viewpoint) + moved[:, None]
    clearance = PILLARS.clearance(places)
    assert 0.2 < kept.mean() < 0.9
    began_clear = clearance[:, 0] > PLANNED
    assert (clearance[kept & began_clear].min(axis=1) > PLANNED - 0.03).all()
    assert (clearance[~kept & began_clear].min(axis=1) < PLANNED + 0.03).all()


def test_no_thin_pillar_lies_between_two_samples() -> None:
    """A long way round at one speed, 3 m and more between the first samples, through a pillar of 10 cm."""
    rest = np.zeros((1, 3))
    state = SphericalState(np.array([[10.0, 0.0, np.pi / 2]]), rest, rest, rest)
    limits = AxisLimits(*(np.full((1, 3), value) for value in (0.5, 50.0, 5000.0)))
    phases, _ = TimeOptimal().to_target(state, state.viewpoint + np.array([0.0, 3.0, 0.0]), limits)
    profile = JerkProfile.from_phases(state, phases)
    for azimuth in np.linspace(0.1, 2.9, 57):
        centre = (10 * np.cos(azimuth), 10 * np.sin(azimuth), 0.0)
        pillar = Obstacles(cylinders=(Cylinder(centre=centre, radius=0.05, height=30),))
        assert not keeps_clear(profile, Around(pillar, rest, rest, rest), 5.0).any()


def test_a_flight_that_begins_too_near_may_leave_and_not_come_nearer() -> None:
    near = np.array([[7.0, 0.3 + 0.85 / 7, np.pi / 2]])  # 0.25 m from the pillar
    rest = np.zeros((2, 3))
    start = SphericalState(np.repeat(near, 2, axis=0), rest, rest, rest)
    target = start.viewpoint + np.array([[0, 0.2, 0], [0, -0.05, 0]])
    limits = AxisLimits(*(np.ones((2, 3)) for _ in range(3)))
    profile = JerkProfile.from_phases(start, TimeOptimal().to_target(start, target, limits)[0])
    assert keeps_clear(profile, Around(PILLARS, rest, rest, rest), 5.0).tolist() == [True, False]


def test_people_are_expected_to_walk_on_for_a_while() -> None:
    """A flight from 2 m beside a pillar to 0.5 m is fine, unless people walk towards it; staying would be."""
    start = np.repeat([[7.0, 0.3 + 2.6 / 7, np.pi / 2]], 3, axis=0)
    rest = np.zeros((3, 3))
    limits = AxisLimits(*(np.ones((3, 3)) for _ in range(3)))
    phases, _ = TimeOptimal().to_target(SphericalState(start, rest, rest, rest), start - [0.0, 1.5 / 7, 0.0], limits)
    profile = JerkProfile.from_phases(SphericalState(start, rest, rest, rest), phases)
    towards = PILLARS.cylinders[0].centre - cartesian(start[0])
    towards[2] = 0
    walking = 0.5 * towards / np.linalg.norm(towards) * np.array([[0], [1], [-1]])
    assert keeps_clear(profile, Around(PILLARS, rest, walking, rest), 5.0).tolist() == [True, False, True]


def test_passers_by_are_expected_to_walk_straight_on_for_a_while() -> None:
    """A flight along 2.1 m of a circle: who comes across its first quarter when the camera is there is in its way."""
    start, way = np.repeat([[7.0, 0.0, np.pi / 2]], 5, axis=0), np.array([0.0, 0.3, 0.0])
    rest = np.zeros((5, 3))
    limits = AxisLimits(*(np.full((5, 3), value) for value in (0.05, 5.0, 50.0)))
    state = SphericalState(start, rest, rest, rest)
    profile = JerkProfile.from_phases(state, TimeOptimal().to_target(state, start + way, limits)[0])
    duration = float(profile.duration[0])
    assert duration > FORESEEN + 3
    quarter, end = cartesian(start[0] + way / 4)[:2], cartesian(start[0] + way)[:2]
    outwards = quarter / np.linalg.norm(quarter)
    pace = 1.5 * outwards
    passers = np.stack(
        [
            np.concatenate([quarter - duration / 4 * pace, pace]),  # is there when the camera is
            np.concatenate([quarter - 4 * outwards - duration / 4 * pace, pace]),  # comes too late
            np.concatenate([end - duration * pace, pace]),  # is there when the camera is, but may be elsewhere by then
            np.concatenate([start[0, 0] * np.array([1, 0]) + [0, -0.5], 0 * pace]),  # stands where it begins
            np.concatenate([start[0, 0] * np.array([1, 0]) + [0.3, 0.5], 0 * pace]),  # stands beside its way
        ]
    )[:, None]
    around = Around(Obstacles(), rest, rest, rest, passers)
    assert keeps_clear(profile, around, 5.0).tolist() == [False, True, True, True, False]
    above = around._replace(
        moved=rest + np.array([0.0, 0.0, 2.0])
    )  # people, and the cameras around them, are 2 m higher than at first
    assert keeps_clear(profile, above, 5.0).all()


def test_where_people_take_a_camera_into_a_pillar_it_may_leave_and_not_go_through_another() -> None:
    start = np.repeat([[7.0, 0.3 + 1.1 / 7, np.pi / 2]], 2, axis=0)  # 0.5 m from the pillar
    rest = np.zeros((2, 3))
    state = SphericalState(start, rest, rest, rest)
    limits = AxisLimits(*(np.full((2, 3), 3.0) for _ in range(3)))
    ways = np.array([[0.0, 0.3, 0.0], [0.0, -0.6, 0.0]])  # away from the pillar, and through it
    profile = JerkProfile.from_phases(state, TimeOptimal().to_target(state, start + ways, limits)[0])
    towards = PILLARS.cylinders[0].centre - cartesian(start[0])
    towards[2] = 0
    walking = np.repeat([0.7 * towards / np.linalg.norm(towards)], 2, axis=0)
    assert keeps_clear(profile, Around(PILLARS, rest, walking, rest), 9.0).tolist() == [True, False]


def test_the_way_around_begins_in_sight_and_leads_there() -> None:
    rng = np.random.default_rng(1)
    here, target = anywhere(rng, 60), anywhere(rng, 60)
    first = first_towards(here, target, WAYS)
    direct = (first == target).all(axis=1)
    assert 0.4 < direct.mean() < 1
    assert leads_nearer(here[~direct], first[~direct], target[~direct], WAYS).all()
    assert not leads_nearer(first, here, target, WAYS).any()
    for _ in range(12):
        here = first_towards(here, target, WAYS)
    held = np.where((PILLARS.clearance(cartesian(target)) < PLANNED)[:, None], WAYS.nearest(target), target)
    np.testing.assert_allclose(cartesian(here), cartesian(held), atol=1e-9)
    blocked = np.array([[7.0, 0.3, 1.5]])
    assert WAYS.is_free(first_towards(target[:1], blocked, WAYS)).all()


def test_moves_between_free_cells_of_flights_keep_what_plans_keep() -> None:
    slabs = Obstacles(boxes=(Box(centre=(7, 0, 0), size=(0.02, 3, 3)), Box(centre=(-6, 2, 1), size=(2, 0.02, 2))))
    workspace = Workspace(distance_max=9.0, polar_min=0.9, distance_step=0.2)
    space = free_space_of_flights(workspace, slabs)
    cells = np.argwhere(space.free)
    for axis in np.eye(3, dtype=int):
        after = (cells + axis) % workspace.cells
        move = space.free[tuple(after.T)] & ((after > 0).all(axis=1) | (axis[AZIMUTH] == 1))
        begin, end = (workspace.from_cells(part[move]) for part in (cells, after))
        way = end - begin
        way[:, AZIMUTH] = wrap_difference(way[:, AZIMUTH])
        between = begin[:, None] + np.linspace(0, 1, 9)[:, None] * way[:, None]
        assert slabs.clearance(cartesian(between)).min() > PLANNED


@pytest.mark.parametrize("name", ["px4-auto", "tracking-drone"])
def test_cameras_that_fly_in_a_room_keep_the_margin_and_arrive(name: str) -> None:
    rng = np.random.default_rng(2)
    start, target = ROOM.sample_starts(rng, 12), ROOM.sample_starts(rng, 12)
    motion = FlightMotion(vehicle=VEHICLES[name], workspace=ROOM.workspace)
    motion.keep_clear(Surroundings(ROOM.obstacles))
    motion.reset(start, 0.04)
    for _ in range(300):
        reached = motion.advance(target)
        between = motion.sample(np.linspace(0, 0.04, 6)).viewpoint
        assert (ROOM.obstacles.clearance(cartesian(between)) >= MARGIN - 1e-3).all()
    np.testing.assert_allclose(cartesian(reached), cartesian(target), atol=1e-6)
    assert (motion.telemetry.peak_speed <= VEHICLES[name].speed).all()


def test_cameras_arrive_from_anywhere_behind_a_thin_wall_too() -> None:
    """Moves between cells at 0.35 m may lead nearer past an edge, and curved flights do: cameras once stayed there."""
    slab = Obstacles(boxes=(Box(centre=(5, 5, 1), size=(0.2, 3, 2)), Box(centre=(-4, 6, 0), size=(2, 0.2, 4))))
    workspace = Workspace(distance_min=4.8, distance_max=10.6, polar_min=1.17, polar_max=1.35)
    for obstacles, space in ((slab, workspace), (ROOM.obstacles, ROOM.workspace)):
        rng = np.random.default_rng(7)
        start = FreeSpace.of(space, obstacles).nearest(space.from_cells(rng.integers(0, space.cells, (32, 3))))
        target = space.from_cells(rng.integers(0, space.cells, (32, 3)))
        motion = FlightMotion(vehicle=VEHICLES["px4-max"], workspace=space)
        motion.keep_clear(Surroundings(obstacles))
        motion.reset(start, 0.1)
        for _ in range(400):
            reached = motion.advance(target)
        near = obstacles.clearance(cartesian(target)) < PLANNED
        held = np.where(near[:, None], free_space_of_flights(space, obstacles).nearest(target), target)
        np.testing.assert_allclose(cartesian(reached), cartesian(held), atol=1e-6)


def test_a_world_too_narrow_for_flights_says_so_before_the_first() -> None:
    low = Obstacles(walls=Box(centre=(0, 0, 0), size=(30, 30, 10.66)))
    above = Workspace(distance_max=5.0, polar_max=0.05)
    assert FreeSpace.of(above, low).free.any()
    with pytest.raises(UsageError, match="expected free space for cameras"):
        FlightMotion(vehicle=VEHICLES["px4-auto"], workspace=above).keep_clear(Surroundings(low))


def test_without_obstacles_nothing_changes() -> None:
    rng = np.random.default_rng(3)
    start, target = anywhere(rng, 5), anywhere(rng, 5)
    flown = []
    for around in (None, Surroundings(Obstacles())):
        motion = FlightMotion(vehicle=VEHICLES["px4-auto"])
        motion.keep_clear(around)
        motion.reset(start, 0.04)
        flown.append([motion.advance(target) for _ in range(20)])
    np.testing.assert_array_equal(*flown)


def flown_among_pillars(centre: np.ndarray, frames: int, fork: bool = False) -> np.ndarray:
    """Return the viewpoints (frames, n, 3) of cameras whose centres are at (B, L, 3), or of forks of them."""
    still = np.zeros_like(centre)
    velocity = np.gradient(centre, 0.04, axis=1)
    start = np.repeat([[6.0, 0.9, np.pi / 2]], len(centre), axis=0)
    motion = FlightMotion(vehicle=VEHICLES["tracking-drone"], moving_centre=True)
    motion.centre = CentreMotion(centre, velocity, still, still)
    motion.keep_clear(Surroundings(PILLARS, centre))
    motion.reset(start, 0.04)
    if fork:
        motion, start = motion.forked(2), np.repeat(start, 2, axis=0)
    return np.stack([motion.advance(start - [0.0, 1.2, 0.0]) for _ in range(frames)])  # past a pillar


def test_flights_know_how_fast_people_walk_and_not_where_they_will_go() -> None:
    time = 0.04 * np.arange(40)
    centre = np.zeros((3, 40, 3))
    centre[1, :, 0] = centre[2, :, 0] = 1.2 * time  # towards the pillar that cameras pass
    centre[2, 7:, 0] = centre[2, 6, 0] - 1.2 * time[:33]  # turns round; velocities differ from frame 6 on
    flown = flown_among_pillars(centre, 30)
    np.testing.assert_array_equal(flown[:6, 1], flown[:6, 2])
    assert np.abs(flown[:, 0] - flown[:, 1]).max() > 0.01  # who walks is kept clear of otherwise


def test_forks_of_a_flight_have_the_centre_of_their_flight() -> None:
    centre = np.zeros((2, 30, 3))
    centre[1, :, 0] = 1.2 * 0.04 * np.arange(30)
    flown, forks = (flown_among_pillars(centre, 20, fork) for fork in (False, True))
    np.testing.assert_array_equal(forks, np.repeat(flown, 2, axis=1))


def carried_to_a_pillar(name: str, speed: float, held: bool) -> tuple[np.ndarray, FlightMotion]:
    """Return the clearance (frames,) of a camera that is to stay with people who walk for 5 s, and its motion.

    It begins 1.6 m from a pillar, to which they take it at a `speed` [m/s] that they reach within a second. Forks of
    its flight fly as it does.
    """
    frames, vehicle = 125, VEHICLES[name]
    start = np.array([[6.0, 0.3, np.pi / 2]])
    towards = cartesian(np.array([[1.0, 0.3, np.pi / 2]]))
    pillar = Obstacles(cylinders=(Cylinder(centre=tuple((8.2 * towards)[0]), radius=0.6, height=6),))
    pace = speed * np.clip(np.arange(frames + 1) * 0.04, 0, 1)
    way = np.cumsum(pace)[:, None] * 0.04 * towards
    still = np.zeros_like(way)
    motion = FlightMotion(vehicle=vehicle, moving_centre=True)
    motion.centre = CentreMotion(*(part[None] for part in (way, pace[:, None] * towards, still, still)))
    around = Surroundings(pillar, way[None])
    motion.keep_clear(around if held else None)
    motion.reset(start, 0.04)
    clear = []
    for frame in range(1, frames):
        fork = motion.forked(2)
        reached = motion.advance(start)
        np.testing.assert_array_equal(fork.advance(np.repeat(start, 2, axis=0)), np.repeat(reached, 2, axis=0))
        clear.append(around.clearance(reached, frame)[0])
    return np.array(clear), motion


@pytest.mark.parametrize(("name", "speed"), [("px4-auto", 0.9), ("tracking-drone", 0.6)])
def test_cameras_that_people_carry_towards_something_evade_it(name: str, speed: float) -> None:
    carried, _ = carried_to_a_pillar(name, speed, held=False)
    assert carried.min() < 0  # through the pillar
    clear, motion = carried_to_a_pillar(name, speed, held=True)
    assert clear.min() >= MARGIN - 1e-3
    assert (motion.telemetry.peak_speed <= VEHICLES[name].speed).all()
    assert (motion.telemetry.peak_acceleration <= VEHICLES[name].acceleration).all()


def test_a_camera_between_walls_evades_upwards() -> None:
    """In a corridor, as near as cameras may be, people carry it to its end: only over them is there room."""
    frames, pace = 110, 0.6
    corridor = Obstacles(walls=Box(centre=(0, 0, 0), size=(13, 1.6, 24)))
    way = np.zeros((1, frames, 3))
    way[0, :, 0] = pace * 0.04 * np.arange(frames)
    walking, still = np.zeros_like(way), np.zeros_like(way)
    walking[..., 0] = pace
    motion = FlightMotion(vehicle=VEHICLES["px4-auto"], moving_centre=True)
    motion.centre = CentreMotion(way, walking, still, still)
    around = Surroundings(corridor, way)
    motion.keep_clear(around)
    start = np.array([[5.0, 0.0, np.pi / 2]])
    motion.reset(start, 0.04)
    clear = [around.clearance(motion.advance(start), frame)[0] for frame in range(1, frames)]
    assert 5.0 + way[0, -1, 0] > 6.5  # a camera that stayed would be behind the wall
    assert min(clear) >= MARGIN - 1e-3
