import numpy as np
import pytest

from ehar.camera import Camera, project
from ehar.data.motion_data import MotionData
from ehar.data.scenario import split_parts, windows
from ehar.data.source import load_data
from ehar.data.synthetic import duo_activities, sets, solo_activities
from ehar.data.synthetic.body import CHANNELS, JOINT_NAMES, SKELETON, Body, mirrored, pose, to_channels
from ehar.data.synthetic.figure import lift, pulse
from ehar.data.synthetic.sets import duo, smooth_noise, solo

SETS = {"duo": duo, "solo": solo}
EXPECTED = {"duo": (2, 7, 25.0), "solo": (1, 10, 60.0)}
PELVIS, LEFT_HIP, RIGHT_HIP = (JOINT_NAMES.index(name) for name in ("pelvis", "left_hip", "right_hip"))
ANKLES = [JOINT_NAMES.index("left_ankle"), JOINT_NAMES.index("right_ankle")]
WRISTS = [JOINT_NAMES.index("left_wrist"), JOINT_NAMES.index("right_wrist")]
BODY = Body()

FRONT, SIDE, ABOVE = (8.0, 0.0, np.pi / 2), (8.0, np.pi / 2, np.pi / 2), (8.0, 0.0, 0.0)


@pytest.fixture(scope="module", params=sorted(SETS))
def data(request: pytest.FixtureRequest) -> MotionData:
    return load_data(request.param)  # made once for all tests


def still(**channels: float) -> np.ndarray:
    return pose(BODY, to_channels({name: np.array([value]) for name, value in channels.items()}, 1))[0]


def joint(joints: np.ndarray, name: str) -> np.ndarray:
    return joints[JOINT_NAMES.index(name)]


# --- the body


def test_at_rest_stands_upright_on_level_feet_and_is_its_own_mirror_image() -> None:
    joints = still()
    assert np.allclose(joints[ANKLES, 2], 0.08)
    assert joints[:, 2].argmax() == JOINT_NAMES.index("head")
    assert np.allclose(joints[SKELETON.mirror], joints * [1, -1, 1], atol=1e-12)
    assert joint(joints, "left_wrist")[1] > 0 > joint(joints, "right_wrist")[1]


def test_channels_move_what_they_say_to_where_they_say() -> None:
    rest = still()
    assert joint(still(right_flexion=np.pi / 2), "right_wrist")[0] == pytest.approx(BODY.upper_arm + BODY.forearm)
    raised = still(left_abduction=np.pi / 2)
    assert joint(raised, "left_wrist")[1] == pytest.approx(BODY.shoulder_half_width + BODY.upper_arm + BODY.forearm)
    elbow_up = still(right_flexion=np.pi / 2, right_elbow=np.pi / 2)
    assert joint(elbow_up, "right_wrist")[2] == pytest.approx(joint(elbow_up, "right_elbow")[2] + BODY.forearm)
    across = still(left_elbow=np.pi / 2, left_rotation=np.pi / 2)
    assert joint(across, "left_wrist")[1] < joint(rest, "left_wrist")[1]
    assert joint(still(bend=0.5), "head")[0] > joint(rest, "head")[0]
    assert joint(still(lean=0.5), "head")[1] > joint(rest, "head")[1]
    assert joint(still(tilt=0.5), "head")[1] > joint(rest, "head")[1]
    assert joint(still(nod=0.5), "head")[0] > joint(rest, "head")[0]
    assert joint(still(twist=0.5), "right_shoulder")[0] > joint(rest, "right_shoulder")[0]
    assert joint(still(right_step_out=0.3), "right_ankle")[1] < joint(rest, "right_ankle")[1]
    assert np.allclose(still(yaw=np.pi), rest * [-1, -1, 1], atol=1e-12)


def test_knees_bend_forward_and_planted_feet_stay_when_the_pelvis_sinks() -> None:
    sunk = still(rise=-0.3)
    assert np.allclose(sunk[ANKLES], still()[ANKLES])
    for side in ("left", "right"):
        middle = (joint(sunk, f"{side}_hip") + joint(sunk, f"{side}_ankle")) / 2
        assert joint(sunk, f"{side}_knee")[0] > middle[0] + 0.1


def test_any_movement_keeps_every_bone_as_long_as_the_body_says() -> None:
    rng = np.random.default_rng(0)
    joints = pose(BODY, rng.normal(scale=0.5, size=(200, len(CHANNELS))))
    lengths = bone_lengths(joints)
    assert np.ptp(lengths, axis=0).max() < 1e-9
    assert lengths[0, JOINT_NAMES.index("left_knee") - 1] == pytest.approx(BODY.thigh)
    assert lengths[0, JOINT_NAMES.index("right_wrist") - 1] == pytest.approx(BODY.forearm)


