"""Streams that cannot be watched: one line each, exit code 2, and nothing left behind."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ehar.data.streams.file import save_streams
from tests.helpers.commands import fails_with
from tests.helpers.streams import raising_streams

Arrays = dict[str, np.ndarray]
STREAM = 120  # frames of each of the 8 streams, of which the last two are for the test


def with_segments(*segments: tuple[int, int, int]) -> Callable[[Arrays], None]:
    def change(held: Arrays) -> None:
        held["segments"] = np.concatenate([held["segments"], segments])

    return change


def without_a_class_in_the_test(held: Arrays) -> None:
    held["segments"] = held["segments"][(held["segments"][:, 2] != 1) | (held["segments"][:, 0] < 6 * STREAM)]


def with_nan(held: Arrays) -> None:
    held["positions"][7] = np.nan


def with_a_jump(held: Arrays) -> None:
    held["positions"][50:STREAM] += np.array([4, 0, 0], dtype=np.float32)


@pytest.mark.parametrize("command", ["benchmark", "train recogniser"])
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (with_segments((15, 15, 0)), "got [15, 15, 0], expected an end frame behind the first"),
        (with_segments((950, 961, 0)), "got [950, 961, 0], expected frames from 0 to 960"),
        (with_segments((115, 125, 0)), "got [115, 125, 0], expected an end within the same stream"),
        (with_segments((15, 18, 0), (15, 19, 1)), "expected no two that begin at the same frame"),
        (without_a_class_in_the_test, "no test sequence of left; expected at least one of every class"),
        (with_nan, "got NaN in sequence 'stream-0', frame 7; expected finite metres, or `missing` there"),
        (with_a_jump, "moves 4.0 m into frame 50 of sequence 'stream-0'; expected at most 1 m, or `missing` there"),
    ],
)
def test_bad_streams_end_in_one_line(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    command: str,
    change: Callable[[Arrays], None],
    message: str,
) -> None:
    path = tmp_path / "raising.npz"
    save_streams(path, raising_streams())
    with np.load(path) as file:
        held = dict(file)
    change(held)
    np.savez(path, **held)
    said = fails_with([*command.split(), "--data", str(path), "--length", "40", "--out", str(tmp_path / "out")], capsys)
    assert message in said and said.startswith("ehar: error: ") and "raising" in said
    assert [file.name for file in tmp_path.iterdir()] == ["raising.npz"]


def test_a_class_without_a_segment_in_a_part_ends_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = raising_streams()
    of_one = (data.segments[:, 2] != 1) | (data.stream_of == 0)  # only one person raises the joint of class 1
    save_streams(tmp_path / "raising.npz", replace(data, segments=data.segments[of_one], is_test=None))
    told = ["--data", str(tmp_path / "raising.npz"), "--length", "40", "--out", str(tmp_path / "out")]
    said = fails_with(["train", "recogniser", *told], capsys)
    assert "raising: expected a segment of every class in the " in said and "part, class 'left' has none" in said
    assert [file.name for file in tmp_path.iterdir()] == ["raising.npz"]


def test_streams_shorter_than_an_episode_end_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_streams(tmp_path / "raising.npz", raising_streams())
    told = ["--data", str(tmp_path / "raising.npz"), "--length", "121", "--out", str(tmp_path / "out")]
    assert "expected a training sequence of at least 121 frames, the longest has 120" in fails_with(
        ["train", "recogniser", *told], capsys
    )
    assert [file.name for file in tmp_path.iterdir()] == ["raising.npz"]
