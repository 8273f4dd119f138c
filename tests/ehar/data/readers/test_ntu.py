"""NTU RGB+D: bodies by their numbers, joints that were not tracked, the published splits, and broken files."""

from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from ehar.data.readers import ntu
from ehar.data.readers.ntu import prepare_ntu, read_skeleton
from ehar.errors import EharError
from eval.conformance.data import check_data
from tests.helpers.places import SHARED

SAMPLE = SHARED / "formats_sample" / "ntu"
BASE = np.random.default_rng(0).normal(size=(25, 3))


def text(*frames: dict[str, np.ndarray], state: int = 2) -> str:
    """Return a file of frames; each names bodies and their joints (25, 3)."""
    lines = [str(len(frames))]
    for bodies in frames:
        lines.append(str(len(bodies)))
        for name, joints in bodies.items():
            lines += [f"{name} 0 1 1 1 1 0 0.02 0.05 2", "25"]
            lines += [" ".join(map(str, (*place, *range(8), state))) for place in joints]
    return "\n".join(lines) + "\n"


def write(folder: Path, content: str, name: str = "S001C001P001R001A001.skeleton") -> Path:
    (folder / name).write_text(content)
    return folder / name


ONE = {"72057594037931101": BASE}
GOOD = text(ONE, {"72057594037931101": BASE + 0.1}, ONE)


def test_the_real_sample() -> None:
    if not SAMPLE.is_dir():
        pytest.skip(f"{SAMPLE} is absent")
    data = prepare_ntu(SAMPLE)
    assert data.lengths.tolist() == [103, 158, 104, 99, 54]
    assert data.class_names == ("drink water", "eat meal", "brush teeth", "brush hair", "drop")
    np.testing.assert_allclose(data.positions[0, 0, 0], [-0.2181153, 3.785547, 0.1725972], atol=1e-6)
    found = check_data(data)
    assert found.passed and all(check.passed and not check.doubtful for check in found.checks), str(found)
    assert data.views is not None and set(data.views.tolist()) == {1} and set(data.subjects[:, 0].tolist()) == {1}


def test_a_body_that_comes_and_goes_keeps_its_place(tmp_path: Path) -> None:
    # Numbers that differ in their last digits only: as floats they would be one body.
    first, second = "72057594037931101", "72057594037931102"
    frames = [{first: BASE}, {second: BASE + 5, first: BASE}, {second: BASE + 5}]
    motion = read_skeleton(write(tmp_path, text(*frames)))
    assert motion.shape == (3, 2, 25, 3)
    np.testing.assert_allclose(motion[[0, 1], 0], [BASE, BASE])
    np.testing.assert_allclose(motion[[1, 2], 1], [BASE + 5, BASE + 5])
    assert np.isnan(motion[2, 0]).all() and np.isnan(motion[0, 1]).all()


def test_the_body_that_moves_is_kept_and_gaps_are_filled(tmp_path: Path) -> None:
    frames = [{"1": BASE + 9, "2": BASE + i} if i != 2 else {"1": BASE + 9} for i in range(5)]
    write(tmp_path, text(*frames))
    data = prepare_ntu(tmp_path)
    x = data.positions[:, 0, 0, 0]
    np.testing.assert_allclose(x, -(BASE[0, 0] + np.arange(5)), atol=1e-5)  # also in the frame without it
    assert data.missing is not None and data.missing.tolist() == [False, False, True, False, False]


def test_joints_that_are_not_tracked_are_lost(tmp_path: Path) -> None:
    motion = read_skeleton(write(tmp_path, text(ONE, state=0)))
    assert np.isnan(motion).all()


def test_a_recording_without_a_joint_is_left_out_and_counted(tmp_path: Path) -> None:
    write(tmp_path, GOOD)
    numbered = [line.split() for line in GOOD.splitlines()]
    feet = [number for number, line in enumerate(numbered) if line[:1] == [str(BASE[15, 0])]]  # hidden by a desk
    feet += [number for number, line in enumerate(numbered) if line[:1] == [str((BASE + 0.1)[15, 0])]]
    assert len(feet) == 3
    for number in feet:
        numbered[number][-1] = "0"
    hidden = "\n".join(" ".join(line) for line in numbered)
    write(tmp_path, hidden, "S001C001P001R001A002.skeleton")
    data = prepare_ntu(tmp_path)
    assert data.class_names == ("drink water",)
    assert "1 of 2 sequences have a joint that is in no frame, and are left out: S001C001P001R001A002" in data.notes[0]
    (tmp_path / "S001C001P001R001A001.skeleton").unlink()
    with pytest.raises(EharError, match=r"A002\.skeleton: joint 'foot_left' of person 1 is in no frame"):
        prepare_ntu(tmp_path)


