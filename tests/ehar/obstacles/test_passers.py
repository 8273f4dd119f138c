"""People who pass: they are recorded bodies, walk where no camera is, and hide what is behind their limbs."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.data.scenario import Scenarios, windows
from ehar.data.surroundings import surroundings_of
from ehar.flight.centre import centre_limits
from ehar.flight.vehicle import VEHICLES
from ehar.obstacles import Obstacles, Surroundings
from ehar.obstacles.passers import PASSER_RADIUS, UNDETECTED, Passers
from ehar.obstacles.shapes import Cylinder, passes_by, passes_through
from ehar.world import CROWD
from tests.helpers.fakes import POSE, SKELETON, tiny_data
from tests.helpers.passers import standing
from tests.helpers.streams import raising_streams

BEHIND, ASIDE = np.array([6.0, 0.0, np.pi / 2]), np.array([6.0, np.pi / 2, np.pi / 2])
EPISODES, LENGTH = 6, 200


def scenarios(frames: int = LENGTH) -> Scenarios:
    return windows(tiny_data(sequences=6, frames=frames), np.arange(6), LENGTH, 1)


def passers(seed: int = 0) -> Passers:
    around = surroundings_of(scenarios(), np.arange(EPISODES), CROWD, np.random.default_rng(seed))
    assert around is not None and around.passers is not None
    return around.passers


def test_they_walk_straight_past_people_and_never_where_cameras_are() -> None:
    walked = passers()
    assert walked.place.shape == (6, 200, 4, 2)
    speed = np.linalg.norm(np.diff(walked.place, axis=1), axis=-1) * 25
    assert np.quantile(speed, 0.1) > 0.99 and speed.max() < 1.61  # at the ends of their ways they turn round
    away = np.linalg.norm(walked.place, axis=-1)
    assert away.max() <= CROWD.passing_reach + 1e-9
    assert away.max() + PASSER_RADIUS + 0.3 <= CROWD.workspace.distance_min + 1e-9
    assert (away.min(axis=1) >= 0.7 - 1e-9).all()
    turns = np.abs(np.diff(walked.place, n=2, axis=1)).max(axis=-1) > 1e-9
    assert turns.mean() < 0.03
    error = walked.tracked[..., :2] - walked.place
    assert error.std() == pytest.approx(0.05, rel=0.1) and abs(error.mean()) < 0.005
    ahead = walked.tracked[:, :-5, :, :2] + 0.2 * walked.tracked[:, :-5, :, 2:] - walked.place[:, 5:]
    assert np.median(np.linalg.norm(ahead, axis=-1)) < 0.1
    steps = np.diff(walked.place, axis=1) * 25
    pace = np.linalg.norm(steps, axis=-1)
    straight = pace > pace.max(axis=1, keepdims=True) - 1e-6  # in the others a passer-by turned round
    wrong = (walked.tracked[:, 1:, :, 2:] - steps)[straight]  # what is told tells of no turn that is yet to come
    assert wrong.std() == pytest.approx(0.1, rel=0.05) and np.abs(wrong).max() < 0.6 and (~straight).sum() > 20
    for name, array in passers().arrays.items():
        np.testing.assert_array_equal(array, walked.arrays[name])
        assert not np.array_equal(passers(1).arrays[name], array)


def test_those_whom_cameras_may_meet_begin_away_from_them_and_walk_farther() -> None:
    world = replace(CROWD, passers_reach=9.0, passers_by=20)
    around = surroundings_of(scenarios(), np.arange(EPISODES), world, np.random.default_rng(0))
    assert around is not None and around.passers is not None and around.passers.met and around.can_be_hit
    walked = around.passers.place
    away = np.linalg.norm(walked, axis=-1)
    assert away[:, 0].max() < CROWD.passing_reach - 2.4
    assert away.max() <= 9 + 1e-9 and (away[:, -1] > CROWD.workspace.distance_min).mean() > 0.3
    steps = np.diff(walked, axis=1) * 25
    assert np.linalg.norm(steps, axis=-1).max() < 1.61
    assert np.abs(around.passers.tracked[:, 1:, :, 2:] - steps).mean() < 0.1
    outwards = (walked[:, 0] * steps[:, 0]).sum(axis=-1) > 0
    assert 0.3 < outwards.mean() < 0.7


def test_they_are_people_of_other_sequences_as_they_were_recorded() -> None:
    walked, data = passers(), scenarios().data
    sequence = np.searchsorted(data.offsets, walked.posture, side="right") - 1
    assert (sequence == sequence[:, :1]).all()  # one person each
    assert (sequence[:, 0] != np.arange(EPISODES)[:, None]).all() and len(np.unique(sequence)) == 6
    assert (np.abs(np.diff(walked.posture, axis=1)) == 1).all()  # frame by frame, to and fro
    assert not walked.bodies.joints.flags.writeable and data.positions.flags.writeable
    joints = walked.joints(7)
    recorded = data.positions[walked.posture[:, 7], 0]
    for one, other in ((0, 4), (3, 5), (1, 2)):
        np.testing.assert_allclose(
            np.linalg.norm(joints[..., one, :] - joints[..., other, :], axis=-1),
            np.linalg.norm(recorded[..., one, :] - recorded[..., other, :], axis=-1),
            atol=1e-5,
        )
    np.testing.assert_allclose(joints[..., :2].mean(axis=2), walked.place[:, 7], atol=1e-5)
    lowest = walked.joints(slice(None))[..., 2].min(axis=(1, 3))
    floor = scenarios().positions(np.arange(EPISODES))[:, 0, ..., 2].min(axis=(1, 2))
    above = lowest - floor[:, None]  # not every frame of a sequence is shown
    assert above.min() > -1e-5 and above.max() < 0.02 and (np.abs(above) < 1e-5).sum() > 10


def test_in_a_stream_they_stay_on_the_floor_while_people_lie_down() -> None:
    data = raising_streams()
    within = np.concatenate([np.arange(length) for length in data.lengths])
    lying = data.positions * np.where((within < 30)[:, None, None, None], 1, [1, 1, 0.2])
    streams = windows(replace(data, positions=lying.astype(np.float32)), np.arange(3), 90, 200)
    around = surroundings_of(streams, np.arange(2), CROWD, np.random.default_rng(0))
    assert around is not None and around.passers is not None and around.moved is not None
    assert around.moved[:, -1, 2].max() < -0.05
    recorded = streams.data.positions[around.passers.posture, 0][..., 2]  # (B, L, W, J)
    higher = around.passers.joints(slice(None))[..., 2] + around.moved[:, :, None, None, 2] - recorded
    np.testing.assert_allclose(higher, np.broadcast_to(higher[:, :1, :, :1], higher.shape), atol=1e-5)


@pytest.mark.parametrize("begin", [0, 60])
def test_around_a_vehicle_they_stand_on_the_same_floor_as_on_the_grid(begin: int) -> None:
    data = raising_streams()
    within = np.concatenate([np.arange(length) for length in data.lengths])
    sinking = data.positions + np.float32([0, 0, 1]) * np.sin(within / 9)[:, None, None, None].astype(np.float32)
    streams = windows(replace(data, positions=sinking), np.arange(3), 40, 200)
    streams = replace(streams, first=streams.first + begin)
    floors = []
    for limits in (None, centre_limits(VEHICLES["px4-auto"])):
        watched = replace(streams, limits=limits)
        around = surroundings_of(watched, np.arange(2), CROWD, np.random.default_rng(0))
        assert around is not None and around.passers is not None
        floors.append(around.passers.lift[:, 0] + watched.centres(np.arange(2))[:, 0, None, 2])
        gaze = watched.gaze(np.arange(2))
    assert gaze is not None and (np.abs(gaze[:, 0, 2]).max() > 0.01) == (begin > 0)
    np.testing.assert_allclose(*floors, atol=1e-6)


def test_they_face_where_they_walk() -> None:
    walked = passers()
    velocity = walked.tracked[..., 2:]
    heading = SKELETON.heading(walked.joints(slice(None)))
    away = heading - np.arctan2(velocity[..., 1], velocity[..., 0])
    assert np.abs(np.angle(np.exp(1j * away))).max() < 0.7  # what is tracked is off by 0.1 m/s on each axis
    assert np.median(np.abs(np.angle(np.exp(1j * away)))) < 0.1
    assert SKELETON.heading(POSE) == pytest.approx(0.0) and SKELETON.heading(POSE[:, [1, 0, 2]]) == pytest.approx(
        -np.pi / 2
    )


def test_a_body_hides_what_is_behind_its_limbs_and_nothing_beside() -> None:
    around = Surroundings(Obstacles(), None, standing(np.array([[2.0, 0.0]])))
    # Behind the trunk, a shoulder, beside the trunk, between the feet, over the head. A body 2 m before these points,
    # which a camera sees from 6 m, is in the way at two thirds of their places.
    points = np.array([[0, 0, 0.5], [0, 0.3, 0.75], [0, 0.3, 0], [0, 0, -1.3], [0, 0, 1.4]])
    assert around.hide(BEHIND[None], points[None, None], 0)[0, 0].tolist() == [True, True, False, False, False]
    sideways = Surroundings(Obstacles(), None, standing(np.array([[2.0, 0.0]]), turn=np.pi / 2))
    assert sideways.hide(BEHIND[None], points[None, None], 0)[0, 0].tolist() == [True, False, False, True, False]
    assert not around.hide(ASIDE[None], points[None, None], 0).any()
    assert not around.hide(np.array([[6.0, 0.0, 0.5]]), points[None, None], 0).any()  # from above
    nearer = np.array([[[[3.0, 0, 0.5], [2.5, 0, 0.5]]]])
    assert not around.hide(BEHIND[None], nearer, 0).any()
    assert np.isinf(around.clearance(BEHIND[None], 0)).all()


def test_a_track_takes_who_hides_somebody_for_them() -> None:
    """From 6 m: a passer-by 1.5 m before a person appears 1.33 times as large, 2.5 m before them 1.71 times."""
    person, viewpoint = POSE[None, None].astype(np.float32), BEHIND[None]
    pillar = Obstacles(cylinders=(Cylinder(centre=(2.0, 0.0, -1.0), radius=0.05, height=9.0),))
    for before, is_taken in ((1.5, True), (2.5, False)):
        walker = replace(standing(np.array([[0.0, -3.0], [before, 0.0]]), turn=0.3), mistakable=True)
        around = Surroundings(Obstacles(), None, walker)
        true = around.hide(viewpoint, person, 0)
        assert true.mean() > UNDETECTED
        joints, hidden = around.show(viewpoint, person, 0)
        np.testing.assert_allclose(joints, walker.joints(0)[:, 1:] if is_taken else person)
        np.testing.assert_array_equal(hidden, true & (not is_taken))
        behind = replace(around, obstacles=pillar).show(viewpoint, person, 0)[1]
        assert behind.any() and (hidden | behind == behind).all()  # a pillar hides whoever is taken for the person
        for other in (replace(walker, mistakable=False), None):
            joints, hidden = Surroundings(Obstacles(), None, other).show(viewpoint, person, 0)
            assert joints is person and (hidden == (true & (other is not None))).all()
        joints, hidden = around.show(ASIDE[None], person, 0)  # from there one is beside the other
        assert not hidden.any() and (joints == person).all()
        gaze = np.array([[0.3, 0.0, 0.0]])  # what cameras look at is beside the centre, and joints relative to it
        shifted, _ = around.show(viewpoint, person - gaze[:, None, None].astype(np.float32), 0, gaze)
        np.testing.assert_allclose(shifted + gaze[:, None, None], around.show(viewpoint, person, 0)[0], atol=1e-6)


def test_of_two_people_one_may_be_taken_for_a_passer_by_and_forks_see_alike() -> None:
    walker = replace(standing(np.array([[1.5, 0.0]])), mistakable=True)
    around, couple = Surroundings(Obstacles(), None, walker), POSE + np.array([[[0, 0, 0]], [[0, 2, 0]]])[None]
    joints, hidden = around.show(BEHIND[None], couple, 0)
    np.testing.assert_allclose(joints[:, 0], walker.joints(0)[:, 0])
    np.testing.assert_allclose(joints[:, 1], couple[:, 1])
    assert not hidden.any()
    forks = np.stack([BEHIND, ASIDE])[None]
    forked = around.show(forks, couple[:, None], 0)
    for fork in range(2):
        for part, alone in zip(forked, around.show(forks[:, fork], couple, 0), strict=True):
            np.testing.assert_allclose(part[:, fork], alone)


def test_frames_forks_parts_and_joined_batches_hide_alike() -> None:
    rng, walked = np.random.default_rng(0), passers()
    around = Surroundings(Obstacles(), None, walked)
    cameras = CROWD.sample_starts(rng, EPISODES * LENGTH).reshape(EPISODES, LENGTH, 3)
    joints = scenarios().positions(np.arange(EPISODES))
    together = around.hide(cameras, joints, slice(None))
    assert 0.002 < together.mean() < 0.2
    forks = np.stack([cameras[:, 9], cameras[:, 10]], axis=1)
    for frame in (0, 9, 150):
        np.testing.assert_array_equal(around.hide(cameras[:, frame], joints[:, frame], frame), together[:, frame])
        forked = around.hide(forks, joints[:, None, frame], frame)
        for fork in range(2):
            alone = around.hide(forks[:, fork], joints[:, frame], frame)
            np.testing.assert_array_equal(forked[:, fork], alone)
    rows = np.array([4, 1])
    np.testing.assert_array_equal(
        around.select(rows, 50).hide(cameras[rows, :50], joints[rows, :50], slice(None)), together[rows, :50]
    )
    twice = Surroundings.joined([around.select(slice(0, 2)), around.select(slice(2, None)).protected()])
    assert twice is not None
    np.testing.assert_array_equal(twice.hide(cameras, joints, slice(None)), together)


def test_ways_through_a_capsule_are_those_that_some_point_of_it_is_near_to() -> None:
    """The least distance of two segments, against that of a thousand points on each."""
    rng = np.random.default_rng(0)
    begin, end, first, last = rng.normal(size=(4, 300, 3))
    last[:30] = first[:30]  # a ball
    last[30:60] = first[30:60] + (end - begin)[30:60]  # parallel
    share = np.linspace(0, 1, 1001)[:, None, None]
    ways = begin + share * (end - begin)
    axis = last - first
    along = ((ways - first) * axis).sum(-1) / np.maximum((axis**2).sum(-1), 1e-12)
    away = np.linalg.norm(ways - first - np.clip(along, 0, 1)[..., None] * axis, axis=-1).min(axis=0)
    for radius in (0.1, 0.5, 1.0):
        clear = np.abs(away - radius) > 0.005
        found = passes_through(begin, end, first, last, np.array(radius))
        np.testing.assert_array_equal(found[clear], (away < radius)[clear])
        assert 0.02 < found.mean() < 0.98 and clear.mean() > 0.9
        flat = np.linalg.norm((ways - first)[..., :2], axis=-1).min(axis=0)
        clear = np.abs(flat - radius) > 0.005
        near = passes_by(begin, end, first[:, :2], np.full(300, radius))
        np.testing.assert_array_equal(near[clear], (flat < radius)[clear])


def test_bodies_of_one_frame_and_a_lone_sequence_pass_as_well() -> None:
    alone = windows(tiny_data(sequences=1, frames=1), np.arange(1), 1, 1)
    around = surroundings_of(alone, np.zeros(2, dtype=np.int64), CROWD, np.random.default_rng(0))
    assert around is not None and around.passers is not None
    assert (around.passers.posture == 0).all()
    assert np.isfinite(around.passers.joints(0)).all()
