from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given
from hypothesis import strategies as st

from ehar.arrays import FloatArray
from ehar.camera import Camera, look_at_rotation, project
from ehar.data.scenario import split_parts, windows
from ehar.data.skeleton import Skeleton
from ehar.data.source import load_data
from ehar.errors import DataError
from ehar.planner import Observation
from ehar.sensors.registry import make_sensor
from ehar.sensors.sensor import draw_noise
from ehar.viewpoint import away_from, cartesian, turned, wrap_difference
from ehar.world import PAPER
from planners.value.body_filter import UNIFORM_STD, BodyFilter, trunk_pairs
from recognition.training.views import training_viewpoints
from tests.helpers.examples import share_of_examples
from tests.helpers.fakes import POSE, SKELETON, tiny_context, tiny_data
from tests.helpers.people import facing_people

PAIRS = np.array([[1, 2], [4, 5]])
FRAME_TIME = 0.04


def arc(frames: int, *, polar: float, turn: float, begin: float = 0.3) -> FloatArray:
    """Return the viewpoints (frames, 3) of a camera that flies along an arc of the azimuth [rad]."""
    viewpoints = np.full((frames, 3), (10.0, 0.0, polar))
    viewpoints[:, 1] = begin + np.linspace(0, turn, frames)
    return viewpoints


def watch(positions: FloatArray, viewpoints: FloatArray, **noise: float) -> BodyFilter:
    """Return a filter that has seen people (B, T, P, J, 3) from viewpoints (B, T, 3) without error."""
    body = BodyFilter(pairs=PAIRS, frame_time=FRAME_TIME, **noise)
    body.start(positions.shape[0], positions.shape[2])
    pixels, _ = project(positions, viewpoints, Camera())
    for frame in range(positions.shape[1]):
        body.update(pixels[:, frame], np.ones(pixels.shape[:1] + pixels.shape[2:4]), viewpoints[:, frame])
    return body


@share_of_examples(0.3)
@given(azimuth=st.floats(-3.1, 3.1), begin=st.floats(0, 6.2), polar=st.floats(0.2, 1.0))
def test_facing_is_found_from_one_image_that_is_not_level(azimuth, begin, polar):
    people = facing_people(np.full((1, 1, 1), azimuth))
    body = watch(people, arc(1, polar=polar, turn=0, begin=begin)[None], joint_noise=0.0, pixel_noise=0.0)
    # A perspective image is not quite a parallel one, and leaning is allowed for; both are small.
    assert abs(float(wrap_difference(body.facing - azimuth)[0, 0])) < 0.35


@pytest.mark.parametrize("azimuth", [-2.8, -1.0, 0.6, 2.2])
def test_a_level_camera_has_to_move_to_tell_front_from_back(azimuth):
    people = facing_people(np.full((1, 30, 1), azimuth))
    still = watch(people, arc(30, polar=np.pi / 2, turn=0.0)[None])
    moving = watch(people, arc(30, polar=np.pi / 2, turn=1.5)[None])
    error = abs(float(wrap_difference(moving.facing - azimuth)[0, 0]))
    assert error < 0.1
    assert moving.facing_std[0, 0] < 0.35
    assert still.facing_std[0, 0] > 1.5 * moving.facing_std[0, 0]


def test_facing_goes_round_with_a_person_who_turns_more_than_once():
    azimuth = np.linspace(0, 4 * np.pi, 200)
    people = facing_people(azimuth[None, :, None])
    body = BodyFilter(pairs=PAIRS, frame_time=FRAME_TIME)
    body.start(1, 1)
    viewpoints = arc(200, polar=0.5, turn=1.0)
    pixels, _ = project(people[0], viewpoints, Camera())
    errors = []
    for frame in range(200):
        body.update(pixels[None, frame], np.ones((1, 1, 6)), viewpoints[None, frame])
        assert -np.pi <= body.facing[0, 0] < np.pi
        errors.append(float(wrap_difference(body.facing - azimuth[frame])[0, 0]))
    assert np.abs(errors).max() < 0.5


def test_position_is_found_by_a_camera_that_moves():
    where = np.array([0.3, -0.4, 0.2])
    people = facing_people(np.zeros((1, 40, 1))) + where
    body = watch(people, arc(40, polar=0.9, turn=2.0)[None])
    expected = POSE.mean(axis=0) + where
    np.testing.assert_allclose(body.position[0, 0], expected, atol=0.08)