def test_actions_of_one_and_of_two_people(tmp_path: Path) -> None:
    write(tmp_path, GOOD)
    two = [{"1": BASE + 0.1 * i, "2": BASE + 3} for i in range(3)]
    write(tmp_path, text(*two), "S001C001P001R001A050.skeleton")
    write(tmp_path, GOOD, "S001C001P001R001A060.skeleton")  # the second one was not tracked
    one = prepare_ntu(tmp_path)
    assert one.class_names == ("drink water",) and "2 of 3 files show actions of 2 people" in one.notes[0]
    pair = prepare_ntu(tmp_path, persons=2)
    assert pair.class_names == ("punch somebody",) and pair.positions.shape[1] == 2
    assert "1 of 2 sequences show fewer than 2 people and are left out: S001C001P001R001A060" in pair.notes[1]


SPLITS: list[tuple[Literal["subject", "view", "setup"], list[bool]]] = [
    ("subject", [False, True, False, True]),  # person 1 trains, person 3 tests
    ("view", [True, True, False, False]),  # camera 1 tests
    ("setup", [True, True, False, False]),  # odd setups test
]


@pytest.mark.parametrize(("split", "expected"), SPLITS)
def test_published_splits(split: Literal["subject", "view", "setup"], expected: list[bool], tmp_path: Path) -> None:
    for place in ("S001C001P001", "S001C001P003", "S002C002P001", "S002C003P003"):
        write(tmp_path, GOOD, f"{place}R001A001.skeleton")
    data = prepare_ntu(tmp_path, split=split)
    assert data.is_test is not None and data.is_test.tolist() == expected


def test_people_and_actions_are_as_many_as_published() -> None:
    assert (len(ntu.TRAINING_PEOPLE), len(ntu.ACTIONS), len(set(ntu.ACTIONS)), len(ntu.OF_TWO)) == (53, 120, 120, 26)
    assert len([person for person in ntu.TRAINING_PEOPLE if person <= 40]) == 20
    numbered = dict(enumerate(ntu.ACTIONS, start=1))
    known = {10: "clap", 23: "wave hand", 43: "fall down", 50: "punch somebody", 58: "shake hands", 60: "walk apart"}
    known |= {61: "put on headphone", 80: "squat down", 106: "hit with something"}
    assert {number: numbered[number] for number in known} == known
    assert numbered[120] == "rock paper scissors"


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("", "number of frames: got the end of the file"),
        ("x", "number of frames: got x"),
        ("0", "number of frames: got 0"),
        (GOOD.replace("3\n", "4\n", 1), "frame 3: number of bodies: got the end of the file"),
        (GOOD.replace("3\n", "2\n", 1), "goes on after the 2 frames"),
        (GOOD[: len(GOOD) // 2], "frame 1, body 0: ends after"),
        (GOOD.replace("\n25\n", "\n24\n", 1), "frame 0, body 0: number of joints: got 24"),
        (GOOD.replace(f"{BASE[3, 1]}", "left", 1), "frame 0, body 0: could not convert string to float: 'left'"),
        (GOOD.replace("3\n1\n", "3\n9\n", 1), "frame 0: number of bodies: got 9"),
        (text({}, {}), "got no sequence of 1 people"),
        (text(ONE, state=0), "got no sequence of 1 people"),
    ],
)
def test_broken_files(content: str, problem: str, tmp_path: Path) -> None:
    write(tmp_path, content)
    with pytest.raises(EharError, match=problem) as caught:
        prepare_ntu(tmp_path)
    assert "\n" not in str(caught.value) and str(tmp_path) in str(caught.value)


def test_wrong_names_and_options(tmp_path: Path) -> None:
    with pytest.raises(EharError, match=r"got no \*\.skeleton"):
        prepare_ntu(tmp_path)
    write(tmp_path, GOOD)
    with pytest.raises(EharError, match="got no action of 2 people; --persons 1"):
        prepare_ntu(tmp_path, persons=2)
    with pytest.raises(EharError, match="persons: got 3"):
        prepare_ntu(tmp_path, persons=3)
    with pytest.raises(EharError, match="split: got 'camera'"):
        prepare_ntu(tmp_path, split="camera")  # type: ignore[arg-type]
    write(tmp_path, GOOD, "S001C001P001R001A121.skeleton")
    with pytest.raises(EharError, match=r"A121\.skeleton: got a name"):
        prepare_ntu(tmp_path)