def test_mirrored_channels_make_the_mirror_image() -> None:
    channels = np.random.default_rng(1).normal(scale=0.4, size=(50, len(CHANNELS)))
    image = pose(BODY, mirrored(channels))
    assert np.allclose(image, pose(BODY, channels)[:, SKELETON.mirror] * [1, -1, 1], atol=1e-9)
    assert np.array_equal(mirrored(mirrored(channels)), channels)


def test_pulse_and_lift_are_periodic_and_a_foot_is_down_where_its_step_ends() -> None:
    phase = np.linspace(0, 3, 301)
    assert np.allclose(pulse(phase, 0.1, 0.6), pulse(phase + 2, 0.1, 0.6))
    assert pulse(np.array([0.35, 0.1, 0.7]), 0.1, 0.6) == pytest.approx([1, 0, 0], abs=1e-12)
    assert lift(np.array([0.25, 0.5, 0.8]), 0.0, 0.5) == pytest.approx([0, 0, 0], abs=1e-12)
    assert lift(phase, 0.0, 0.5).max() > 0.07


def test_smooth_noise_has_unit_variance_and_is_smooth() -> None:
    noise = smooth_noise(np.random.default_rng(0), 2000, 20, 8.0)
    assert noise.std() == pytest.approx(1.0, abs=0.08)
    assert np.diff(noise, axis=0).std() < 0.12


# --- the sets


def bone_lengths(joints: np.ndarray) -> np.ndarray:
    bones = SKELETON.bone_indices
    return np.linalg.norm(joints[..., bones[:, 0], :] - joints[..., bones[:, 1], :], axis=-1)


def test_has_the_form_that_everything_else_relies_on(data: MotionData) -> None:
    persons, classes, fps = EXPECTED[data.name]
    assert data.positions.shape == (data.offsets[-1], persons, 16, 3)
    assert data.positions.dtype == np.float32
    assert np.isfinite(data.positions).all()
    assert (len(data.class_names), data.fps) == (classes, fps)
    assert data.synthetic and data.title == f"{data.name} (synthetic)"
    assert data.subjects.shape == (len(data.labels), persons)
    assert len(set(data.sequence_names)) == len(data.sequence_names) == len(data.labels)
    assert data.skeleton.joint_names == JOINT_NAMES
    assert (data.skeleton.mirror != np.arange(16)).sum() == 12


def test_bones_keep_their_length(data: MotionData) -> None:
    for index in range(len(data.labels)):
        assert np.ptp(bone_lengths(data.sequence(index)), axis=0).max() < 1e-4


def test_every_class_is_trained_and_tested_on_different_actors(data: MotionData) -> None:
    assert data.is_test is not None
    for label in range(len(data.class_names)):
        assert ((data.labels == label) & ~data.is_test).sum() == 20
        assert ((data.labels == label) & data.is_test).sum() == 20
    parts = split_parts(data)
    people: set[int] = set()
    for part, casts in ((parts.recogniser, 7), (parts.policy, 10), (parts.validation, 3), (parts.test, 20)):
        assert set(data.labels[part]) == set(range(len(data.class_names)))
        assert len(np.unique(data.subjects[part], axis=0)) == casts
        assert not people & set(data.subjects[part].flat)
        people |= set(data.subjects[part].flat)


def test_more_casts_would_change_none_of_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    few = load_data("solo")
    monkeypatch.setattr(sets, "TEST_CASTS", sets.TEST_CASTS + 2)
    many = solo()
    names = {name: index for index, name in enumerate(many.sequence_names)}
    assert len(many.labels) == len(few.labels) + 20
    for index, name in enumerate(few.sequence_names):
        assert np.array_equal(few.sequence(index), many.sequence(names[name]))


def test_every_cast_and_every_sequence_has_a_generator_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    first: list[float] = []
    make = np.random.default_rng

    def noted(seed: object) -> np.random.Generator:
        first.append(make(seed).random())  # numpy fills up seeds with zeros: some that differ begin the same stream
        return make(seed)

    monkeypatch.setattr(sets.np.random, "default_rng", noted)
    solo()
    assert len(first) == len(set(first)) == 40 + 400


def test_is_long_enough_for_short_and_long_episodes(data: MotionData) -> None:
    test = split_parts(data).test
    assert 250 <= len(windows(data, test, 60, 60)) <= 600
    assert (data.lengths >= 60).all()
    assert set(data.labels[data.lengths >= 150]) == set(range(len(data.class_names)))


@pytest.mark.parametrize("name", sorted(SETS))
def test_seed_decides_every_byte(name: str) -> None:
    one, again, other = (SETS[name](seed=seed).sha256 for seed in (3, 3, 4))
    assert one == again != other


