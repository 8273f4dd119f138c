"""Planners that go to a place relative to people get there, and wait until they know where it is."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.batch import Batch
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion, Motion
from ehar.planner import Context, Observation
from ehar.rollout import rollout
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.registry import make_sensor
from ehar.sensors.sensor import Sensed, Sensor, SensorNoise, draw_noise
from ehar.viewpoint import AZIMUTH, DISTANCE, POLAR, Workspace, wrap_difference
from ehar.world import PAPER
from planners.place.go_to_place import PLACES, GoToPlace, Place
from tests.helpers.fakes import SKELETON, FakeRecogniser, tiny_context, tiny_data
from tests.helpers.people import facing_people

FACING = np.array([-2.6, -1.3, 0.0, 0.9, 2.2])
EIGHT = np.radians(8)  # half a step of the grid, and an error of the body filter
INDOOR = Workspace(distance_min=1.5, distance_max=4.0, polar_min=np.radians(39.6), polar_max=np.radians(93.6))


def planner(name: str) -> GoToPlace:
    return GoToPlace(name=name, place=PLACES[name])


def one_each(facing: FloatArray, frames: int) -> FloatArray:
    """Return one person in each episode, who stands still: (B, T, 1, 6, 3)."""
    return np.repeat(facing_people(facing)[:, None, None], frames, axis=1)


def pairs(facing: FloatArray, line: FloatArray, frames: int, *, apart: float = 1.0) -> FloatArray:
    """Return two people in each episode: (B, T, 2, 6, 3); facing (B, 2), line (B,) from the first to the second."""
    people = facing_people(facing)
    way = np.stack([np.cos(line), np.sin(line), np.zeros(len(line))], axis=-1)
    people[:, 0] -= apart / 2 * way[:, None]
    people[:, 1] += apart / 2 * way[:, None]
    return np.repeat(people[:, None], frames, axis=1)


def run(
    goer: GoToPlace,
    positions: FloatArray,
    starts: FloatArray,
    *,
    sensor: Sensor | None = None,
    motion: Motion | None = None,
    context: Context | None = None,
) -> FloatArray:
    """Return the viewpoints (B, T, 3)."""
    episodes, length, persons, joints = positions.shape[:4]
    noise = draw_noise(np.random.default_rng(0), (episodes, length), persons, joints)
    names = tuple(f"episode-{index}" for index in range(episodes))
    batch = Batch(positions.astype(np.float32), np.zeros(episodes, dtype=np.int64), starts, noise, names)
    motion = motion or GridMotion()
    context = context or tiny_context(episodes=episodes, length=length)
    context = replace(context, workspace=motion.workspace)
    return rollout(goer, batch, FakeRecogniser(), sensor or PerfectSensor(), motion, context).viewpoints


def starts(count: int, seed: int = 1) -> FloatArray:
    return PAPER.sample_starts(np.random.default_rng(seed), count)


def azimuths_off(viewpoints: FloatArray, expected: FloatArray) -> FloatArray:
    """Return how far the last viewpoints are from azimuths (B,), (B,) [rad]."""
    return np.abs(wrap_difference(viewpoints[:, -1, AZIMUTH] - expected))


@pytest.mark.parametrize("polar", [0, 8, 20])
def test_front_ends_near_level_and_in_front(polar: int) -> None:
    begin = PAPER.workspace.from_cells(
        np.array([[60, 3, polar], [0, 90, polar], [95, 40, polar], [20, 70, polar], [5, 55, polar]])
    )
    viewpoints = run(planner("front"), one_each(FACING, 200), begin)
    assert (azimuths_off(viewpoints, FACING) <= EIGHT).all()
    np.testing.assert_allclose(viewpoints[:, -1, DISTANCE], 6.0, atol=0.05)
    np.testing.assert_allclose(viewpoints[:, -1, POLAR], np.radians(75), atol=np.radians(1.81))


def test_side_ends_at_the_side_that_was_nearer() -> None:
    begin = starts(len(FACING))
    begin[:, AZIMUTH] = PAPER.workspace.from_cells(
        PAPER.workspace.to_cells(np.stack([begin[:, 0], FACING + 0.7, begin[:, 2]], axis=1))
    )[:, AZIMUTH]
    viewpoints = run(planner("side"), one_each(FACING, 200), begin)
    assert (azimuths_off(viewpoints, FACING + np.pi / 2) <= EIGHT).all()


def test_near_level_keeps_its_azimuth_whoever_it_sees() -> None:
    begin = starts(len(FACING))
    viewpoints = run(planner("near-level"), one_each(FACING, 140), begin)
    np.testing.assert_allclose(viewpoints[..., AZIMUTH], np.repeat(begin[:, None, AZIMUTH], 140, axis=1))
    np.testing.assert_allclose(viewpoints[:, -1, DISTANCE], 6.0, atol=0.05)
    again = run(planner("near-level"), one_each(FACING + 1, 140), begin)
    np.testing.assert_array_equal(again, viewpoints)


def test_front_in_flight() -> None:
    vehicle = VEHICLES["px4-max"]
    context = replace(tiny_context(episodes=5, length=150), frame_time=0.1, track=vehicle.name, vehicle=vehicle)
    viewpoints = run(
        planner("front"), one_each(FACING, 150), starts(5), motion=FlightMotion(vehicle=vehicle), context=context
    )
    assert (azimuths_off(viewpoints, FACING) <= EIGHT).all()
    np.testing.assert_allclose(viewpoints[:, -1, DISTANCE], 6.0, atol=0.05)


@pytest.mark.parametrize("name", ["front", "side"])
def test_a_mirrored_motion_gives_the_mirrored_way(name: str) -> None:
    begin = starts(len(FACING), seed=3)
    people = one_each(FACING, 60)
    mirrored = (people * [1, -1, 1])[..., SKELETON.mirror, :]
    viewpoints = run(planner(name), people, begin)
    other = run(planner(name), mirrored, PAPER.workspace.from_cells(PAPER.workspace.to_cells(begin) * [1, -1, 1]))
    assert not np.array_equal(viewpoints[:, -1, AZIMUTH], begin[:, AZIMUTH])
    np.testing.assert_allclose(other[..., [DISTANCE, POLAR]], viewpoints[..., [DISTANCE, POLAR]], atol=1e-9)
    assert (np.abs(wrap_difference(other[..., AZIMUTH] + viewpoints[..., AZIMUTH])) < 1e-6).all()


@pytest.mark.parametrize(("name", "degrees"), [("front", 0), ("side", 90)])
def test_through_a_noisy_sensor_the_camera_still_gets_there(name: str, degrees: float) -> None:
    facing = np.linspace(-3, 3, 24)
    sensor = make_sensor("estimator", tiny_data())
    viewpoints = run(planner(name), one_each(facing, 180), starts(24), sensor=sensor)
    off = np.minimum(*(azimuths_off(viewpoints, facing + sign * np.radians(degrees)) for sign in (1, -1)))
    assert np.median(off) <= EIGHT
    assert np.mean(off <= np.radians(30)) >= 0.9


class Blind:
    """Sees nobody."""

    name = "blind"
    camera = PerfectSensor().camera

    def sense(self, positions: FloatArray, viewpoint: FloatArray, noise: SensorNoise) -> Sensed:
        seen = PerfectSensor().sense(positions, viewpoint, noise)
        return Sensed(np.zeros_like(seen.joints_2d), np.zeros_like(seen.confidence))


@pytest.mark.parametrize("name", ["front", "side"])
def test_as_long_as_no_front_is_known_the_camera_goes_near_and_level(name: str) -> None:
    begin, people = starts(len(FACING)), one_each(FACING, 40)
    expected = run(planner("near-level"), people, begin)
    np.testing.assert_array_equal(run(planner(name), people, begin, sensor=Blind()), expected)
    alike = replace(SKELETON, joint_names=tuple(f"marker-{index}" for index in range(6)))
    unnamed = replace(tiny_context(episodes=5, length=40), skeleton=alike)
    np.testing.assert_array_equal(run(planner(name), people, begin, context=unnamed), expected)


@pytest.mark.parametrize("name", ["front", "side"])
def test_people_who_face_each_other_are_seen_from_across(name: str) -> None:
    line = np.array([0.4, -1.2, 2.5, 1.5])
    people = pairs(np.stack([line, line + np.pi], axis=1), line, 200)
    begin = starts(4, seed=5)
    begin[:, POLAR] = PAPER.workspace.from_cells(np.full((4, 3), 8))[:, POLAR]
    viewpoints = run(planner(name), people, begin)
    across = np.stack([line + np.pi / 2, line - np.pi / 2], axis=1)
    off = np.abs(wrap_difference(viewpoints[:, -1, AZIMUTH, None] - across))
    assert (off.min(axis=1) <= EIGHT).all()
    began = np.abs(wrap_difference(begin[:, AZIMUTH, None] - across))
    np.testing.assert_array_equal(off.argmin(axis=1), began.argmin(axis=1))


def test_people_who_face_one_way_are_seen_from_the_front() -> None:
    facing = np.array([0.4, -1.2, 2.5])
    people = pairs(np.stack([facing - 0.4, facing + 0.4], axis=1), facing + np.pi / 2, 200)
    viewpoints = run(planner("front"), people, starts(3, seed=5))
    assert (azimuths_off(viewpoints, facing) <= EIGHT).all()


def test_places_follow_the_workspace() -> None:
    begin = PAPER.workspace.from_cells(np.tile([-20, 10, 15], (5, 1)))  # 3 m, which no paper workspace has
    viewpoints = run(planner("front"), one_each(FACING, 120), begin, motion=GridMotion(workspace=INDOOR))
    assert (azimuths_off(viewpoints, FACING) <= EIGHT).all()
    np.testing.assert_allclose(viewpoints[:, -1, DISTANCE], 1.75, atol=0.051)
    high = Workspace(polar_max=np.radians(36))
    below = run(
        planner("front"),
        one_each(FACING, 90),
        PAPER.workspace.from_cells(np.tile([5, 0, 3], (5, 1))),
        motion=GridMotion(workspace=high),
    )
    np.testing.assert_allclose(below[:, -1, POLAR], np.radians(36))


def test_a_camera_right_in_front_picks_one_side_and_keeps_to_it() -> None:
    facing = PAPER.workspace.from_cells(np.tile([0, 7, 0], (12, 1)))[:, AZIMUTH]
    begin = PAPER.workspace.from_cells(np.tile([10, 7, 21], (12, 1)))
    sensor = make_sensor("estimator", tiny_data())
    viewpoints = run(planner("side"), one_each(facing, 60), begin, sensor=sensor)
    turns = np.sign(wrap_difference(np.diff(viewpoints[..., AZIMUTH], axis=1))).round()
    moved = [row[row != 0] for row in turns]
    assert min(len(row) for row in moved) >= 20
    assert max(int((np.diff(row[:20]) != 0).sum()) for row in moved) <= 1


def observations(episodes: int, frames: int) -> list[Observation]:
    rng = np.random.default_rng(2)
    viewpoints = PAPER.sample_starts(rng, episodes)
    shown = []
    for frame in range(frames):
        joints = rng.uniform(200, 600, (episodes, 2, 6, 2))
        confidence = rng.uniform(0, 1, (episodes, 2, 6)) * (rng.random((episodes, 2, 6)) < 0.8)
        rest = [np.zeros((episodes, 3))] * 4
        shown.append(Observation(frame, frames, joints, confidence, viewpoints, *rest))
    return shown


@pytest.mark.parametrize("name", PLACES)
def test_an_episode_alone_gets_the_targets_that_it_gets_beside_others(name: str) -> None:
    shown = observations(6, 15)
    whole = planner(name)
    whole.reset(tiny_context(episodes=6, length=15))
    together = [whole.act(observation) for observation in shown]
    for row in range(6):
        alone = planner(name)
        alone.reset(tiny_context(episodes=1, length=15))
        for observation, expected in zip(shown, together, strict=True):
            parts = {key: value[[row]] for key, value in vars(observation).items() if isinstance(value, np.ndarray)}
            np.testing.assert_allclose(alone.act(replace(observation, **parts))[0], expected[row], atol=1e-9)


def test_an_absolute_place_needs_no_front() -> None:
    place = Place(0.5, 1.0, np.radians(60), absolute=True)
    viewpoints = run(GoToPlace(name="fixed-best", place=place), one_each(FACING, 130), starts(5), sensor=Blind())
    assert (azimuths_off(viewpoints, np.full(5, 1.0)) <= np.radians(1.81)).all()
    np.testing.assert_allclose(viewpoints[:, -1, DISTANCE], 10.0, atol=0.05)


def test_a_place_of_any_distance_keeps_that_of_the_start() -> None:
    begin = starts(5)
    viewpoints = run(GoToPlace(name="fixed-best", place=Place(None, 0.0, 1.5)), one_each(FACING, 90), begin)
    np.testing.assert_allclose(viewpoints[..., DISTANCE], np.repeat(begin[:, None, DISTANCE], 90, axis=1))
    assert (azimuths_off(viewpoints, FACING) <= EIGHT).all()


def test_a_place_in_words() -> None:
    assert str(Place(None, 1.0, 0.5, absolute=True)).startswith("any distance, 57 degrees from azimuth 0, ")
    assert (
        str(PLACES["front"])
        == "10 % from the nearest to the farthest, 0 degrees from the front, polar angle 75 degrees"
    )
    assert str(PLACES["near-level"]) == "10 % from the nearest to the farthest, any azimuth, polar angle 75 degrees"
