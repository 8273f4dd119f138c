"""Streams out of sequences: who is in them, in which order, and how one activity leads to the next."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from ehar.data.motion_data import MotionData
from ehar.data.motion_file import save_motion
from ehar.data.scenario import split_parts
from ehar.data.skeleton_tree import parents
from ehar.data.source import load_data
from ehar.data.stitching.joins import DURATIONS, FAST, join, placed
from ehar.data.stitching.streams import stitch
from ehar.data.streams.data import NO_ACTIVITY, StreamData
from ehar.data.streams.file import load_streams
from ehar.errors import DataError, UsageError
from eval.cli.main import main
from tests.helpers.fakes import tiny_data
from tests.helpers.recordings import rotation

SETS = ("solo", "duo")


@cache
def short_streams(name: str) -> StreamData:
    """Return streams of 20 s of a built-in set; made once a process."""
    return stitch(load_data(name), seconds=20)


def pieces(data: MotionData, streams: StreamData) -> list[int]:
    """Return the sequence that each segment shows: the one with the same heights in every frame."""
    heights = {data.sequence(i)[..., 2].tobytes(): i for i in range(len(data.lengths))}
    return [heights[streams.positions[first:end][..., 2].tobytes()] for first, end, _ in streams.segments]


@pytest.mark.parametrize("name", SETS)
def test_every_sequence_is_in_one_stream_of_its_people_and_its_part(name: str) -> None:
    data, streams = load_data(name), short_streams(name)
    shown = np.array(pieces(data, streams))
    assert sorted(shown) == list(range(len(data.lengths)))
    np.testing.assert_array_equal(streams.segments[:, 2], data.labels[shown])
    np.testing.assert_array_equal(streams.subjects[streams.stream_of], data.subjects[shown])
    test = split_parts(data).test
    assert streams.is_test is not None
    np.testing.assert_array_equal(streams.is_test[streams.stream_of], np.isin(shown, test))


def test_what_is_missing_in_sequences_is_missing_in_streams() -> None:
    data = load_data("solo")
    data = replace(data, missing=np.random.default_rng(0).random(len(data.positions)) < 0.1)
    streams = stitch(data, seconds=20)
    assert data.missing is not None
    for sequence, (first, end, _) in zip(pieces(data, streams), streams.segments, strict=True):
        part = slice(data.offsets[sequence], data.offsets[sequence + 1])
        np.testing.assert_array_equal(streams.missing[first:end], data.missing[part])
    assert not streams.missing[streams.labels == NO_ACTIVITY].any()
    assert not short_streams("solo").missing.any()


@pytest.mark.parametrize("name", SETS)
def test_joins_last_as_long_as_people_take_and_show_no_activity(name: str) -> None:
    streams = short_streams(name)
    same = np.diff(streams.stream_of) == 0
    gaps = (streams.segments[1:, 0] - streams.segments[:-1, 1])[same]
    assert {round((gap + 1) / streams.fps, 2) for gap in gaps.tolist()} <= {
        round(round(seconds * streams.fps) / streams.fps, 2) for seconds in DURATIONS
    }
    assert (streams.labels == NO_ACTIVITY).sum() == gaps.sum()
    assert (streams.segments[:, 0][np.append(True, ~same)] == streams.offsets[:-1]).all()  # each begins at once


@pytest.mark.parametrize("name", SETS)
def test_bodies_keep_their_bones_their_ground_and_the_speeds_of_people(name: str) -> None:
    streams = short_streams(name)
    toward, joined = parents(streams.skeleton), streams.labels == NO_ACTIVITY
    bones = np.linalg.norm(streams.positions - streams.positions[..., toward, :], axis=-1)
    for stream in range(len(streams.lengths)):
        part = slice(streams.offsets[stream], streams.offsets[stream + 1])
        np.testing.assert_allclose(bones[part], bones[part][:1].repeat(part.stop - part.start, axis=0), atol=2e-3)
        speed = np.linalg.norm(np.diff(streams.positions[part], axis=0), axis=-1) * streams.fps
        near = (joined[part][1:] | joined[part][:-1])[:, None, None]
        assert (speed * near).max() <= max(2 * FAST, (speed * ~near).max())
    lowest = streams.positions[..., 2].min(axis=-1)
    assert np.abs(lowest[joined].mean() - lowest[~joined].mean()) < 0.01


def test_the_last_stream_of_somebody_is_not_too_short() -> None:
    data = load_data("solo")
    seconds = short_streams("solo").lengths / data.fps
    assert seconds.min() > 10
    one_each = stitch(data, seconds=0.01)
    assert len(one_each.lengths) == len(data.lengths)
    whole = stitch(data, seconds=1000)
    assert len(whole.lengths) == len(np.unique(data.subjects))


def test_the_seed_decides_the_order_unless_it_is_known() -> None:
    data = load_data("solo")
    assert stitch(data, seed=1).sha256 == stitch(data, seed=1).sha256 != stitch(data, seed=2).sha256
    known = replace(data, recorded_ms=np.arange(len(data.lengths))[::-1].copy())
    assert stitch(known, seed=1).sha256 == stitch(known, seed=2).sha256
    streams = stitch(known, seconds=1000)
    shown = np.array(pieces(known, streams))
    assert (np.diff(shown)[np.diff(streams.stream_of) == 0] < 0).all()


def test_the_next_activity_begins_where_and_as_turned_as_the_one_before_ended() -> None:
    data = load_data("solo")
    first, second = data.sequence(0), data.sequence(5)
    again = placed(first @ rotation(1.0).T.astype(np.float32) + np.float32(3), first[0] - np.float32(0), data.skeleton)
    np.testing.assert_allclose(again[..., :2], first[..., :2], atol=1e-4)
    moved = placed(second, first[-1], data.skeleton)
    np.testing.assert_allclose(moved[0, ..., :2].mean(axis=(0, 1)), first[-1, ..., :2].mean(axis=(0, 1)), atol=1e-5)
    np.testing.assert_array_equal(moved[..., 2], second[..., 2])


def test_a_join_goes_on_as_fast_as_people_were_moving() -> None:
    data = load_data("solo")
    walking = data.sequence(0)[:1] + np.float32(0.02) * np.arange(10, dtype=np.float32)[
        :, None, None, None
    ] * np.float32([1, 0, 0])
    between = join(walking, walking + np.float32([0.4, 0, 0]), data.skeleton, 30.0)
    whole = np.concatenate([walking, between, walking + np.float32([0.4, 0, 0])])
    steps = np.diff(whole[:, 0].mean(axis=1), axis=0)[:, 0]
    assert np.abs(np.diff(steps)).max() < 0.01


def test_bones_that_turn_to_the_opposite_do_not_vanish() -> None:
    data = load_data("solo")
    standing = data.sequence(0)[:2].copy()
    upside = standing * np.float32([1, -1, -1])
    between = join(standing, upside, data.skeleton, 30.0)
    toward = parents(data.skeleton)
    lengths = np.linalg.norm(between - between[..., toward, :], axis=-1)
    np.testing.assert_allclose(
        lengths,
        np.linalg.norm(standing - standing[..., toward, :], axis=-1)[:1].repeat(len(between), axis=0),
        atol=1e-4,
    )


def test_people_who_are_not_named_and_sequences_of_one_frame() -> None:
    with pytest.raises(DataError, match="tiny: subjects: expected all people by number"):
        stitch(tiny_data())
    named = replace(tiny_data(), subjects=np.zeros((12, 1), dtype=int))
    short = replace(named, offsets=np.array([0, 1, *named.offsets[2:].tolist()]))
    with pytest.raises(DataError, match="tiny: expected sequences of at least 2 frames, 'sequence-0' has 1"):
        stitch(short)
    with pytest.raises(UsageError, match="--seconds: got 0, expected more than 0"):
        stitch(named, seconds=0)
    with pytest.raises(UsageError, match="--seed: got -1, expected at least 0"):
        stitch(named, seed=-1)


def test_the_command_writes_streams_and_says_what_they_hold(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "solo-stream.npz"
    main(["data", "stitch", "solo", "--out", str(out), "--seconds", "30", "--seed", "3"])
    assert "400 activities of 10 classes" in " ".join(capsys.readouterr().out.split())
    assert load_streams(out).sha256 == stitch(load_data("solo"), seconds=30, seed=3).sha256
    save_motion(tmp_path / "x.npz", tiny_data())
    with pytest.raises(SystemExit):
        main(["data", "stitch", str(tmp_path / "x.npz"), "--out", str(tmp_path / "y.npz")])
    assert "x: subjects: expected all people by number" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["data", "stitch", "solo", "--out", str(tmp_path / "y.zip")])
    assert "expected a path that ends in .npz" in capsys.readouterr().err
    assert not (tmp_path / "y.npz").exists()
