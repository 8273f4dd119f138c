"""Sources: built-in names, files, and another frame rate."""

from pathlib import Path

import numpy as np
import pytest

from ehar.data import source
from ehar.data.motion_data import MotionData
from ehar.data.motion_file import save_motion
from ehar.data.skeleton import Skeleton
from ehar.data.source import load_data
from ehar.errors import DataError, UsageError


@pytest.fixture
def data() -> MotionData:
    return MotionData(
        name="some",
        positions=np.random.default_rng(0).normal(size=(9, 1, 2, 3)).astype(np.float32),
        offsets=np.array([0, 4, 9]),
        labels=np.array([0, 0]),
        class_names=("wave",),
        sequence_names=("a", "b"),
        fps=15.0,
        skeleton=Skeleton(("hip", "hand"), ((0, 1),)),
        is_test=np.array([False, True]),
        subjects=np.zeros((2, 1), dtype=np.int64),
    )


@pytest.fixture
def path(tmp_path: Path, data: MotionData) -> Path:
    save_motion(tmp_path / "some.npz", data)
    return tmp_path / "some.npz"


def test_file(path: Path, data: MotionData) -> None:
    assert load_data(path).sha256 == load_data(str(path)).sha256 == data.sha256
    assert load_data(path, fps=15.0).sha256 == data.sha256


def test_built_in_names(monkeypatch: pytest.MonkeyPatch, data: MotionData) -> None:
    assert set(source.BUILT_IN) == {"duo", "solo"}
    monkeypatch.setitem(source.BUILT_IN, "duo", lambda: data)
    assert load_data("duo") is data
    assert load_data("duo", fps=30.0).fps == 30.0


def test_twice_the_rate_keeps_every_frame_and_halves_the_way_between(path: Path, data: MotionData) -> None:
    double = load_data(path, fps=30.0)
    assert double.fps == 30.0
    assert double.lengths.tolist() == [7, 9]  # 2 n - 1: nothing lies beyond the last frame
    for index in range(2):
        before, after = data.sequence(index), double.sequence(index)
        np.testing.assert_array_equal(after[::2], before)
        np.testing.assert_allclose(after[1::2], (before[:-1] + before[1:]) / 2, atol=1e-6)


def test_a_lower_rate_takes_every_so_many_frames(path: Path, data: MotionData) -> None:
    third = load_data(path, fps=5.0)
    assert third.lengths.tolist() == [2, 2]
    np.testing.assert_allclose(third.sequence(1), data.sequence(1)[::3], atol=1e-6)


@pytest.mark.parametrize("fps", [0.0, -30.0, float("nan"), float("inf")])
def test_impossible_rates(path: Path, fps: float) -> None:
    with pytest.raises(UsageError, match=r"fps: got .* above 0"):
        load_data(path, fps=fps)


def test_unknown_names_list_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"unknown data 'trio'; expected duo, solo, or the path of an \.npz"):
        load_data("trio")
    with pytest.raises(DataError, match=r"absent\.npz: no such file"):
        load_data(tmp_path / "absent.npz")
    (tmp_path / "text.txt").write_text("hello")
    with pytest.raises(DataError, match=r"not an \.npz"):
        load_data(tmp_path / "text.txt")
