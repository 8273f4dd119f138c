"""Folds over people: everybody is tested once, with whom they perform, and every part has every class."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ehar.data.any_source import load_recordings
from ehar.data.folds import fold
from ehar.data.motion_data import MotionData
from ehar.data.motion_file import save_motion
from ehar.data.scenario import split_parts
from ehar.errors import DataError
from eval.cli.main import main
from tests.helpers.commands import fails_with
from tests.helpers.fakes import tiny_data


@pytest.mark.parametrize("name", ["duo", "solo-stream"])
@pytest.mark.parametrize("folds", [2, 3, 5])
def test_every_sequence_is_tested_once_and_nobody_is_tested_by_who_learned_from_them(name: str, folds: int) -> None:
    data = load_recordings(name)
    tested = []
    for number in range(folds):
        parts = split_parts(fold(data, number=number, folds=folds))
        others = np.concatenate([parts.recogniser, parts.policy, parts.validation])
        assert not set(data.subjects[parts.test].flat) & set(data.subjects[others].flat)
        tested.append(parts.test)
    np.testing.assert_array_equal(np.sort(np.concatenate(tested)), np.arange(len(data.lengths)))
    np.testing.assert_array_equal(tested[0], split_parts(data).test)
    frames = [int(data.lengths[test].sum()) for test in tested[1:]]
    longest = max(int(data.lengths[(data.subjects == one).any(axis=1)].sum()) for one in np.unique(data.subjects))
    assert max(frames) - min(frames) <= longest


def test_people_who_all_perform_with_each_other_are_divided_as_couples_whoever_acts_first() -> None:
    streams = load_recordings("solo-stream")
    first = streams.subjects[:, 0] % 6
    ring = np.stack([first, (first + 1) % 6], axis=1)
    ring[20:] = ring[20:, ::-1]  # each couple in both orders
    for own in (np.isin(ring.min(axis=1), (0, 1)), np.isin(ring[:, 0], (0, 1))):  # the second has couples on both sides
        data = replace(streams, subjects=ring, is_test=own)
        tested = [split_parts(fold(data, number=number)).test for number in range(3)]
        couples = [{frozenset(couple) for couple in ring[test].tolist()} for test in tested]
        assert sum(map(len, couples)) == len(set.union(*couples)) == 6
        np.testing.assert_array_equal(np.sort(np.concatenate(tested)), np.arange(len(ring)))


def test_who_has_most_frames_is_dealt_out_first() -> None:
    """Or else one who comes late makes a fold far larger than the others."""
    solo = load_recordings("solo")
    subjects = np.array([0, 1, 1, 1, 2, 2, 2, 2, *[3] * 5, *[4] * 7])[solo.subjects % 20]  # unlike shares
    data = replace(solo, subjects=subjects, is_test=np.arange(len(subjects)) % 3 == 0)
    frames = [int(data.lengths[split_parts(fold(data, number=one, folds=2)).test].sum()) for one in range(2)]
    assert abs(frames[0] - frames[1]) < 0.05 * sum(frames)


def test_a_set_that_is_not_divided_by_people_has_all_of_them_dealt_out() -> None:
    """As by cameras: each person is on both sides of the set's own split."""
    solo = load_recordings("solo")
    data = replace(solo, is_test=np.arange(len(solo.lengths)) % 3 == 0)
    for number in range(2):
        parts = split_parts(fold(data, number=number, folds=2))
        others = np.concatenate([parts.recogniser, parts.policy, parts.validation])
        assert not set(data.subjects[parts.test].flat) & set(data.subjects[others].flat)


def test_the_motion_stays_as_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["data", "fold", "solo-stream", "--number", "1", "--out", str(tmp_path / "solo-stream-1.npz")])
    assert "solo-stream-1.npz: 10 of 40 sequences for the test, by" in capsys.readouterr().out
    written = load_recordings(tmp_path / "solo-stream-1.npz")
    streams = load_recordings("solo-stream")
    np.testing.assert_array_equal(written.positions, streams.positions)
    np.testing.assert_array_equal(split_parts(written).test, split_parts(fold(streams, number=1)).test)
    main(["data", "fold", "duo", "--folds", "2", "--number", "1", "--out", str(tmp_path / "duo-1.npz")])
    assert isinstance(load_recordings(tmp_path / "duo-1.npz"), MotionData)


def test_a_couple_is_named_once_whoever_comes_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    duo = load_recordings("duo")
    assert isinstance(duo, MotionData)
    other = duo.labels[:, None] % 2 == 1
    turned = replace(duo, subjects=np.where(other, duo.subjects[:, ::-1], duo.subjects))
    save_motion(tmp_path / "turned.npz", turned)
    flags = ["--folds", "2", "--number", "0", "--out", str(tmp_path / "0.npz")]
    main(["data", "fold", str(tmp_path / "turned.npz"), *flags])
    told = capsys.readouterr().out.replace("\n", " ").partition("for the test, by ")[2].split(", ")
    couples = [frozenset(couple.strip().split("-")) for couple in told]
    assert len(couples) == len(set(couples)) > 1


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["--number", "3"], "--number: got 3, expected 0 to 2"),
        (["--number", "-1"], "--number: got -1, expected 0 to 2"),
        (["--number", "0", "--folds", "1"], "--folds: got 1, expected 2 to 21"),
        (["--number", "0", "--folds", "22"], "--folds: got 22, expected 2 to 21, as solo has 20 people"),
        (["--number", "0", "--out", "fold.txt"], "expected a path that ends in .npz"),
    ],
)
def test_what_is_no_fold_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], flags: list[str], message: str
) -> None:
    out = tmp_path / "fold.npz"
    assert message in fails_with(["data", "fold", "solo", "--out", str(out), *flags], capsys)
    assert not out.exists()


def test_people_without_names_and_classes_of_one_fold_are_refused() -> None:
    data = tiny_data(sequences=12)
    nameless = replace(data, subjects=np.full((12, 1), -1))
    with pytest.raises(DataError, match="expected all people by number, so that each is in one fold"):
        fold(nameless, number=0)
    people = np.arange(12)[:, None] % 4
    alone = replace(data, subjects=people, is_test=people[:, 0] == 0, labels=(people[:, 0] == 1).astype(np.int32))
    with pytest.raises(
        DataError, match=r"expected every class in the test part and outside of it, class .* on one side"
    ):
        fold(alone, number=1)