def followed_dancer(followed: bool) -> FloatArray:
    """Return how far off (frames,) [m] somebody is taken to be, seen for 20 s from one place, then from aside."""
    frames = round(22 / FRAME_TIME)
    rng = np.random.default_rng(0)
    sway = 0.1 * np.sin(np.arange(frames)[:, None] * FRAME_TIME * np.array([1.0, 0.7, 0.0]))
    people = facing_people(np.zeros((1, frames, 1))) + sway[None, :, None, None]
    viewpoints = arc(frames, polar=1.4, turn=0.0)
    viewpoints[-round(2 / FRAME_TIME) :, 1] += np.linspace(0, np.radians(5), round(2 / FRAME_TIME))
    sensor = make_sensor("estimator", tiny_data())
    noise = draw_noise(rng, (1, frames), 1, people.shape[3])
    body = BodyFilter(pairs=PAIRS, frame_time=FRAME_TIME, followed=followed)
    body.start(1, 1)
    errors = []
    for frame in range(frames):
        sensed = sensor.sense(people[:, frame], viewpoints[None, frame], noise.frame(frame))
        body.update(sensed.joints_2d, sensed.confidence, viewpoints[None, frame])
        errors.append(float(np.linalg.norm(body.position[0, 0] - people[0, frame, 0].mean(axis=0))))
    return np.array(errors)


def test_who_is_followed_stays_near_the_centre_however_long_a_camera_does_not_see_how_deep_they_stand():
    assert followed_dancer(followed=True).max() < 0.4
    assert followed_dancer(followed=False).max() > 0.5  # in a clip they may have walked away: it is not as long


def test_the_prior_of_who_is_followed_stays_what_it_is_while_nobody_is_seen():
    body = BodyFilter(pairs=PAIRS, frame_time=FRAME_TIME, followed=True)
    body.start(1, 1)
    before = body.movement_covariance
    for _ in range(100):
        body.update(np.zeros((1, 1, 6, 2)), np.zeros((1, 1, 6)), np.array([[10.0, 0.0, 1.0]]))
    np.testing.assert_allclose(body.movement_covariance, before, atol=1e-12)


def test_a_camera_that_looks_beside_the_centre_measures_from_there():
    gaze = np.array([[0.8, -0.3, 0.1]])
    people = facing_people(np.zeros((1, 40, 1)))[0]  # around what cameras look at
    context = replace(tiny_context(), episodes=1, skeleton=SKELETON, frame_time=FRAME_TIME, length=None)
    body = BodyFilter.of(context, PAIRS)
    for frame, viewpoint in enumerate(arc(40, polar=0.9, turn=2.0)):
        place = cartesian(viewpoint[None])
        shown = turned(people[None, frame], place - gaze, place)  # for this camera, which is turned towards them
        pixels, _ = project(shown, away_from(viewpoint[None], gaze), Camera())
        blank = np.zeros((1, 1))
        body.observe(
            Observation(frame, None, pixels, np.ones((1, 1, 6)), viewpoint[None], blank, blank, blank, blank, gaze=gaze)
        )
    np.testing.assert_allclose(body.position[0, 0], POSE.mean(axis=0) + gaze[0], atol=0.08)
    assert abs(wrap_difference(body.facing[0, 0])) < np.radians(2)


def random_frames(rng, episodes, frames, persons):
    joints_2d = np.array([640.0, 360.0]) + 40 * rng.standard_normal((episodes, frames, persons, 6, 2))
    confidence = rng.choice([0.0, 0.3, 1.0], size=(episodes, frames, persons, 6))
    viewpoints = np.stack(
        [rng.uniform(*limits, size=(episodes, frames)) for limits in ((5, 15), (0, 6.28), (0, 1.57))], axis=-1
    )
    return joints_2d, confidence, viewpoints


def test_batched_equals_filterpy():
    rng = np.random.default_rng(0)
    joints_2d, confidence, viewpoints = random_frames(rng, 3, 25, 2)
    body = BodyFilter(pairs=PAIRS, frame_time=FRAME_TIME)
    body.start(3, 2)
    lateral, movement = (np.empty((3, 2), dtype=object) for _ in range(2))
    for index in np.ndindex(3, 2):
        lateral[index] = KalmanFilter(2, 2)
        lateral[index].F, lateral[index].Q = np.eye(2), body.turning_noise
        movement[index] = KalmanFilter(6, 2)
        movement[index].F, movement[index].Q = body.motion, body.motion_noise
        lateral[index].x, lateral[index].P = body.lateral[index], np.array(body.lateral_covariance[index])
        movement[index].x, movement[index].P = body.movement[index], np.array(body.movement_covariance[index])

    for frame in range(25):
        seen = joints_2d[:, frame], confidence[:, frame], viewpoints[:, frame]
        body.update(*seen)
        axes = look_at_rotation(viewpoints[:, frame])[:, :2]
        for (episode, person), theirs in np.ndenumerate(lateral):
            still = np.zeros((2, 3))
            for single, measure, matrix in (
                (theirs, body.measure_lateral, axes[episode, :, :2]),
                (movement[episode, person], body.measure_position, np.hstack([axes[episode], still])),
            ):
                measured, variance = measure(*seen)
                if frame > 0:
                    single.predict()
                if np.isfinite(variance[episode, person]).all():
                    single.update(measured[episode, person], np.diag(variance[episode, person]), matrix)
    for index in np.ndindex(3, 2):
        np.testing.assert_allclose(body.lateral[index], lateral[index].x, atol=1e-9, rtol=0)
        np.testing.assert_allclose(body.lateral_covariance[index], lateral[index].P, atol=1e-9, rtol=0)
        np.testing.assert_allclose(body.movement[index], movement[index].x, atol=1e-9, rtol=0)
        np.testing.assert_allclose(body.movement_covariance[index], movement[index].P, atol=1e-9, rtol=0)


