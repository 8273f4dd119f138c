"""The estimator sensor: its noise measured, and its errors provoked in scenes built by hand."""

import numpy as np
import pytest

from ehar.arrays import read_only
from ehar.camera import FOCAL_LENGTH, IMAGE_HEIGHT, IMAGE_WIDTH, Camera, project
from ehar.data.skeleton import LIMB_RADIUS, TRUNK_RADIUS, Skeleton
from ehar.sensors import estimator
from ehar.sensors.estimator import (
    OCCLUDED_CONFIDENCE,
    OCCLUDED_NOISE,
    SWAP_PROBABILITY,
    EstimatorSensor,
)
from ehar.sensors.sensor import Sensed, SensorNoise, draw_noise
from ehar.world import PAPER
from tests.helpers.fakes import POSE, SKELETON

LEVEL = np.pi / 2
FRONT, SIDE = np.array([10.0, 0.0, LEVEL]), np.array([10.0, LEVEL, LEVEL])
CENTRE = [IMAGE_WIDTH / 2, IMAGE_HEIGHT / 2]
POINTS = Skeleton(("a", "b", "c"), ((0, 1),))  # a bone, and a joint that belongs to none


def quiet(leading: tuple[int, ...], persons: int, joints: int) -> SensorNoise:
    """Return draws under which nothing goes wrong that is left to luck."""
    return SensorNoise(
        np.zeros((*leading, persons, joints, 2), dtype=np.float32),
        np.ones((*leading, persons, joints), dtype=np.float32),
        np.ones((*leading, persons), dtype=np.float32),
    )


def see_points(points: list[list[list[float]]], viewpoint: np.ndarray = FRONT) -> Sensed:
    """Return what is sensed of persons of three joints."""
    positions = np.array(points, dtype=np.float32)
    return EstimatorSensor(skeleton=POINTS).sense(positions, viewpoint, quiet((), len(points), 3))


def spread(count: int, viewpoint: np.ndarray, positions: np.ndarray = POSE) -> tuple[np.ndarray, Sensed]:
    """Return the localisation errors of one person seen `count` times, and what was sensed."""
    rng = np.random.default_rng(0)
    noise = draw_noise(rng, (count,), 1, len(positions))._replace(swap=np.ones((count, 1), dtype=np.float32))
    viewpoints = np.tile(viewpoint, (count, 1))
    sensed = EstimatorSensor(skeleton=SKELETON).sense(positions[None, None], viewpoints, noise)
    exact, _ = project(positions[None, None], viewpoints, Camera())
    return sensed.joints_2d - exact, sensed


@pytest.mark.parametrize("distance", [5.0, 14.9])
def test_noise_grows_with_the_person_s_height_and_has_a_floor(distance: float) -> None:
    error, sensed = spread(4000, np.array([distance, 0.0, LEVEL]))
    head, foot = project(POSE[None], np.array([distance, 0.0, LEVEL]), Camera())[0][0, [0, 4]]
    expected = np.hypot(0.01 * (foot[1] - head[1]), 1.5)
    seen = sensed.confidence[0, 0] == 1
    assert seen.sum() >= 4
    np.testing.assert_allclose(error[:, 0, seen].std(axis=(0, 2)), expected, rtol=0.05)
    np.testing.assert_allclose(error[:, 0, seen].mean(axis=0), 0, atol=0.1 * expected)


def test_from_straight_above_the_height_is_the_extent_that_is_seen() -> None:
    error, sensed = spread(4000, np.array([5.0, 0.0, 0.0]))
    pixels = project(POSE[None], np.array([5.0, 0.0, 0.0]), Camera())[0][0]
    extent = (pixels.max(axis=0) - pixels.min(axis=0)).max()
    assert extent < 100
    shoulder = 1
    assert (sensed.confidence[:, 0, shoulder] == 1).all()
    assert error[:, 0, shoulder].std() == pytest.approx(np.hypot(0.01 * extent, 1.5), rel=0.05)


