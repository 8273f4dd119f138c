"""Gaps: joints that the tracker lost are interpolated joint by joint, and `missing` says in which frames."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ehar.data.motion_file import load_motion, save_motion
from ehar.data.preparing.gaps import fill_gaps, without_empty_bodies
from ehar.data.variations import with_variations
from ehar.errors import DataError
from tests.helpers.fakes import SKELETON, tiny_data


def line(frames: int = 6, persons: int = 2) -> np.ndarray:
    """Return everything on its way along a line, at another speed for every coordinate."""
    speeds = np.random.default_rng(0).normal(size=(persons, 6, 3))
    return np.arange(frames)[:, None, None, None] * speeds


def test_a_lost_joint_is_interpolated_and_no_other_changes() -> None:
    motion = line()
    lost = motion.copy()
    lost[2:4, 1, 5, 0] = np.nan
    filled, gaps = fill_gaps(lost, SKELETON, "here")
    np.testing.assert_allclose(filled, motion, atol=1e-12)
    assert gaps.tolist() == [False, False, True, True, False, False]
    assert np.isnan(lost[2, 1, 5, 0])  # what was handed is as it was


def test_before_the_first_and_after_the_last_frame_joints_stay() -> None:
    motion = line()
    motion[0, 0], motion[4:, 0] = np.nan, np.inf
    filled, gaps = fill_gaps(motion, SKELETON, "here")
    np.testing.assert_array_equal(filled[0, 0], motion[1, 0])
    np.testing.assert_array_equal(filled[5, 0], motion[3, 0])
    assert gaps.tolist() == [True, False, False, False, True, True]


def test_somebody_or_a_joint_in_no_frame() -> None:
    motion = line()
    motion[:, 1, 2] = np.nan
    with pytest.raises(DataError, match=r"^here: joint 'right_shoulder' of person 2 is in no frame"):
        fill_gaps(motion, SKELETON, "here")
    motion[:, 1] = np.nan
    with pytest.raises(DataError, match=r"^here: person 2 of 2 is in no frame"):
        fill_gaps(motion, SKELETON, "here")


def test_bodies_of_zeros_are_nobody_but_a_joint_at_zero_is_one() -> None:
    motion = line() + 1
    motion[3, 1], motion[4, 0, 2] = 0, 0
    marked = without_empty_bodies(motion)
    assert np.argwhere(np.isnan(marked).any(axis=(2, 3))).tolist() == [[3, 1]]
    assert not np.isnan(motion).any()


def test_a_file_with_gaps(tmp_path: Path) -> None:
    data = tiny_data()
    holes = data.positions.copy()
    holes[25:27, 0, 4] = np.nan
    missing = np.zeros(len(holes), dtype=bool)
    with pytest.raises(DataError, match=r"got NaN in sequence 'sequence-1', frame 5, and 1 more frames; .*`missing`"):
        save_motion(tmp_path / "a.npz", replace(data, positions=holes, missing=missing))
    missing[25:27] = True
    save_motion(tmp_path / "a.npz", replace(data, positions=holes, missing=missing))
    read = load_motion(tmp_path / "a.npz")
    assert read.missing is not None and read.missing.tolist() == missing.tolist()
    assert np.isfinite(read.positions).all() and np.isnan(holes[25]).any()
    np.testing.assert_allclose(read.positions[25, 0, 4], (2 * holes[24, 0, 4] + holes[27, 0, 4]) / 3, rtol=1e-5)
    slow = read.resampled(12.5)
    assert slow.missing is not None and slow.missing.nonzero()[0].tolist() == [13]  # frame 26 of 40 a sequence
    assert with_variations(read, np.arange(2), 1).missing is None


@pytest.mark.parametrize("wrong", [np.zeros(3, dtype=bool), np.zeros(240), np.zeros((240, 1), dtype=bool)])
def test_missing_of_another_shape_or_type(wrong: np.ndarray, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"missing: got"):
        save_motion(tmp_path / "a.npz", replace(tiny_data(), missing=wrong))
