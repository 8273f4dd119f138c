"""Test sequences that are in the training part as well are found."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.data.copies import copied
from ehar.data.motion_data import MotionData
from ehar.data.motion_file import load_motion
from eval.running.episodes import cut_scenarios
from eval.studies.describe import describe
from tests.helpers.fakes import tiny_data
from tests.helpers.places import SHARED


def with_copy(frames: int) -> MotionData:
    """Return data whose last sequence, a test sequence, has its first frames from the first one."""
    data = tiny_data()
    positions = data.positions.copy()
    end = data.offsets[-2]
    positions[end : end + frames] = data.sequence(0)[:frames]
    return replace(data, positions=positions)


@pytest.mark.parametrize(("frames", "is_copy"), [(0, False), (10, False), (11, True), (20, True)])
def test_a_copy_has_more_than_half_of_its_frames_there(frames: int, is_copy: bool) -> None:
    assert copied(with_copy(frames), np.arange(6, 12)).tolist() == [False] * 5 + [is_copy]


def test_no_sequence_is_compared_with_itself_or_with_others_that_are_asked_for() -> None:
    assert not copied(tiny_data(), np.arange(12)).any()
    assert not copied(with_copy(20), np.array([0, 11])).any()


def test_a_benchmark_warns_of_copies() -> None:
    told: list[str] = []
    cut_scenarios(with_copy(20), np.arange(6, 12), 10, told.append)
    assert told == ["warning: 1 of 6 sequences are copies of others of tiny, frame by frame"]


def test_describe_warns_of_copies() -> None:
    assert "warning: 1 test sequences are copies of training sequences" in str(describe(with_copy(20)))
    assert "copies" not in str(describe(tiny_data()))


@pytest.mark.skipif(not (SHARED / "nwucla.npz").is_file(), reason="needs ../shared/data/nwucla.npz")
def test_northwestern_ucla_has_copies_between_cameras() -> None:
    data = load_motion(SHARED / "nwucla.npz")
    assert data.is_test is not None
    found = copied(data, np.flatnonzero(data.is_test))
    assert 80 < found.sum() < 100


def test_a_benchmark_and_describe_warn_of_people_whom_the_recogniser_knows() -> None:
    told: list[str] = []
    everywhere = replace(tiny_data(), subjects=np.zeros((12, 1), dtype=np.int64), is_test=np.arange(12) >= 6)
    cut_scenarios(everywhere, np.arange(6, 12), 10, told.append)
    assert told == ["warning: 6 of 6 sequences of tiny show people from whom its recogniser learns"]
    assert "warning: 6 test sequences show people from whom the recogniser learns" in str(describe(everywhere))
    assert "show people" not in str(describe(tiny_data()))