def test_missing_joints_are_not_used():
    rng = np.random.default_rng(1)
    joints_2d, confidence, viewpoints = random_frames(rng, 2, 10, 2)
    confidence[:, :, 1] = 0.0
    elsewhere = np.where(confidence[..., None] > 0, joints_2d, 1e4)
    bodies = []
    for joints in (joints_2d, elsewhere):
        body = BodyFilter(pairs=PAIRS, frame_time=FRAME_TIME)
        body.start(2, 2)
        for frame in range(10):
            body.update(joints[:, frame], confidence[:, frame], viewpoints[:, frame])
        bodies.append(body)
    np.testing.assert_array_equal(bodies[0].lateral, bodies[1].lateral)
    np.testing.assert_array_equal(bodies[0].position, bodies[1].position)
    np.testing.assert_array_equal(bodies[0].facing_std[:, 1], UNIFORM_STD)
    np.testing.assert_array_equal(bodies[0].position[:, 1], 0.0)


def test_an_unsure_joint_moves_the_belief_less():
    joints_2d, _, viewpoints = random_frames(np.random.default_rng(2), 1, 1, 1)
    moved = []
    for confidence in (1.0, 0.3):
        body = BodyFilter(pairs=PAIRS, frame_time=FRAME_TIME)
        body.start(1, 1)
        body.update(joints_2d[:, 0], np.full((1, 1, 6), confidence), viewpoints[:, 0])
        moved.append(float(np.linalg.norm(body.lateral)))
    assert moved[1] < moved[0]


def test_sides_swapped_at_first_do_not_lock_the_filter_in():
    azimuth = 0.3 + 0.15 + np.pi / 2  # the camera begins at azimuth 0.3: 9 degrees off edge-on
    people = facing_people(np.full((1, 30, 1), azimuth))
    viewpoints = arc(30, polar=np.pi / 2, turn=1.5)[None]
    pixels, _ = project(people, viewpoints, Camera())
    pixels[:, :2] = pixels[:, :2, :, SKELETON.mirror]
    body = BodyFilter(pairs=PAIRS, frame_time=FRAME_TIME)
    body.start(1, 1)
    for frame in range(30):
        body.update(pixels[:, frame], np.ones((1, 1, 6)), viewpoints[:, frame])
    assert abs(float(wrap_difference(body.facing - azimuth)[0, 0])) < 0.2


@pytest.mark.parametrize(("sensor_name", "largest"), [("perfect", 6.0), ("estimator", 11.0)])
def test_facing_of_moving_couples(sensor_name, largest):
    data = load_data("duo")
    parts, rng = split_parts(data), np.random.default_rng(0)
    scenarios = windows(data, parts.policy, 60, 60)
    positions = scenarios.positions(np.arange(len(scenarios)))
    viewpoints = training_viewpoints("moving", PAPER, rng, len(scenarios), 60)
    noise = draw_noise(rng, positions.shape[:2], *positions.shape[2:4])
    sensed = make_sensor(sensor_name, data).sense(positions, viewpoints, noise)
    pairs = trunk_pairs(data, parts.recogniser)
    body = BodyFilter(pairs=pairs, frame_time=1 / data.fps)
    body.start(len(scenarios), 2)
    errors = []
    lateral = (positions[:, :, :, pairs[:, 0]] - positions[:, :, :, pairs[:, 1]]).mean(axis=3)
    for frame in range(60):
        body.update(sensed.joints_2d[:, frame], sensed.confidence[:, frame], viewpoints[:, frame])
        facing = np.arctan2(lateral[:, frame, :, 1], lateral[:, frame, :, 0]) - np.pi / 2
        errors.append(np.abs(wrap_difference(body.facing - facing)))
    assert np.degrees(np.mean(errors)) < largest


def test_the_trunk_of_the_built_in_couples_is_hips_and_shoulders():
    data = load_data("duo")
    names = data.skeleton.joint_names
    pairs = trunk_pairs(data, split_parts(data).recogniser)
    assert [(names[left], names[right]) for left, right in pairs] == [
        ("left_shoulder", "right_shoulder"),
        ("left_hip", "right_hip"),
    ]


def test_a_skeleton_without_sides_has_no_trunk():
    data = tiny_data()
    sideless = Skeleton(tuple("abcdef"), SKELETON.bones)
    object.__setattr__(data, "skeleton", sideless)
    with pytest.raises(DataError, match="joints named left and right"):
        trunk_pairs(data, np.arange(3))
