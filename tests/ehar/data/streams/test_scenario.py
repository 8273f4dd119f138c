"""Windows of streams, and their parts."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from ehar.data.scenario import PARTS, draw_scenarios, part_of, split_parts
from ehar.data.streams.data import StreamData
from ehar.data.streams.scenario import StreamScenarios
from ehar.errors import DataError
from tests.helpers.fakes import tiny_data
from tests.helpers.streams import raising_streams, tiny_streams


def whole(data: StreamData, *, length: int = 30) -> StreamScenarios:
    """Return the first window of every stream."""
    count = len(data.lengths)
    return StreamScenarios(data, length, np.arange(count), np.zeros(count, dtype=np.int64))


def test_every_frame_has_its_label_and_no_activity_comes_after_the_classes() -> None:
    scenarios = whole(tiny_streams())
    classes = len(tiny_streams().class_names)
    assert scenarios.labels.shape == (3, 30)
    expected = np.full(30, classes)
    expected[2:10], expected[10:21], expected[25:] = 0, 1, 2
    np.testing.assert_array_equal(scenarios.labels[0], expected)


def test_positions_are_around_a_centre_that_follows_people() -> None:
    data = raising_streams()
    walked = replace(data, positions=data.positions.copy())
    walked.positions[..., 0] += 0.1 * (np.arange(len(data.positions)) % 120)[:, None, None]  # 1 m/s
    scenarios = whole(walked, length=120)
    rows = np.arange(len(scenarios))
    positions, centres = scenarios.positions(rows), scenarios.centres(rows)
    shape = (8, 120, *data.positions.shape[1:])
    assert positions.shape == shape and positions.dtype == np.float32
    assert np.ptp(centres[:, :, 0], axis=1).min() > 10  # it went along
    assert np.abs(positions.mean(axis=(2, 3))).max() < 1.0
    moved = positions + centres[:, :, None, None]
    np.testing.assert_allclose(moved, walked.positions.reshape(shape), atol=1e-5)


def test_nothing_that_is_shown_depends_on_what_comes_later() -> None:
    data = raising_streams()
    changed = replace(data, positions=data.positions.copy())
    changed.positions[60:120] += 1.0  # of the first stream
    before, after = (whole(each, length=120).positions(np.array([0]))[0] for each in (data, changed))
    np.testing.assert_array_equal(before[:60], after[:60])
    assert (before[60] != after[60]).any()


def test_people_who_perform_together_are_in_one_part() -> None:
    data = raising_streams(people=48)
    partners = np.arange(48) // 2  # each couple in two streams
    couples = np.stack([2 * partners, 2 * partners + 1], axis=1)
    couples[1::2] = couples[1::2, ::-1]
    together = replace(data, positions=data.positions.repeat(2, axis=1), subjects=couples)
    parts = split_parts(together)
    people = [set(couples[getattr(parts, part)].ravel().tolist()) for part in PARTS]
    assert sum(map(len, people)) == len(set.union(*people)) == 48


def test_parts_of_streams_have_people_of_their_own() -> None:
    data = raising_streams(people=12)
    parts = split_parts(data)
    streams = [getattr(parts, part) for part in PARTS]
    assert sorted(np.concatenate(streams).tolist()) == list(range(12))
    assert all(len(part) for part in streams)
    people = [set(data.subjects[part].ravel()) for part in streams]
    assert sum(map(len, people)) == len(set.union(*people))
    np.testing.assert_array_equal(part_of(data, "test"), [10, 11])


def test_few_people_share_the_parts_by_streams() -> None:
    data = replace(raising_streams(), subjects=np.zeros((8, 1), dtype=np.int64))
    parts = split_parts(data)
    assert sum(len(getattr(parts, part)) for part in PARTS) == 8
    assert all(len(getattr(parts, part)) for part in PARTS)


def test_the_policy_part_shares_people_whom_the_recogniser_needs() -> None:
    person = np.repeat(np.arange(8), 2)
    data = replace(raising_streams(people=16), subjects=person[:, None], is_test=person > 5)
    parts = split_parts(data)
    people = {part: set(data.subjects[getattr(parts, part)].ravel()) for part in PARTS}
    assert people["test"] == {6, 7} and len(people["validation"]) == 1
    assert not people["validation"] & (people["recogniser"] | people["policy"])
    assert len(people["policy"]) == 5 and len(people["recogniser"]) == len(parts.recogniser) == 4
    streams = np.concatenate([getattr(parts, part) for part in PARTS])
    assert sorted(streams.tolist()) == list(range(16))


def test_streams_without_a_split_are_split_by_people() -> None:
    parts = split_parts(replace(raising_streams(people=9), is_test=None))
    assert len(parts.test) == 3


def test_parts_are_drawn_until_each_has_every_class() -> None:
    """A class that two training streams show has to be divided between recogniser and policy part."""
    data = raising_streams(people=12)
    trained = np.flatnonzero(~data.is_test)
    moved = set()
    for pair in combinations(trained.tolist(), 2):
        rare = (data.segments[:, 2] == 1) & ~np.isin(data.stream_of, [*pair, *np.flatnonzero(data.is_test)])
        segments = np.where(rare[:, None] & (np.arange(3) == 2), 0, data.segments)
        firsts = [np.flatnonzero(data.stream_of == stream)[0] for stream in pair]
        segments[firsts, 2] = 1
        parts = split_parts(replace(data, segments=segments))
        assert {*parts.recogniser.tolist()} & {*pair} and {*parts.policy.tolist()} & {*pair}
        moved.add(tuple(parts.recogniser.tolist()))
    assert len(moved) > 1  # the first draw would not do for all of them


def test_too_few_streams_to_train_on() -> None:
    with pytest.raises(DataError, match="tiny: expected at least 3 streams to train on, got 1"):
        split_parts(tiny_streams())


def test_drawn_windows_lie_within_their_streams() -> None:
    data = raising_streams()
    drawn = draw_scenarios(data, np.array([1, 4]), 50, np.random.default_rng(0), 400)
    assert isinstance(drawn, StreamScenarios)
    assert set(drawn.sequence) == {1, 4}
    assert drawn.first.min() == 0 and drawn.first.max() == 70
    clips = draw_scenarios(tiny_data(), np.array([1, 4]), 10, np.random.default_rng(0), 40)
    assert clips.labels.shape == (40,)