def test_a_bone_in_front_hides_a_joint_and_one_behind_or_beside_does_not() -> None:
    bone = [[1.0, -0.5, 0.0], [1.0, 0.5, 0.0]]
    assert see_points([[*bone, [-1.0, 0.0, 0.0]]]).confidence[0].tolist() == pytest.approx([1, 1, OCCLUDED_CONFIDENCE])
    assert see_points([[*bone, [1.5, 0.0, 0.0]]]).confidence[0].tolist() == [1, 1, 1]
    assert see_points([[*bone, [-1.0, 0.0, 0.3]]]).confidence[0].tolist() == [1, 1, 1]
    assert see_points([[*bone, [-1.0, 1.0, 0.0]]]).confidence[0].tolist() == [1, 1, 1]


def test_a_bone_hides_what_lies_within_its_radius_and_no_more() -> None:
    bone = [[1.0, -0.5, 0.0], [1.0, 0.5, 0.0]]
    shadow = LIMB_RADIUS * 11 / 9  # the capsule is 9 m from the camera, the joint 11 m
    for share, confidence in ((0.9, OCCLUDED_CONFIDENCE), (1.1, 1.0)):
        sensed = see_points([[*bone, [-1.0, 0.0, share * shadow]]])
        assert sensed.confidence[0, 2] == pytest.approx(confidence)


def test_a_slanted_bone_is_as_near_as_its_point_before_the_joint() -> None:
    slanted = [[3.0, -1.0, 0.0], [-3.0, 1.0, 0.0]]  # from near left to far right, x = 0 in the middle
    assert see_points([[*slanted, [-0.5, 0.0, 0.0]]]).confidence[0, 2] == pytest.approx(OCCLUDED_CONFIDENCE)
    assert see_points([[*slanted, [0.5, 0.0, 0.0]]]).confidence[0, 2] == 1


def test_a_bone_as_near_as_the_joint_belongs_to_the_same_flesh() -> None:
    bone = [[0.05, -0.5, 0.0], [0.05, 0.5, 0.0]]
    assert see_points([[*bone, [0.0, 0.0, 0.0]]]).confidence[0, 2] == 1


