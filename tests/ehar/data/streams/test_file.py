"""Streams: their labels, another frame rate, and files, good and bad."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.data.streams.data import NO_ACTIVITY, StreamData
from ehar.data.streams.file import load_streams, save_streams
from ehar.errors import DataError, UsageError
from tests.helpers.places import SHARED
from tests.helpers.streams import SEGMENTS, tiny_streams

Arrays = dict[str, np.ndarray]


def arrays(path: Path) -> Arrays:
    save_streams(path, tiny_streams())
    with np.load(path) as held:
        return dict(held)


def test_each_frame_has_the_class_of_its_segment_or_none() -> None:
    streams = tiny_streams()
    expected = np.full(120, NO_ACTIVITY)
    for first, end, label in SEGMENTS:
        expected[first:end] = label
    np.testing.assert_array_equal(streams.labels, expected)
    assert streams.stream_of.tolist() == [0, 0, 0, 1, 1, 2, 2, 2]
    assert repr(streams).startswith("StreamData(tiny: 3 sequences, 120 frames at 10 fps")


@pytest.mark.parametrize("fps", [5.0, 10.0, 15.0, 30.0])
def test_another_frame_rate_keeps_when_activities_are(fps: float) -> None:
    streams = tiny_streams()
    other = streams.resampled(fps)
    stream = streams.stream_of
    assert (other.stream_of == stream).all()
    for column in (0, 1):
        before = (streams.segments[:, column] - streams.offsets[stream]) / 10
        after = (other.segments[:, column] - other.offsets[stream]) / fps
        assert np.abs(after - before).max() <= 1 / fps + 0.1 + 1e-9
    assert (other.segments[1:, 0] >= other.segments[:-1, 1]).all()
    assert other.missing.sum() / fps == pytest.approx(0.3, abs=0.21)
    assert len(other.missing) == len(other.positions)
    assert (other.sha256 == streams.sha256) == (fps == 10)


def resampled(segments: list[tuple[int, int]], fps: float) -> list[list[int]]:
    """Return where segments of the first stream, of 40 frames at 10 frames/s, are at another rate."""
    whole = tiny_streams()
    held = np.array([*((first, end, index % 3) for index, (first, end) in enumerate(segments)), (40, 70, 0)])
    other = replace(whole, segments=held).resampled(fps)
    assert other.segments[-1, 0] == other.offsets[1]
    return other.segments[:-1, :2].tolist()


@pytest.mark.parametrize(
    ("segments", "fps", "expected"),
    [
        ([(10, 20), (20, 30)], 5.0, [[5, 10], [10, 15]]),
        ([(9, 10), (10, 20)], 5.0, [[5, 6], [6, 10]]),  # the short one takes the first frame of the long one
        ([(9, 10), (10, 11)], 5.0, [[5, 6], [6, 7]]),  # the second one is a frame late
        ([(9, 10), (10, 11), (11, 20)], 5.0, [[5, 6], [6, 7], [7, 10]]),
        ([(30, 38), (38, 39), (39, 40)], 5.0, [[15, 18], [18, 19], [19, 20]]),
        ([(38, 39), (39, 40)], 5.0, [[18, 19], [19, 20]]),  # the first one is a frame early
        ([(30, 37), (37, 40)], 2.0, [[6, 7], [7, 8]]),
    ],
)
def test_short_segments_keep_a_frame_at_a_lower_rate_and_none_overlaps(
    segments: list[tuple[int, int]], fps: float, expected: list[list[int]]
) -> None:
    assert resampled(segments, fps) == expected


@given(st.integers(0, 2**32 - 1), st.floats(1.0, 30.0))
def test_segments_stay_apart_and_in_order_at_any_rate_or_the_rate_is_refused(seed: int, fps: float) -> None:
    rng, whole = np.random.default_rng(seed), tiny_streams()
    bounds = np.sort(rng.choice(41, size=2 * rng.integers(1, 9), replace=False)).reshape(-1, 2)
    held = np.array([*((first, end, 0) for first, end in bounds), (40, 70, 0), (70, 120, 1)])
    try:
        other = replace(whole, segments=held).resampled(fps)
    except UsageError as error:
        assert "expected room for a frame of each segment" in str(error) and "\n" not in str(error)
        return
    assert (other.segments[:, 1] > other.segments[:, 0]).all()
    assert (other.segments[1:, 0] >= other.segments[:-1, 1]).all()
    assert other.stream_of.tolist() == replace(whole, segments=held).stream_of.tolist()
    assert other.segments[-1, 1] <= len(other.positions)


def test_a_rate_at_which_short_segments_have_no_room_is_refused() -> None:
    with pytest.raises(
        UsageError,
        match=r"tiny: expected room for .* at 2 frames/s; of 'morning', 'nod' \(frames 13 to 14\) and those beside it",
    ):
        resampled([(10, 11), (11, 12), (12, 13), (13, 14)], 2.0)


@pytest.mark.parametrize("rate", [0, 1e9, float("nan")])
def test_a_rate_that_makes_no_sense_is_refused(rate: float) -> None:
    with pytest.raises(UsageError, match=f"fps: got {rate}, expected frames per second above 0, and at most 10000"):
        tiny_streams().resampled(rate)


def test_a_file_holds_all_of_them(tmp_path: Path) -> None:
    save_streams(tmp_path / "tiny.npz", tiny_streams())
    back = load_streams(tmp_path / "tiny.npz")
    assert back.sha256 == tiny_streams().sha256
    for name in ("segments", "missing", "subjects", "is_test"):
        np.testing.assert_array_equal(getattr(back, name), getattr(tiny_streams(), name))


def test_segments_are_put_in_order_and_end_where_the_next_begins(tmp_path: Path) -> None:
    held = arrays(tmp_path / "tiny.npz")
    mixed = [[10, 21, 1], [2, 12, 0], [60, 70, 0], [40, 69, 1], [75, 90, 2], [70, 74, 0], [100, 120, 1], [25, 40, 2]]
    held["segments"] = np.array(mixed)
    np.savez(tmp_path / "tiny.npz", **held)
    streams = load_streams(tmp_path / "tiny.npz")
    assert streams.segments[:4].tolist() == [[2, 10, 0], [10, 21, 1], [25, 40, 2], [40, 60, 1]]
    said = "2 of 8 segments overlap the next one and end where it begins, 0 of them although it ends within them, such"
    assert streams.notes == (f"{said} as {streams.class_names[0]!r} at frames 2 to 12",)
    assert streams.resampled(20.0).notes == streams.notes
    save_streams(tmp_path / "again.npz", streams)
    assert load_streams(tmp_path / "again.npz").notes == ()


def test_a_segment_within_another_one_cuts_it_and_that_is_said(tmp_path: Path) -> None:
    held = arrays(tmp_path / "tiny.npz")
    held["segments"] = np.array([(2, 24, 0), *sorted(SEGMENTS)[1:]])
    np.savez(tmp_path / "tiny.npz", **held)
    streams = load_streams(tmp_path / "tiny.npz")
    assert streams.segments[:2].tolist() == [[2, 10, 0], [10, 21, 1]]
    (note,) = streams.notes
    assert note.startswith("1 of 8 segments overlap the next one and end where it begins, 1 of them although it ends ")
    assert note.endswith(f"such as {streams.class_names[0]!r} at frames 2 to 24")


def test_missing_frames_may_hold_nothing_and_are_interpolated(tmp_path: Path) -> None:
    held = arrays(tmp_path / "tiny.npz")
    held["missing"][[0, 50, 51, 119]] = True
    truth = held["positions"].copy()
    held["positions"][[0, 50, 51, 119]] = np.nan
    np.savez(tmp_path / "tiny.npz", **held)
    filled = load_streams(tmp_path / "tiny.npz").positions
    np.testing.assert_allclose(filled[50], (2 * truth[49] + truth[52]) / 3, atol=1e-6)
    np.testing.assert_array_equal(filled[[0, 119]], truth[[1, 118]])


def with_nan(held: Arrays) -> None:
    held["positions"][5] = np.nan


def without_all(held: Arrays) -> None:
    held["missing"][40:70] = True
    held["positions"][40:70] = np.nan


def with_leap(held: Arrays) -> None:
    held["positions"][80:] += np.array([3, 0, 0], dtype=np.float32)


def with_segment(*segment: int) -> Callable[[Arrays], None]:
    def change(held: Arrays) -> None:
        held["segments"] = np.concatenate([held["segments"], [segment]])

    return change


def all_missing(held: Arrays) -> None:
    held["missing"] = np.ones(len(held["positions"]), dtype=bool)  # though there are numbers


def without_class_in_test(held: Arrays) -> None:
    held["segments"] = held["segments"][held["segments"][:, 2] != 2]
    held["segments"] = np.concatenate([held["segments"], [[30, 35, 2]]])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (with_segment(30, 30, 1), "segments: got [30, 30, 1], expected an end frame behind the first"),
        (with_segment(95, 90, 1), "segments: got [95, 90, 1], expected an end frame behind the first"),
        (with_segment(-1, 5, 1), "segments: got [-1, 5, 1], expected frames from 0 to 120"),
        (with_segment(110, 121, 1), "segments: got [110, 121, 1], expected frames from 0 to 120"),
        (with_segment(30, 41, 1), "segments: got [30, 41, 1], expected an end within the same stream"),
        (with_segment(60, 65, 1), "expected no two that begin at the same frame"),
        (with_segment(92, 95, 3), "segments: got 3 for segment 8, expected 0 to 2"),
        (without_class_in_test, "split: no test sequence of right"),
        (with_nan, "positions: got NaN in sequence 'morning', frame 5"),
        (without_all, "missing: got no frame of sequence 'noon' that is not missing"),
        (all_missing, "missing: got no frame of sequence 'morning' that is not missing"),
        (with_leap, "got a person who moves 3.0 m into frame 10 of sequence 'evening'; expected at most 1 m"),
        (lambda held: held.pop("segments"), "segments: missing; the file holds"),
        (lambda held: held.update(positions=np.float32(1)), "positions: got shape (), expected"),
    ],
)
def test_bad_files_are_named_in_one_line(tmp_path: Path, change: Callable[[Arrays], None], message: str) -> None:
    held = arrays(tmp_path / "tiny.npz")
    change(held)
    np.savez(tmp_path / "tiny.npz", **held)
    with pytest.raises(DataError, match=re.escape(message)) as found:
        load_streams(tmp_path / "tiny.npz")
    assert str(found.value).startswith(str(tmp_path / "tiny.npz")) and "\n" not in str(found.value)


def test_a_leap_over_missing_frames_and_one_between_streams_are_none(tmp_path: Path) -> None:
    held = arrays(tmp_path / "tiny.npz")
    held["positions"][51:] += np.array([3, 0, 0], dtype=np.float32)
    held["positions"][70:] += np.array([3, 0, 0], dtype=np.float32)
    np.savez(tmp_path / "tiny.npz", **held)
    load_streams(tmp_path / "tiny.npz")


def test_what_breaks_the_schema_is_not_written(tmp_path: Path) -> None:
    wrong = replace(tiny_streams(), segments=np.array([[0, 130, 0]]))
    with pytest.raises(DataError, match="expected frames from 0 to 120"):
        save_streams(tmp_path / "tiny.npz", wrong)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not (SHARED / "utkinect.npz").is_file(), reason="needs ../shared/data/utkinect.npz")
def test_a_real_recording_with_gaps_and_overlaps() -> None:
    streams: StreamData = load_streams(SHARED / "utkinect.npz")
    assert len(streams.lengths) == 20 and len(streams.segments) == 199
    assert (streams.segments[1:, 0] >= streams.segments[:-1, 1]).all()
    assert streams.missing.sum() == 877
    assert streams.notes[0].startswith("11 of 199 segments overlap the next one and end where it begins, 2 of them")
    assert 0.5 < (streams.labels == NO_ACTIVITY).mean() < 0.7
