"""The front of people: of one, of several who face one way, of two who face each other, and of nobody."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.arrays import FloatArray
from ehar.data.skeleton import Skeleton
from ehar.data.synthetic.body import SKELETON as BODY
from ehar.viewpoint import wrap_difference
from planners.place.people import azimuths_at, trunk_of
from tests.helpers.examples import share_of_examples
from tests.helpers.fakes import SKELETON

ANGLE = st.floats(-3.1, 3.1)


def fronts(
    facing: list[float], std: float | list[float], place: list[tuple[float, float]] | None = None, angle: float = 0.0
) -> FloatArray:
    """Return the azimuths under an angle from the front of one episode, (4,)."""
    position = np.zeros((1, len(facing), 3))
    position[0, :, :2] = np.zeros((len(facing), 2)) if place is None else place
    return azimuths_at(angle, np.array([facing]), np.broadcast_to(std, (1, len(facing))), position)[0]


def assert_same_angle(found: FloatArray, expected: FloatArray | float, tolerance: float = 1e-9) -> None:
    np.testing.assert_allclose(wrap_difference(found - np.asarray(expected)), 0, atol=tolerance)


def test_the_trunk_is_where_limbs_join_it() -> None:
    names = tuple(SKELETON.joint_names[joint] for joint in trunk_of(SKELETON).ravel())
    assert names == ("left_shoulder", "right_shoulder", "left_foot", "right_foot")  # its feet hang on the pelvis
    names = tuple(BODY.joint_names[joint] for joint in trunk_of(BODY).ravel())
    assert names == ("left_shoulder", "right_shoulder", "left_hip", "right_hip")


def test_a_trunk_needs_mirrored_joints_but_no_bones() -> None:
    assert trunk_of(replace(SKELETON, bones=())).tolist() == [[1, 2], [4, 5]]
    assert trunk_of(Skeleton(("head", "hand", "tail"), ((0, 1), (1, 2)))).shape == (0, 2)


@share_of_examples(0.3)
@given(facing=ANGLE, std=st.floats(0, 1.1))
def test_the_front_of_one_person_is_where_it_faces(facing: float, std: float) -> None:
    assert_same_angle(fronts([facing], std), facing)


@pytest.mark.parametrize("std", [1.2, 1.8])
def test_an_uncertain_front_is_not_known(std: float) -> None:
    assert np.isnan(fronts([0.3], std)).all()
    assert np.isnan(fronts([0.3, 0.5], std, [(0, 0), (1, 0)])).all()


@share_of_examples(0.3)
@given(facing=ANGLE, between=st.floats(-1.9, 1.9))
def test_the_front_of_people_who_face_one_way_is_halfway(facing: float, between: float) -> None:
    assert_same_angle(fronts([facing, facing + between], 0.1, [(0, 0), (1, 1)]), facing + between / 2, 1e-6)


@share_of_examples(0.3)
@given(facing=ANGLE, angle=st.floats(0, 3.1))
def test_views_under_an_angle_lie_on_both_sides_of_the_front(facing: float, angle: float) -> None:
    assert_same_angle(fronts([facing], 0.2, angle=angle)[:2], np.array([facing + angle, facing - angle]))


@share_of_examples(0.5)
@given(line=ANGLE, inwards=st.booleans(), off=st.floats(-0.4, 0.4), angle=st.sampled_from([0, 30, 90, 150, 180]))
def test_people_who_face_each_other_are_seen_across_the_line_between_them(
    line: float, inwards: bool, off: float, angle: float
) -> None:
    way = np.array([np.cos(line), np.sin(line)])
    facing = [line, line + np.pi] if inwards else [line + np.pi, line]
    stand = [tuple(-0.5 * way), tuple(0.5 * way)]
    found = fronts([facing[0] + off, facing[1]], 0.1, stand, np.radians(angle))
    assert_same_angle(2 * found, 2 * (line + np.pi / 2), 1e-6)
    assert_same_angle(np.ptp(np.unwrap(np.sort(found % (2 * np.pi)))), np.pi, 1e-6)


@pytest.mark.parametrize("angle", [45, 60, 135])
def test_views_of_people_who_face_each_other_are_counted_from_both_ends_of_the_line(angle: float) -> None:
    found = fronts([0.0, np.pi], 0.1, [(-1, 0), (1, 0)], np.radians(angle))
    expected = np.radians([angle, -angle, 180 + angle, 180 - angle])
    np.testing.assert_allclose(np.sort(found % (2 * np.pi)), np.sort(expected % (2 * np.pi)), atol=1e-9)


def test_people_who_face_each_other_on_one_spot_have_no_front() -> None:
    assert np.isnan(fronts([0.0, np.pi], 0.1, [(0, 0), (0.1, 0)])).all()


def test_a_person_whose_facing_is_unknown_says_nothing() -> None:
    # One of the two is known to look along the line; the other may look at the same thing, or back.
    found = fronts([0.0, 2.0], [0.1, 1.8], [(0, 0), (1, 0)])
    assert_same_angle(2 * found, np.pi, 1e-6)


@share_of_examples(0.5)
@given(facing=st.lists(ANGLE, min_size=1, max_size=3), turn=ANGLE, angle=st.floats(0, np.pi), seed=st.integers(0, 1000))
def test_views_turn_and_are_mirrored_with_the_people(facing: list[float], turn: float, angle: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    place, std, seen = rng.normal(size=(1, len(facing), 3)), rng.uniform(0, 1.5, (1, len(facing))), np.array([facing])
    x, y, z = np.moveaxis(place, -1, 0)
    cos, sin = np.cos(turn), np.sin(turn)
    found = azimuths_at(angle, seen, std, place)
    mirrored = azimuths_at(angle, -seen, std, np.stack([x, -y, z], axis=-1))
    turned = azimuths_at(angle, seen + turn, std, np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=-1))
    for other, expected in ((mirrored, -found), (turned, found + turn)):
        assert np.isnan(other).tolist() == np.isnan(expected).tolist()
        if np.isfinite(other).all():  # the same views, in any order
            apart = np.abs(wrap_difference(other[0][:, None] - expected[0]))
            assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-6
