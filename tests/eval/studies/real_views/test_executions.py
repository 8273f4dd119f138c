"""Executions are found by their names, without copies, and cameras by all executions of a person."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.data.source import load_data
from ehar.errors import DataError
from eval.studies.real_views.executions import agreed, find_executions, find_poses
from tests.helpers.fakes import tiny_data
from tests.helpers.recordings import recorded_solo, rotation


def test_sequences_whose_names_differ_in_the_camera_are_one_execution() -> None:
    found = find_executions(recorded_solo(executions=4))
    assert [(one.name, one.label, one.person) for one in found] == [
        ("a0_s0_e0", 0, 0),
        ("a1_s0_e1", 1, 0),
        ("a2_s0_e2", 2, 0),
        ("a0_s1_e3", 0, 1),
    ]
    assert found[1].sequences == {1: 3, 2: 4, 3: 5}


def test_a_copy_under_another_camera_s_name_is_left_out() -> None:
    data = recorded_solo(executions=2)
    positions = data.positions.copy()
    positions[data.offsets[2] : data.offsets[3]] = data.sequence(1)
    found = find_executions(replace(data, positions=positions))
    assert [set(one.sequences) for one in found] == [{1, 2}, {1, 2, 3}]


@pytest.mark.parametrize(
    ("name", "seen", "message"),
    [
        ("tiny", False, "tiny: expected recordings of one person with `views`"),
        ("duo", True, "duo: expected recordings of one person"),
        ("tiny", True, "names that differ in `_v1`, `_v2` alone, found none"),
    ],
)
def test_data_without_cameras_is_refused(name: str, seen: bool, message: str) -> None:
    data = tiny_data() if name == "tiny" else load_data(name)
    with pytest.raises(DataError, match=message):
        find_executions(replace(data, views=np.ones(len(data.labels), dtype=int)) if seen else data)


def test_all_executions_of_a_person_say_how_cameras_stand() -> None:
    data = recorded_solo(executions=6, frames=40)
    found = find_executions(data)
    alone = find_poses(data, found)
    poses = agreed(alone, found)
    assert set(poses) == set(alone)
    assert set(poses) == {(one.name, a, b) for one in found for a in (1, 2, 3) for b in (1, 2, 3) if a != b}
    for one in found:
        np.testing.assert_allclose(poses[one.name, 1, 3].rotation, rotation(1.6), atol=0.06)
        np.testing.assert_allclose(alone[one.name, 3, 1].rotation, rotation(-1.6), atol=0.1)
        same = next(other for other in found if other.person == one.person)
        assert poses[one.name, 1, 2] is poses[same.name, 1, 2]
