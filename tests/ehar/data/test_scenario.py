"""Windows and splits."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from ehar.data import scenario
from ehar.data.motion_data import MotionData
from ehar.data.scenario import part_of, show_known, split_parts, strangers, windows
from ehar.data.synthetic.sets import solo
from ehar.errors import DataError, UsageError
from tests.helpers.fakes import CLASS_NAMES, POSE, SKELETON, tiny_data
from tests.helpers.streams import raising_streams


def data_of(lengths: list[int], labels: list[int]) -> MotionData:
    """Return sequences of given lengths whose x coordinate is the frame's number over all of the data."""
    frames = sum(lengths)
    positions = np.tile(POSE, (frames, 1, 1, 1))
    positions[..., 0] = np.arange(frames)[:, None, None]
    return MotionData(
        name="counted",
        positions=positions,
        offsets=np.concatenate([[0], np.cumsum(lengths)]),
        labels=np.array(labels),
        class_names=CLASS_NAMES,
        sequence_names=tuple(f"s{i}" for i in range(len(lengths))),
        fps=25.0,
        skeleton=SKELETON,
        is_test=None,
        subjects=np.full((len(lengths), 1), -1),
    )


@pytest.mark.parametrize(
    ("stride", "expected"),
    [
        (1, [(0, 0), (0, 1), (0, 2), (2, 0), (3, 0), (3, 1), (3, 2), (3, 3), (3, 4)]),
        (3, [(0, 0), (2, 0), (3, 0), (3, 3)]),
        (4, [(0, 0), (2, 0), (3, 0), (3, 4)]),
    ],
)
def test_windows_by_stride_and_none_of_what_is_too_short(stride: int, expected: list[tuple[int, int]]) -> None:
    data = data_of([6, 3, 4, 8], [0, 1, 2, 0])
    scenarios = windows(data, np.arange(4), 4, stride)
    assert list(zip(scenarios.sequence.tolist(), scenarios.first.tolist(), strict=True)) == expected
    assert len(scenarios) == len(expected)
    np.testing.assert_array_equal(scenarios.labels, data.labels[scenarios.sequence])


def test_windows_of_chosen_sequences_only() -> None:
    scenarios = windows(data_of([6, 3, 4, 8], [0, 1, 2, 0]), np.array([2]), 4, 1)
    assert (scenarios.sequence.tolist(), scenarios.first.tolist()) == ([2], [0])


def test_windows_of_nothing() -> None:
    assert len(windows(data_of([3, 3], [0, 1]), np.arange(2), 4, 1)) == 0
    with pytest.raises(DataError, match="at least 1 frame, got 0"):
        windows(data_of([3], [0]), np.arange(1), 0, 1)


def test_positions_are_the_window_s_frames_around_where_the_people_are_in_its_first() -> None:
    data = data_of([6, 3, 4, 8], [0, 1, 2, 0])
    scenarios = windows(data, np.array([0, 3]), 4, 2)  # windows begin at frames 0, 2 and 13, 15, 17 of the data
    positions = scenarios.positions(np.array([1, 3]))
    assert positions.shape == (2, 4, 1, 6, 3)
    assert positions.dtype == np.float32
    np.testing.assert_allclose(positions[0, :, 0, 0, 0], np.array([0, 1, 2, 3]))
    np.testing.assert_allclose(positions[1, :, 0, 0, 0], np.array([0, 1, 2, 3]))
    np.testing.assert_allclose(positions[:, 0].mean(axis=(1, 2)), 0, atol=1e-6)
    np.testing.assert_allclose(positions[1, 0] - positions[1, 0, :, :1], data.positions[15] - data.positions[15, :, :1])


def many(*, is_test: bool) -> MotionData:
    data = tiny_data(sequences=60)
    return data if is_test else replace(data, is_test=None)


@pytest.mark.parametrize("is_test", [True, False])
def test_every_sequence_is_in_exactly_one_part(is_test: bool) -> None:
    data = many(is_test=is_test)
    parts = split_parts(data)
    together = np.concatenate([parts.recogniser, parts.policy, parts.validation, parts.test])
    np.testing.assert_array_equal(np.sort(together), np.arange(60))


@pytest.mark.parametrize("is_test", [True, False])
def test_every_part_has_every_class_in_proportion(is_test: bool) -> None:
    data = many(is_test=is_test)
    parts = split_parts(data)
    per_class = 10 if is_test else 13  # training sequences of each of 3 classes
    held = round(0.15 * per_class)
    learn = round(0.4 * (per_class - held))
    for part, expected in (
        (parts.validation, held),
        (parts.recogniser, learn),
        (parts.policy, per_class - held - learn),
    ):
        np.testing.assert_array_equal(np.bincount(data.labels[part]), [expected] * 3)