def test_feet_are_on_the_floor_and_heads_are_up(data: MotionData) -> None:
    lower_ankle = data.positions[:, :, ANKLES, 2].min(axis=-1)
    assert lower_ankle.min() > 0.05
    assert np.quantile(lower_ankle, 0.99) < 0.12
    head = data.positions[:, :, JOINT_NAMES.index("head"), 2]
    assert head.min() > 1.1 and head.max() < 2.3


def test_nothing_moves_faster_than_people_do(data: MotionData) -> None:
    for index in range(len(data.labels)):
        speed = np.linalg.norm(np.diff(data.sequence(index), axis=0), axis=-1) * data.fps
        assert speed.max() < 12.0  # [m/s], the fastest punches


def test_faces_every_way(data: MotionData) -> None:
    across = np.array(
        [data.sequence(i)[0, 0, LEFT_HIP] - data.sequence(i)[0, 0, RIGHT_HIP] for i in range(len(data.labels))]
    )
    sectors = np.floor(np.arctan2(across[:, 1], across[:, 0]) / (np.pi / 4)).astype(int)
    assert np.bincount(sectors + 4, minlength=8).min() > len(data.labels) / 24


def test_partners_face_each_other_and_do_not_run_into_each_other() -> None:
    data = duo()
    between = data.positions[:, 1, PELVIS] - data.positions[:, 0, PELVIS]
    assert np.linalg.norm(between[:, :2], axis=-1).min() > 0.5
    hands = data.positions[:, :, WRISTS].mean(axis=2) - data.positions[:, :, PELVIS]
    assert ((hands[:, 0] * between).sum(axis=-1) > 0).mean() > 0.99
    assert ((hands[:, 1] * between).sum(axis=-1) < 0).mean() > 0.99


# --- what a viewpoint shows


def seen_difference(first: np.ndarray, second: np.ndarray, viewpoint: tuple[float, float, float]) -> float:
    """Root mean square difference [px] between what a camera sees of two motions (T, P, J, 3)."""
    centre = np.concatenate([first, second]).mean(axis=(0, 1, 2))
    seen = [project(motion - centre, np.array(viewpoint), Camera())[0] for motion in (first, second)]
    return float(np.sqrt(((seen[0] - seen[1]) ** 2).mean()))


def solo_motion(name: str) -> np.ndarray:
    phase = np.linspace(0, 1, 60, endpoint=False)
    return pose(BODY, to_channels(solo_activities.perform(solo_activities.ACTIVITIES[name], phase), 60))[:, None]


def duo_motion(name: str) -> np.ndarray:
    phase = np.linspace(0, 1, 60, endpoint=False)
    gestures = duo_activities.perform(duo_activities.ACTIVITIES[name], phase)
    leader, follower = (pose(BODY, to_channels(gesture, 60)) for gesture in gestures)
    return np.stack([leader - [0.65, 0, 0], follower * [-1, -1, 1] + [0.65, 0, 0]], axis=1)


@pytest.mark.parametrize(
    ("motion", "pair", "hidden_from", "shown_from"),
    [
        (solo_motion, ("mambo", "rock_back"), FRONT, SIDE),
        (solo_motion, ("jazz_square", "charleston"), FRONT, SIDE),
        (solo_motion, ("mambo", "cross_step"), SIDE, FRONT),
        (solo_motion, ("side_touch", "twist"), SIDE, FRONT),
        (solo_motion, ("sailor", "charleston"), ABOVE, SIDE),
        (duo_motion, ("promenade", "breakaway"), FRONT, SIDE),
        (duo_motion, ("arch", "windmill"), FRONT, SIDE),
        (duo_motion, ("promenade", "arch"), SIDE, FRONT),
        (duo_motion, ("breakaway", "windmill"), SIDE, FRONT),
        (duo_motion, ("promenade", "cradle"), ABOVE, SIDE),
    ],
)
def test_what_tells_two_activities_apart_is_hidden_from_one_side(motion, pair, hidden_from, shown_from) -> None:
    first, second = (motion(name) for name in pair)
    assert seen_difference(first, second, shown_from) > 2 * seen_difference(first, second, hidden_from)


def test_the_good_viewpoint_changes_within_a_figure() -> None:
    for motion, first, second in ((solo_motion, "mambo", "sailor"), (duo_motion, "promenade", "windmill")):
        early, late = slice(0, 30), slice(30, 60)
        one, other = motion(first), motion(second)
        assert seen_difference(one[early], other[early], SIDE) > 1.5 * seen_difference(one[early], other[early], FRONT)
        assert seen_difference(one[late], other[late], FRONT) > 1.5 * seen_difference(one[late], other[late], SIDE)
