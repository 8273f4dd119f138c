"""Motion in memory: what a notebook shows of it."""

from dataclasses import replace

from tests.helpers.fakes import tiny_data


def test_it_prints_as_one_short_line() -> None:
    data = tiny_data(sequences=8)
    frames, joints = len(data.positions), len(data.skeleton.joint_names)
    assert repr(data) == (
        f"MotionData(tiny (synthetic): 8 sequences, {frames} frames at {data.fps:g} fps, "
        f"1 person of {joints} joints, 3 classes)"
    )
    assert "2 persons of" in repr(tiny_data(persons=2))
    assert repr(replace(data, synthetic=False)).startswith("MotionData(tiny: 8 sequences")
    assert len(repr(data)) < 200 and "\n" not in repr(data)
