"""A prepared file read again: to mend it, and to keep some people."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ehar.data.motion_file import save_motion
from ehar.data.preparing.layouts import BODY12
from ehar.data.readers.npz import prepare_npz
from ehar.errors import EharError
from tests.helpers.fakes import tiny_data


def write(path: Path, **arrays: object) -> Path:
    """Write the tiny data of two people, with some arrays in place of its own."""
    save_motion(path, tiny_data(persons=2))
    with np.load(path) as archive:
        held = dict(archive)
    np.savez(path, **(held | arrays))
    return path


def test_units_axes_and_zeros(tmp_path: Path) -> None:
    positions = tiny_data(persons=2).positions
    file = positions @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]) * 1000  # y up
    file[7, 1] = 0
    data = prepare_npz(write(tmp_path / "a.npz", positions=file.astype(np.float32)), unit="mm", up="y")
    np.testing.assert_allclose(np.delete(data.positions, 7, 0), np.delete(positions, 7, 0), atol=1e-5)
    np.testing.assert_allclose(data.positions[7, 1], (positions[6, 1] + positions[8, 1]) / 2, atol=1e-5)
    assert data.missing is not None and data.missing.nonzero()[0].tolist() == [7]


def test_the_person_who_moves_is_kept(tmp_path: Path) -> None:
    positions = tiny_data(persons=2).positions.copy()
    positions[:20, 1] += 0.1 * np.arange(20)[:, None, None]
    positions[20:40, 0] += 0.1 * np.arange(20)[:, None, None]
    positions[40:, 1] = 0
    path = write(tmp_path / "a.npz", positions=positions)
    one = prepare_npz(path, persons=1)
    assert one.positions.shape[1] == 1 and len(one.labels) == 12 and not one.notes
    np.testing.assert_array_equal(one.positions[:40, 0], [*positions[:20, 1], *positions[20:40, 0]])
    with pytest.raises(EharError, match="no train sequence of right"):
        prepare_npz(path, persons=2)
    for name in ("sequence-1", "sequence-2"):
        assert name in one.sequence_names


def test_sequences_of_fewer_people_are_left_out_and_counted(tmp_path: Path) -> None:
    positions = tiny_data(persons=2).positions.copy()
    positions[40:60, 1] = 0
    data = prepare_npz(write(tmp_path / "a.npz", positions=positions, views=np.arange(12)), persons=2)
    assert data.views is not None and data.views.tolist() == [0, 1, *range(3, 12)]
    assert data.notes == ("1 of 12 sequences show fewer than 2 people, and are left out",)


def test_joints_get_names_of_a_layout(tmp_path: Path) -> None:
    data = tiny_data()
    twelve = np.repeat(data.positions, 2, axis=2)
    numbered = np.array([f"joint_{i}" for i in range(12)])
    path = tmp_path / "a.npz"
    save_motion(path, data)
    with np.load(path) as archive:
        held = dict(archive)
    np.savez(path, **(held | {"positions": twelve, "joint_names": numbered}))
    assert prepare_npz(path, joints="body12").skeleton == BODY12
    with pytest.raises(EharError, match=r"positions: got 12 joints, expected 17 of coco17"):
        prepare_npz(path, joints="coco17")


@pytest.mark.parametrize(
    ("arrays", "problem"),
    [
        ({"positions": np.zeros((240, 2, 6, 3), dtype=np.float32)}, "person 1 of 2 is in no frame"),
        ({"positions": np.zeros((240, 2, 6, 2), dtype=np.float32)}, "positions: got shape"),
        ({"positions": np.zeros((240, 2, 6, 3), dtype=int)}, "positions: got dtype int64"),
        ({"offsets": np.array([0, 3])}, "offsets: got shape"),
        ({"labels": np.full(12, 9)}, "labels: got 9"),
        ({"missing": np.zeros(5, dtype=bool)}, "missing: got"),
    ],
)
def test_broken_files(arrays: dict[str, np.ndarray], problem: str, tmp_path: Path) -> None:
    with pytest.raises(EharError, match=problem):
        prepare_npz(write(tmp_path / "a.npz", **arrays))


@pytest.mark.parametrize("persons", [None, 1])
@pytest.mark.parametrize(
    ("arrays", "problem"),
    [
        ({"missing": np.zeros(5, dtype=bool)}, r"missing: got shape \(5,\)"),
        ({"missing": np.zeros(240)}, "missing: got dtype float64"),
        ({"missing": np.array(False)}, r"missing: got shape \(\)"),
        ({"labels": np.array(1)}, r"labels: got shape \(\)"),
    ],
)
def test_what_is_beside_gaps_may_be_broken(
    arrays: dict[str, np.ndarray], problem: str, persons: int | None, tmp_path: Path
) -> None:
    positions = tiny_data(persons=2).positions.copy()
    positions[7, 0, 0] = np.nan
    with pytest.raises(EharError, match=problem):
        prepare_npz(write(tmp_path / "a.npz", positions=positions, **arrays), persons=persons)


def test_wrong_options(tmp_path: Path) -> None:
    path = write(tmp_path / "a.npz")
    with pytest.raises(EharError, match="persons: got 0"):
        prepare_npz(path, persons=0)
    with pytest.raises(EharError, match=r"positions: got no sequence of 3 people"):
        prepare_npz(path, persons=3)
    with pytest.raises(EharError, match="no such file"):
        prepare_npz(tmp_path / "b.npz")
    assert replace(prepare_npz(path), name="tiny").sha256 == tiny_data(persons=2).sha256