def test_the_data_s_own_split_decides_what_is_tested() -> None:
    data = many(is_test=True)
    assert data.is_test is not None
    np.testing.assert_array_equal(split_parts(data).test, np.flatnonzero(data.is_test))


def test_without_a_split_known_subjects_are_held_out_as_a_whole() -> None:
    subjects = (np.arange(60) // 3 % 6)[:, None]
    data = replace(tiny_data(sequences=60), is_test=None, subjects=subjects)
    parts = split_parts(data)
    tested = set(subjects[parts.test, 0].tolist())
    assert len(tested) == 2
    trained = np.concatenate([parts.recogniser, parts.policy, parts.validation])
    assert tested.isdisjoint(subjects[trained, 0].tolist())


def test_a_class_of_two_training_sequences_has_one_to_recognise_and_one_for_the_policy() -> None:
    data = replace(tiny_data(sequences=9), is_test=np.arange(9) >= 6)
    parts = split_parts(data)
    for part in (parts.recogniser, parts.policy):
        np.testing.assert_array_equal(np.sort(data.labels[part]), [0, 1, 2])


def test_the_split_is_a_property_of_the_data() -> None:
    once, again = split_parts(many(is_test=False)), split_parts(many(is_test=False))
    for part in ("recogniser", "policy", "validation", "test"):
        np.testing.assert_array_equal(getattr(once, part), getattr(again, part))


def test_subjects_who_alone_perform_a_class_do_not_take_it_to_one_side() -> None:
    labels = np.arange(60) % len(CLASS_NAMES)
    data = replace(tiny_data(sequences=60), is_test=None, labels=labels, subjects=labels[:, None])
    parts = split_parts(data)
    for part in (parts.test, parts.recogniser, parts.policy):
        assert set(labels[part]) == set(range(len(CLASS_NAMES)))


def test_an_unknown_part_is_named() -> None:
    with pytest.raises(
        UsageError, match=r"^unknown part 'training'; expected one of: recogniser, policy, validation, t"
    ):
        part_of(tiny_data(), "training")


def performed(subjects: list[int], labels: list[int]) -> MotionData:
    """Return a training sequence of each person in the list, all of them of two frames, and one test sequence."""
    data = data_of([2] * (len(labels) + 1), [*labels, 0])
    is_test = np.arange(len(labels) + 1) == len(labels)
    return replace(data, subjects=np.array([*subjects, 99])[:, None], is_test=is_test)


def test_validation_holds_out_the_people_nearest_to_its_share() -> None:
    subjects = [*[0] * 4, *[1] * 6, *[2] * 10, *[3] * 20]
    data = performed(subjects, [0, 1] * 20)
    parts = split_parts(data)
    assert set(data.subjects[parts.validation, 0]) == {1}  # 6 of 40 sequences, 15 %
    for part in (parts.recogniser, parts.policy):
        assert set(data.labels[part]) == {0, 1}
        assert 1 not in data.subjects[part, 0]


def test_validation_holds_out_several_people_if_each_has_few_sequences() -> None:
    data = performed([person for person in range(20) for _ in range(2)], [0, 1] * 20)
    held = set(data.subjects[split_parts(data).validation, 0])
    assert len(held) == 3
    assert not held & set(data.subjects[split_parts(data).recogniser, 0])


def test_the_recogniser_meets_nobody_whom_planners_learn_from_where_people_are_many() -> None:
    def people(count: int) -> list[set[int]]:
        data = performed([person for person in range(count) for _ in range(2)], [0, 1] * count)
        parts = split_parts(data)
        for part in (parts.recogniser, parts.policy):
            assert set(data.labels[part]) == {0, 1}
        return [set(data.subjects[part, 0]) for part in (parts.recogniser, parts.policy, parts.validation)]

    recogniser, policy, validation = people(20)
    assert (len(recogniser), len(policy), len(validation)) == (7, 10, 3)
    assert not recogniser & policy and not validation & (recogniser | policy)
    recogniser, policy, _ = people(10)  # nine or eight are left, of whom it would keep three: it shares them all
    assert recogniser & policy


def test_validation_takes_nobody_without_whom_a_class_is_missing() -> None:
    subjects = [*[0] * 6, *[1] * 17, *[2] * 17]
    data = performed(subjects, [*[1] * 6, *[0] * 17, *[1] * 17])
    assert set(data.subjects[split_parts(data).validation, 0]) == {0}
    alone = performed(subjects, [*[2] * 6, *[0, 1] * 17])
    assert set(alone.subjects[split_parts(alone).validation, 0]) == {1}


def test_validation_of_one_person_in_a_third_of_the_sequences_is_still_of_people() -> None:
    data = performed([0, 1, 2] * 12, [0, 0, 0, 1, 1, 1] * 6)
    assert len(set(data.subjects[split_parts(data).validation, 0])) == 1


def test_validation_of_two_people_is_of_each_class() -> None:
    data = performed([0, 1] * 20, [0, 0, 1, 1] * 10)
    assert set(data.subjects[split_parts(data).validation, 0]) == {0, 1}


def test_who_performs_is_in_the_hash_of_the_data_as_it_decides_the_parts() -> None:
    data = solo()
    others = replace(data, subjects=np.roll(data.subjects, 1, axis=0))
    assert not np.array_equal(split_parts(others).recogniser, split_parts(data).recogniser)
    assert others.sha256 != data.sha256


def test_strangers_are_people_whom_the_recogniser_does_not_know() -> None:
    person = np.repeat(np.arange(8), 2)
    data = replace(raising_streams(people=16), subjects=person[:, None], is_test=person > 5)
    parts = split_parts(data)  # the policy part shares four people with the recogniser's
    others = np.concatenate([parts.policy, parts.validation, parts.policy])
    chosen = strangers(data, others)
    assert set(parts.validation) < set(chosen) < {*parts.validation, *parts.policy}
    assert len(chosen) == len(set(chosen))
    assert not set(data.subjects[chosen, 0]) & set(data.subjects[parts.recogniser, 0])
    np.testing.assert_array_equal(strangers(data, parts.recogniser), parts.recogniser)
    unnamed = replace(data, subjects=np.full((16, 1), -1))
    np.testing.assert_array_equal(strangers(unnamed, others), np.unique(others))


def test_streams_of_one_person_are_parts_by_themselves() -> None:
    data = replace(raising_streams(people=16), subjects=np.zeros((16, 1), dtype=np.int64), is_test=None)
    parts = split_parts(data)
    each = [parts.recogniser, parts.policy, parts.validation, parts.test]
    assert min(map(len, each)) > 0 and len(np.concatenate(each)) == 16
    with pytest.raises(DataError, match=r"expected at least 2 streams, of which one is the test, got 1$"):
        split_parts(replace(raising_streams(people=1), is_test=None))


@pytest.mark.parametrize("order", list(permutations([6, 120, 12])))
def test_streams_of_unlike_length_have_parts_too(order: tuple[int, ...]) -> None:
    each = [raising_streams(people=1, seconds=seconds) for seconds in (*order, 12)]
    begins = np.cumsum([0, *(len(one.positions) for one in each)])
    data = replace(
        raising_streams(people=4),
        positions=np.concatenate([one.positions for one in each]),
        offsets=begins,
        segments=np.concatenate(
            [one.segments + np.array([begin, begin, 0]) for one, begin in zip(each, begins[:-1], strict=True)]
        ),
        missing=np.zeros(begins[-1], dtype=bool),
        is_test=np.arange(4) == 3,
        subjects=np.full((4, 1), -1),
        class_names=CLASS_NAMES,
    )
    for seed in range(20):
        parts = scenario._stream_parts_drawn(data, np.random.default_rng(seed))
        each_part = (parts.recogniser, parts.policy, parts.validation, parts.test)
        assert sorted(np.concatenate(each_part)) == [0, 1, 2, 3]


def test_who_shows_elsewhere_in_the_recogniser_s_part_is_known() -> None:
    data = solo()
    parts = split_parts(data)
    assert not show_known(data, parts.test).any()
    subjects = data.subjects.copy()
    subjects[parts.test[:2]] = subjects[parts.recogniser[0]]
    other = replace(data, subjects=subjects)
    np.testing.assert_array_equal(split_parts(other).recogniser, parts.recogniser)
    assert show_known(other, parts.test).tolist() == [True, True, *[False] * (len(parts.test) - 2)]
    assert not show_known(other, parts.recogniser).any(), "not those of the part itself"
    unnamed = replace(data, subjects=np.full_like(subjects, -1))
    assert not show_known(unnamed, split_parts(unnamed).test).any()
