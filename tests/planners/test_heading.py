from dataclasses import replace

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.envs.controls import GridControls
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.viewpoint import AZIMUTH, HOVER, MOVES, Workspace, neighbours, wrap_difference
from ehar.world import PAPER, load_world
from planners.heading import HEADING_TIME, axis_ways, move_target
from planners.oracle import DIRECTIONS, OracleLookahead
from tests.helpers.fakes import tiny_context

VEHICLE = VEHICLES["tracking-drone"]
HERE = np.tile([10.0, 0.1, 0.7], (len(MOVES), 1))


FLIGHT = replace(tiny_context(), track=VEHICLE.name, vehicle=VEHICLE)


def way() -> FloatArray:
    there = move_target(FLIGHT, HERE, np.arange(len(MOVES))) - HERE
    there[:, AZIMUTH] = wrap_difference(there[:, AZIMUTH])
    return there


def test_a_vehicle_heads_the_way_of_the_move_as_far_as_it_gets_or_the_workspace_goes() -> None:
    assert way()[HOVER] == pytest.approx(0)
    np.testing.assert_array_equal(np.sign(np.round(way(), 9)), MOVES)
    rate = min(VEHICLE.speed / 10, VEHICLE.yaw_rate) * HEADING_TIME
    np.testing.assert_allclose(np.abs(way()).max(axis=1), [5, 5, rate, rate, np.pi / 2 - 0.7, 0.7, 0])


def test_on_the_grid_a_move_is_a_cell() -> None:
    here = PAPER.workspace.from_cells(PAPER.workspace.to_cells(HERE))
    there = move_target(tiny_context(), here, np.arange(len(MOVES)))
    np.testing.assert_array_equal(there, neighbours(here[0], Workspace()))


@pytest.mark.parametrize("streams", [False, True])
def test_in_a_room_a_move_leads_an_environment_where_it_leads_a_planner(streams: bool) -> None:
    # In a stream what stands in the way moves with every frame, so both ask for the next cell.
    room = load_world("room")
    controls = GridControls(world=room, moving_centre=streams)
    context = replace(tiny_context(length=None if streams else 60), workspace=room.workspace, world=room)
    viewpoints = room.sample_starts(np.random.default_rng(0), 200)
    for move in range(len(MOVES)):
        moves = np.full(len(viewpoints), move)
        there = move_target(context, viewpoints, moves)
        np.testing.assert_array_equal(controls.targets(moves, viewpoints, ""), there)
        if not streams:
            controls.motion.reset(viewpoints, 0.1)
            np.testing.assert_array_equal(controls.motion.advance(there), there)


def test_the_azimuth_turns_no_faster_than_the_vehicle_does() -> None:
    near, far = np.array([5.0, 0.0, 1.0]), np.array([15.0, 0.0, 1.0])
    assert axis_ways(VEHICLE, near)[AZIMUTH] == VEHICLE.yaw_rate * HEADING_TIME
    assert axis_ways(VEHICLE, far)[AZIMUTH] == VEHICLE.speed / 15 * HEADING_TIME


QUICK = replace(VEHICLES["px4-max"], yaw_rate=np.radians(200))  # more than half a turn in a second
INDOOR = load_world("indoor")
QUICK_FLIGHT = replace(
    tiny_context(episodes=2), track="own", vehicle=QUICK, world=INDOOR, workspace=INDOOR.workspace, frame_time=0.1
)
NEAR = np.tile([1.5, 0.1, INDOOR.workspace.polar_max], (2, 1))


def test_a_vehicle_that_turns_half_round_in_a_second_goes_on_turning_the_way_of_its_move() -> None:
    motion, sides = FlightMotion(vehicle=QUICK, workspace=INDOOR.workspace), np.array([1, -1])
    moves = np.array([np.flatnonzero(MOVES[:, AZIMUTH] == side)[0] for side in sides])
    motion.reset(NEAR, 0.1)
    here, turned = NEAR, np.zeros(2)
    for _ in range(60):
        there = motion.advance(move_target(QUICK_FLIGHT, here, moves))
        turn = sides * wrap_difference(there[:, AZIMUTH] - here[:, AZIMUTH])
        assert (turn > 0).all()
        here, turned = there, turned + turn
    assert (turned > np.pi).all()


def test_the_lookahead_imagines_turns_of_such_a_vehicle_to_either_side() -> None:
    planner = OracleLookahead()
    planner.reset(QUICK_FLIGHT)
    turn = wrap_difference(planner._flight_ends(NEAR, QUICK)[..., AZIMUTH] - NEAR[:, None, AZIMUTH])
    np.testing.assert_array_equal(np.sign(np.round(turn[0, 1:], 9)), np.sign(DIRECTIONS[:, AZIMUTH]))
    assert np.abs(turn).max() < np.pi
