"""Variations of recorded motion."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from ehar.data.skeleton import Skeleton, counterparts
from ehar.data.source import load_data
from ehar.data.streams.data import NO_ACTIVITY
from ehar.data.variations import PACES, SIZES, TURN, with_stream_variations, with_turned_trunks, with_variations
from tests.helpers.fakes import CLASS_NAMES, SKELETON, tiny_data
from tests.helpers.streams import raising_streams

LEG = ("hip", "knee", "ankle", "foot", "toe")


def test_each_sequence_is_followed_by_its_variations() -> None:
    data = tiny_data(sequences=6, frames=40)
    varied = with_variations(data, np.array([1, 4]), 3)
    assert varied.sequence_names == tuple(
        f"sequence-{i}{suffix}" for i in (1, 4) for suffix in ("", " (1)", " (2)", " (3)")
    )
    assert len(varied.labels) == len(varied.subjects) == len(varied.lengths) == 8
    assert varied.offsets[-1] == len(varied.positions)
    assert varied.positions.dtype == np.float32
    for row, index in ((0, 1), (4, 4)):
        np.testing.assert_array_equal(varied.sequence(row), data.sequence(index))


def test_without_variations_the_sequences_are_as_they_were() -> None:
    data = tiny_data(sequences=6)
    kept = with_variations(data, np.array([5, 2]), 0)
    np.testing.assert_array_equal(kept.positions, np.concatenate([data.sequence(5), data.sequence(2)]))
    np.testing.assert_array_equal(kept.labels, data.labels[[5, 2]])


def test_who_raises_the_left_raises_the_right_in_the_mirror() -> None:
    data = tiny_data(sequences=6)  # the class is the joint that is raised
    varied = with_variations(data, np.arange(6), 2)
    raised = np.array([varied.sequence(i)[..., 2].mean(axis=(0, 1))[:3] for i in range(len(varied.labels))])
    np.testing.assert_array_equal(raised.argmax(axis=1), varied.labels)
    of_left = varied.labels[3:6]
    np.testing.assert_array_equal(of_left, [1, 2, 1])  # left, its mirror image, and a variation that is not mirrored


def test_a_mirrored_body_has_its_left_on_its_left() -> None:
    data = replace(tiny_data(sequences=3), labels=np.zeros(3, dtype=int))
    left, right = SKELETON.joint_names.index("left_foot"), SKELETON.joint_names.index("right_foot")
    varied = with_variations(data, np.array([0]), 1)
    before, after = varied.sequence(0)[0, 0], varied.sequence(1)[0, 0]
    size = (after[left] - after[right])[1] / (before[right] - before[left])[1]
    assert SIZES[0] <= abs(size) <= SIZES[1]
    np.testing.assert_allclose(after[left] * [-1, 1, 1], before[right] * abs(size), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("label", [1, 2])
def test_a_class_of_one_side_without_its_counterpart_is_not_mirrored(label: int) -> None:
    data = replace(tiny_data(sequences=6), class_names=("nod", "wave-left", "circle-clockwise"))
    one_sided = with_variations(data, np.array([label]), 2)
    assert (one_sided.labels == label).all()
    highest = [one_sided.sequence(i)[..., 2].mean(axis=(0, 1))[:3].argmax() for i in range(3)]
    assert highest == [label] * 3


@pytest.mark.parametrize(
    "names", [("nod", "raise_your_hand", "raise_your_other_hand"), ("Mother", "Raise", "RaiseOther")]
)
def test_one_hand_and_the_other_are_not_mirrored(names: tuple[str, ...]) -> None:
    data = replace(tiny_data(sequences=6), class_names=names)
    varied = with_variations(data, np.array([1, 2]), 1)
    highest = [varied.sequence(i)[..., 2].mean(axis=(0, 1))[:3].argmax() for i in range(4)]
    assert highest == [1, 1, 2, 2] == varied.labels.tolist()
    left, right = SKELETON.joint_names.index("left_foot"), SKELETON.joint_names.index("right_foot")
    nods = with_variations(data, np.array([0]), 1)
    before, after = nods.sequence(0)[0, 0], nods.sequence(1)[0, 0]
    assert (after[left] - after[right])[1] * (before[left] - before[right])[
        1
    ] < 0  # what is not one of them is mirrored


def test_paces_and_sizes_are_those_that_people_have() -> None:
    data = tiny_data(sequences=3, frames=400)
    varied = with_variations(data, np.arange(3), 20, seed=3)
    lengths = varied.lengths.reshape(3, 21)
    assert (lengths[:, 0] == 400).all()
    pace = 400 / lengths[:, 1:]
    assert PACES[0] - 0.01 <= pace.min() < 0.95
    assert 1.05 < pace.max() <= PACES[1] + 0.01
    for index in range(63):
        limb = np.linalg.norm(varied.sequence(index)[:, 0, 3] - varied.sequence(index)[:, 0, 4], axis=-1).mean()
        original = np.linalg.norm(data.sequence(index // 21)[:, 0, 3] - data.sequence(index // 21)[:, 0, 4], axis=-1)
        assert SIZES[0] - 0.02 <= limb / original.mean() <= SIZES[1] + 0.02


def test_the_same_seed_draws_the_same() -> None:
    data = tiny_data(sequences=6)
    first, again, other = (with_variations(data, np.arange(6), 2, seed=seed).positions for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert first.shape != other.shape or not np.array_equal(first, other)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (CLASS_NAMES, [0, 2, 1]),
        (("walk-turn-left", "run", "walk-turn-right"), [2, 1, 0]),
        (("raise-left-hand", "run"), [0, 1]),
        (("lead", "read", "lock", "rock"), [0, 1, 2, 3]),
    ],
)
def test_counterparts_of_class_names(names: tuple[str, ...], expected: list[int]) -> None:
    np.testing.assert_array_equal(counterparts(names, joints=False), expected)


def test_variations_of_streams_keep_what_is_shown_when() -> None:
    """In a second of which a joint is raised that joint is the highest, whatever the pace, the size and the side."""
    data = raising_streams()
    data.missing[130:140] = True
    varied = with_stream_variations(data, np.array([4, 1]), 2)
    assert varied.sequence_names == tuple(f"stream-{i}{suffix}" for i in (4, 1) for suffix in ("", " (1)", " (2)"))
    np.testing.assert_array_equal(varied.sequence(3), data.sequence(1))
    np.testing.assert_array_equal(varied.labels[varied.offsets[3] : varied.offsets[4]], data.labels[120:240])
    assert len(varied.segments) == 6 * 6 and varied.is_test is None and varied.fps == data.fps
    highest = varied.positions[:, 0, :3, 2].argmax(axis=1)
    shown = varied.labels != NO_ACTIVITY
    assert (highest == varied.labels)[shown].mean() > 0.97  # a frame at an edge is interpolated
    plain, mirrored, other = (varied.segments[6 * row : 6 * row + 6, 2] for row in range(3))
    np.testing.assert_array_equal(mirrored, np.array([0, 2, 1])[plain])  # left becomes right
    np.testing.assert_array_equal(other, plain)
    for row in (1, 2, 4, 5):
        assert not np.array_equal(varied.lengths[row], 120) and 120 / 1.18 - 1 < varied.lengths[row] < 120 / 0.85 + 1
    lost = [varied.missing[begin:end].sum() for begin, end in itertools.pairwise(varied.offsets)]
    assert lost[:4] == [0, 0, 0, 10] and min(lost[4:]) >= 8
    one_sided = replace(data, class_names=("nod", "left", "jump"))
    np.testing.assert_array_equal(with_stream_variations(one_sided, np.array([4]), 1).segments[6:, 2], plain)


def test_other_bodies_have_other_limbs_on_both_sides_alike() -> None:
    data = tiny_data(sequences=3, frames=40)
    plain = with_variations(data, np.array([0]), 1)
    varied = with_variations(data, np.array([0]), 1, bodies=True)
    np.testing.assert_array_equal(varied.sequence(0), data.sequence(0))

    def bones(motion: np.ndarray) -> np.ndarray:
        start, end = SKELETON.bone_indices.T
        return np.linalg.norm(motion[:, 0, start] - motion[:, 0, end], axis=-1).mean(axis=0)

    ratio = bones(varied.sequence(1)) / bones(plain.sequence(1))
    assert np.ptp(ratio) > 0.02 and (abs(ratio - 1) < 0.2).all()
    left, right = SKELETON.joint_names.index("left_foot"), SKELETON.joint_names.index("right_foot")
    legs = [np.flatnonzero((SKELETON.bone_indices == [3, foot]).all(axis=1))[0] for foot in (left, right)]
    assert ratio[legs[0]] == pytest.approx(ratio[legs[1]], abs=0.02)
    assert len(varied.sequence(1)) == len(plain.sequence(1))


@pytest.mark.parametrize("name", ["solo", "duo"])
def test_people_are_turned_at_the_waist(name: str) -> None:
    """Legs stay, bones keep their lengths, and shoulders turn by one angle; each person has its own."""
    data = load_data(name)
    legs = [index for index, joint in enumerate(data.skeleton.joint_names) if joint.split("_")[-1] in LEG]
    pelvis = data.skeleton.joint_names.index("pelvis")
    turned = with_turned_trunks(data, np.array([3, 8]), 3)
    assert turned.sequence_names[:4] == (
        data.sequence_names[3],
        *(f"{data.sequence_names[3]} ({i})" for i in (1, 2, 3)),
    )
    np.testing.assert_array_equal(turned.labels, np.repeat(data.labels[[3, 8]], 4))
    np.testing.assert_array_equal(turned.sequence(0), data.sequence(3))
    before, start, end = data.sequence(3), *data.skeleton.bone_indices.T
    angles = []
    for row in (1, 2, 3):
        after = turned.sequence(row)
        np.testing.assert_array_equal(after[:, :, [*legs, pelvis]], before[:, :, [*legs, pelvis]])
        np.testing.assert_array_equal(after[..., 2], before[..., 2])
        upper = [bone for bone in range(len(start)) if start[bone] not in legs and end[bone] not in legs]
        lengths = [np.linalg.norm(m[:, :, start[upper]] - m[:, :, end[upper]], axis=-1) for m in (before, after)]
        np.testing.assert_allclose(*lengths, atol=1e-5)
        chest = [data.skeleton.joint_names.index(f"{side}_shoulder") for side in ("left", "right")]
        across = [m[:, :, chest[0], :2] - m[:, :, chest[1], :2] for m in (before, after)]
        turn = np.angle(np.exp(1j * (np.arctan2(*across[1].T[::-1]) - np.arctan2(*across[0].T[::-1]))))
        np.testing.assert_allclose(turn, np.broadcast_to(turn[:, :1], turn.shape), atol=1e-4)
        angles.extend(turn[:, 0])
    assert len(np.unique(np.round(angles, 6))) == 3 * data.persons
    assert max(np.abs(angles)) <= TURN


def test_bodies_without_sides_are_not_turned() -> None:
    data = tiny_data(sequences=3)
    stick = replace(data, skeleton=Skeleton(tuple(f"joint-{i}" for i in range(6)), SKELETON.bones))
    turned = with_turned_trunks(stick, np.array([0]), 2)
    for row in range(3):
        np.testing.assert_array_equal(turned.sequence(row), data.sequence(0))
