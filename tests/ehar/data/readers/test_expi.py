"""ExPI: numbers in millimetres in, metres of named joints out, and the split of the protocol."""

from pathlib import Path

import numpy as np
import pytest

from ehar.data.readers import expi
from ehar.data.readers.expi import prepare_expi, read_sequence
from ehar.errors import DataError

HEADER = ",".join(f"c{i}" for i in range(108))


def line(values: np.ndarray) -> str:
    return ",".join(f"{value:.3f}" for value in values)


def write(file: Path, rows: list[str]) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join([HEADER, *rows]) + "\n")
    return file


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for couple, protocol, sign in (("acro1", expi.TEST, 1), ("acro2", expi.TRAIN, -1)):
        for activity, numbers in protocol.items():
            for number in numbers:
                rows = [line(sign * (1000.0 * number + np.arange(108.0))), line(np.zeros(108))]
                write(tmp_path / couple / f"{activity}{number}" / "mocap_cleaned.tsv", rows)
    return tmp_path


def test_protocol(root: Path) -> None:
    write(root / "acro1" / "big-ben1" / "mocap_cleaned.tsv", [])  # not of the protocol: never opened
    data = prepare_expi(root)
    assert data.fps == 25.0
    assert data.positions.shape == (140, 2, 18, 3)
    assert data.class_names == tuple("a-frame around-the-back coochie frog-classic noser toss-out cartwheel".split())
    assert data.is_test is not None
    for label in range(7):
        assert int((data.is_test & (data.labels == label)).sum()) == 5
        assert int((~data.is_test & (data.labels == label)).sum()) == 5
    for name, test, label in zip(data.sequence_names, data.is_test, data.labels, strict=True):
        assert name.startswith("acro1/" if test else "acro2/")
        assert name.split("/")[1].startswith(data.class_names[label])
    assert {"acro1/noser6", "acro1/frog-classic6", "acro2/cartwheel2", "acro2/frog-classic7"} <= set(
        data.sequence_names
    )
    assert not {"acro1/noser5", "acro1/frog-classic3", "acro2/cartwheel1"} & set(data.sequence_names)
    assert data.subjects[data.is_test].tolist() == [[0, 1]] * 35
    assert data.subjects[~data.is_test].tolist() == [[2, 3]] * 35


def test_numbers_become_metres_of_named_joints(root: Path) -> None:
    data = prepare_expi(root)
    frame = data.sequence(data.sequence_names.index("acro1/coochie2"))[0]
    joint = data.skeleton.joint_names.index
    np.testing.assert_allclose(frame[0, joint("fhead")], [2.000, 2.001, 2.002], rtol=1e-6)
    np.testing.assert_allclose(frame[0, joint("rtoes")], [2.051, 2.052, 2.053], rtol=1e-6)
    np.testing.assert_allclose(frame[1, joint("lshoulder")], [2.066, 2.067, 2.068], rtol=1e-6)


def test_skeleton_is_one_tree_with_mirrored_limbs() -> None:
    names, mirror = expi.SKELETON.joint_names, expi.SKELETON.mirror
    assert len(names) == 18 and len(expi.SKELETON.bones) == 17
    assert {j for bone in expi.SKELETON.bones for j in bone} == set(range(18))
    for name, other in zip(names, mirror, strict=True):
        assert names[other] == {"l": "r", "r": "l"}.get(name[0], name[0]) + name[1:]


def test_missing_sequences_are_listed(root: Path) -> None:
    (root / "acro1" / "noser6" / "mocap_cleaned.tsv").unlink()
    (root / "acro2" / "a-frame1" / "mocap_cleaned.tsv").unlink()
    with pytest.raises(DataError, match=r"2 of 70 sequences .*: acro2/a-frame1, acro1/noser6;"):
        prepare_expi(root)
    with pytest.raises(DataError, match="70 of 70"):
        prepare_expi(root / "nowhere")


@pytest.mark.parametrize(
    ("row", "problem"),
    [
        (line(np.zeros(107)), "line 3: got 107 values separated by commas, expected 108"),
        (line(np.zeros(108)).replace(",", "\t"), "line 3: got 1 values separated by commas, expected 108"),
        ("", "line 3: got 1 values"),
        (line(np.zeros(107)) + ",abc", "line 3: got 'abc', expected numbers only"),
        (line(np.zeros(107)) + ",inf", "line 3: got an infinite position"),
    ],
)
def test_bad_rows_are_named(tmp_path: Path, row: str, problem: str) -> None:
    file = write(tmp_path / "mocap_cleaned.tsv", [line(np.zeros(108)), row, line(np.zeros(108))])
    with pytest.raises(DataError) as caught:
        read_sequence(file)
    assert str(caught.value).startswith(f"{file}: {problem}")


def test_no_frames(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="got no frames"):
        read_sequence(write(tmp_path / "mocap_cleaned.tsv", []))


def rows_with_gap(frames: int, begin: int, end: int, word: str) -> list[str]:
    """Joint 1 of person 0 moves 10 mm a frame along y, and is missing from `begin` to `end`."""
    rows = []
    for frame in range(frames):
        cells = ["0"] * 108
        cells[4] = word if begin <= frame < end else str(10 * frame)
        rows.append(",".join(cells))
    return rows


@pytest.mark.parametrize("word", ["", " ", "NaN"])
def test_gaps_are_filled_on_a_straight_line(tmp_path: Path, word: str) -> None:
    joints, gaps = read_sequence(write(tmp_path / "f.tsv", rows_with_gap(10, 3, 7, word)))
    np.testing.assert_allclose(joints[:, 0, 1, 1], 0.01 * np.arange(10), atol=1e-6)
    assert np.flatnonzero(gaps).tolist() == [3, 4, 5, 6]


@pytest.mark.parametrize(
    ("begin", "end", "problem"),
    [
        (0, 1, "line 2: lhead of person 0 is missing for 1 frames"),
        (39, 40, "line 41: lhead of person 0 is missing for 1 frames"),
        (5, 5 + expi.LONGEST_GAP + 1, "line 7: lhead of person 0 is missing for 26 frames"),
        (0, 40, "line 2: lhead of person 0 is missing for 40 frames"),
    ],
)
def test_gaps_that_cannot_be_filled(tmp_path: Path, begin: int, end: int, problem: str) -> None:
    file = write(tmp_path / "f.tsv", rows_with_gap(40, begin, end, ""))
    with pytest.raises(DataError) as caught:
        read_sequence(file)
    assert str(caught.value).startswith(f"{file}: {problem}")