def test_another_person_hides_joints_and_the_own_bone_never_its_ends() -> None:
    along_the_ray = [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    assert see_points([along_the_ray]).confidence[0].tolist() == [1, 1, 1]
    in_front = [[2.0, -0.5, 0.0], [2.0, 0.5, 0.0], [2.0, 0.0, -1.0]]
    confidence = see_points([along_the_ray, in_front]).confidence
    np.testing.assert_allclose(confidence, [[OCCLUDED_CONFIDENCE, OCCLUDED_CONFIDENCE, 1], [1, 1, 1]])
    behind = see_points([along_the_ray, in_front], viewpoint=np.array([10.0, np.pi, LEVEL])).confidence
    np.testing.assert_allclose(behind[0], 1)


def test_the_trunk_is_thicker_than_a_limb() -> None:
    skeleton = Skeleton(("neck", "pelvis", "left_toe", "right_toe"), ((0, 1), (2, 3)))
    sensor = EstimatorSensor(skeleton=skeleton)
    between = (LIMB_RADIUS + TRUNK_RADIUS) / 2
    vertical = [[1.0, 0.0, -0.5], [1.0, 0.0, 0.5]]
    behind = [[-1.0, between, 0.0], [-1.0, -between, 0.0]]
    for order, expected in (([0, 1, 2, 3], OCCLUDED_CONFIDENCE), ([2, 3, 0, 1], 1.0)):
        positions = np.array(vertical + behind, dtype=np.float32)[order][None]
        confidence = sensor.sense(positions, FRONT, quiet((), 1, 4)).confidence
        np.testing.assert_allclose(confidence[0, np.argsort(order)[2:]], expected)


def test_an_occluded_joint_is_localised_four_times_worse() -> None:
    positions = np.array([[[1.0, -0.5, 0.0], [1.0, 0.5, 0.0], [-1.0, 0.0, 0.0]]], dtype=np.float32)
    count = 4000
    noise = draw_noise(np.random.default_rng(0), (count,), 1, 3)
    sensed = EstimatorSensor(skeleton=POINTS).sense(positions, np.tile(FRONT, (count, 1)), noise)
    deviation = sensed.joints_2d[:, 0].std(axis=0).mean(axis=1)
    assert deviation[2] / deviation[:2].mean() == pytest.approx(OCCLUDED_NOISE, rel=0.05)


@pytest.mark.parametrize("distance", [20.0, 40.0, 80.0])
def test_joints_of_small_persons_go_missing(distance: float) -> None:
    _, sensed = spread(4000, np.array([distance, 0.0, LEVEL]))
    height = 1.6 * FOCAL_LENGTH / distance
    missing = sensed.confidence == 0
    assert missing.mean() == pytest.approx(max(0, 1 - height / 60), abs=0.02)
    np.testing.assert_array_equal(sensed.joints_2d[missing], np.tile(CENTRE, (missing.sum(), 1)))


def test_joints_outside_the_image_or_behind_the_camera_are_missing() -> None:
    points = [[[0.0, 0.0, 0.0], [0.0, 9.0, 0.0], [12.0, 0.0, 0.0]]]
    sensed = see_points(points)
    assert sensed.confidence[0].tolist() == [1, 0, 0]
    np.testing.assert_array_equal(sensed.joints_2d[0, 1:], [CENTRE, CENTRE])
    assert np.isfinite(sensed.joints_2d).all()


def swap_share(viewpoint: list[float], skeleton: Skeleton = SKELETON) -> float:
    """Return how often a person is seen with left and right exchanged, with nothing else going wrong."""
    count = 4000
    noise = quiet((count,), 1, len(POSE))._replace(swap=np.random.default_rng(0).random((count, 1), dtype=np.float32))
    viewpoints = np.tile(np.array(viewpoint), (count, 1))
    exact, _ = project(POSE[None, None], viewpoints, Camera())
    sensed = EstimatorSensor(skeleton=skeleton).sense(POSE[None, None], viewpoints, noise)
    kept = np.isclose(sensed.joints_2d, exact, atol=1e-3).all(axis=(1, 2, 3))
    swapped = np.isclose(sensed.joints_2d, exact[:, :, [0, 2, 1, 3, 5, 4]], atol=1e-3).all(axis=(1, 2, 3))
    assert (kept ^ swapped).all()
    return float(swapped.mean())


def test_left_and_right_are_swapped_where_the_body_is_seen_edge_on() -> None:
    edge_on, oblique, wider, front = (swap_share([10, LEVEL - turn, LEVEL]) for turn in (1e-2, 0.2, 0.5, LEVEL))
    assert edge_on == pytest.approx(SWAP_PROBABILITY, abs=0.03)
    assert edge_on > oblique > 0
    assert oblique == pytest.approx(SWAP_PROBABILITY * (1 - np.sin(0.2) / 0.4), abs=0.03)
    assert wider == front == 0
    assert swap_share([10, LEVEL, 1e-3]) == 0, "from above the whole width is seen"


def test_a_skeleton_without_sides_is_never_swapped() -> None:
    names = tuple(f"joint{i}" for i in range(len(POSE)))
    sensor = EstimatorSensor(skeleton=Skeleton(names, SKELETON.bones))
    noise = quiet((1,), 1, len(POSE))._replace(swap=np.zeros((1, 1), dtype=np.float32))
    exact, _ = project(POSE[None, None], SIDE[None], Camera())
    np.testing.assert_allclose(sensor.sense(POSE[None, None], SIDE[None], noise).joints_2d, exact, atol=1e-3)


def crowd(leading: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray, SensorNoise]:
    """Return two persons in each of many frames, viewpoints near and far, and draws."""
    rng = np.random.default_rng(3)
    positions = POSE + rng.normal(0, 0.1, (*leading, 2, len(POSE), 3)) + np.array([[[0.5, 0, 0]], [[-0.5, 0, 0]]])
    viewpoints = PAPER.sample_starts(rng, int(np.prod(leading))).reshape(*leading, 3)
    viewpoints[..., 0] *= 2
    return positions.astype(np.float32), viewpoints, draw_noise(rng, leading, 2, len(POSE))


def test_a_batch_equals_its_frames_one_by_one() -> None:
    sensor = EstimatorSensor(skeleton=SKELETON)
    positions, viewpoints, noise = crowd((15, 10))  # more than a chunk
    sensed = sensor.sense(positions, viewpoints, noise)
    assert sensed.joints_2d.shape == (15, 10, 2, 6, 2)
    assert sensed.joints_2d.dtype == sensed.confidence.dtype == np.float32
    assert 0 < (sensed.confidence == 0).mean() < 0.5
    for index in np.ndindex(15, 10):
        alone = sensor.sense(positions[index], viewpoints[index], SensorNoise(*(draw[index] for draw in noise)))
        np.testing.assert_allclose(sensed.joints_2d[index], alone.joints_2d, rtol=1e-5, atol=1e-3)
        np.testing.assert_array_equal(sensed.confidence[index], alone.confidence)


def test_forks_share_the_motion_and_the_luck() -> None:
    sensor = EstimatorSensor(skeleton=SKELETON)
    positions, viewpoints, noise = crowd((8,))
    candidates = np.stack([viewpoints, viewpoints[::-1]], axis=1)
    forked = sensor.sense(positions[:, None], candidates, noise.forked())
    for fork in range(2):
        alone = sensor.sense(positions, candidates[:, fork], noise)
        np.testing.assert_allclose(forked.joints_2d[:, fork], alone.joints_2d, rtol=1e-5, atol=1e-3)
        np.testing.assert_array_equal(forked.confidence[:, fork], alone.confidence)


def test_the_same_draws_give_the_same_and_others_do_not() -> None:
    sensor = EstimatorSensor(skeleton=SKELETON)
    positions, viewpoints, noise = crowd((8,))
    once, again = sensor.sense(positions, viewpoints, noise), sensor.sense(positions, viewpoints, noise)
    np.testing.assert_array_equal(once.joints_2d, again.joints_2d)
    other = sensor.sense(positions, viewpoints, draw_noise(np.random.default_rng(9), (8,), 2, len(POSE)))
    assert not np.allclose(once.joints_2d, other.joints_2d, atol=0.1)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("skeleton", [SKELETON, Skeleton(SKELETON.joint_names, ())])
def test_torch_senses_what_numpy_senses(skeleton: Skeleton, monkeypatch: pytest.MonkeyPatch) -> None:
    positions, viewpoints, noise = crowd((200,))
    hidden = np.random.default_rng(0).random(positions.shape[:-1]) < 0.1
    draws = SensorNoise(*(read_only(part) for part in noise))  # as an episode hands them on
    by_numpy, by_torch = (EstimatorSensor(skeleton=skeleton, device=device) for device in (None, "cpu"))
    expected = by_numpy.sense(positions, viewpoints, draws, hidden)
    monkeypatch.setattr(estimator, "DEVICE_FRAMES", 64)
    sensed = by_torch.sense(positions, viewpoints, draws, hidden)
    np.testing.assert_array_equal(sensed.confidence, expected.confidence)
    np.testing.assert_allclose(sensed.joints_2d, expected.joints_2d, rtol=1e-6)
    assert (sensed.confidence == 0).any()
    assert by_torch.fingerprint() == by_numpy.fingerprint()  # as it decides nothing


def test_a_skeleton_without_bones_hides_nothing() -> None:
    sensor = EstimatorSensor(skeleton=Skeleton(("a", "b"), ()))
    positions = np.array([[[0.0, 0, 0], [1.0, 0, 0]]], dtype=np.float32)
    assert sensor.sense(positions, FRONT, quiet((), 1, 2)).confidence.tolist() == [[1, 1]]


def test_constants_can_be_overridden() -> None:
    sensor = EstimatorSensor(
        skeleton=SKELETON, relative_noise=0.0, noise_floor=0.0, swap_probability=0.0, limb_radius=0.0, trunk_radius=0.0
    )
    rng = np.random.default_rng(0)
    viewpoints = np.tile(FRONT, (20, 1))
    sensed = sensor.sense(POSE[None, None], viewpoints, draw_noise(rng, (20,), 1, len(POSE)))
    np.testing.assert_allclose(sensed.joints_2d, project(POSE[None, None], viewpoints, Camera())[0], atol=1e-3)
    np.testing.assert_array_equal(sensed.confidence, 1)
