"""Motion files: what is written is read back, and what is wrong ends in one line that says where."""

import errno
import os
import re
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.data.any_source import load_recordings
from ehar.data.motion_data import MotionData
from ehar.data.motion_file import load_motion, save_motion
from ehar.data.skeleton import Skeleton
from ehar.errors import DataError, EharError
from tests.helpers.examples import share_of_examples
from tests.helpers.fakes import tiny_data
from tests.helpers.places import SHARED

DATA = SHARED

Arrays = dict[str, Any]


def good_arrays() -> Arrays:
    """Four sequences of 3, 4, 5 and 2 frames, two persons of three joints, two classes."""
    return {
        "positions": np.random.default_rng(0).normal(size=(14, 2, 3, 3)).astype(np.float32),
        "offsets": np.array([0, 3, 7, 12, 14]),
        "labels": np.array([0, 1, 0, 1], dtype=np.int32),
        "class_names": np.array(["wave", "walk"]),
        "sequence_names": np.array(["a", "b", "c", "d"]),
        "split": np.array(["train", "train", "test", "test"]),
        "subjects": np.array([[1, 2], [1, 2], [3, -1], [3, 4]], dtype=np.int32),
        "fps": np.array(25.0, dtype=np.float32),
        "joint_names": np.array(["hip", "lhand", "rhand"]),
        "bones": np.array([[0, 1], [0, 2]], dtype=np.int32),
        "license": np.array("CC0"),
    }


def write(path: Path, arrays: Arrays) -> Path:
    np.savez(path, **arrays)
    return path


def error_of(action: Callable[[], object]) -> str:
    with pytest.raises(EharError) as caught:
        action()
    message = str(caught.value)
    assert "\n" not in message
    return message


def test_reads_what_the_schema_says(tmp_path: Path) -> None:
    arrays = good_arrays()
    data = load_motion(write(tmp_path / "some.npz", arrays))
    assert data.name == "some"
    assert data.fps == 25.0
    assert data.lengths.tolist() == [3, 4, 5, 2]
    assert data.is_test is not None and data.is_test.tolist() == [False, False, True, True]
    assert data.subjects.tolist() == arrays["subjects"].tolist()
    assert data.skeleton == Skeleton(("hip", "lhand", "rhand"), ((0, 1), (0, 2)))
    assert data.license == "CC0"
    assert not data.synthetic
    np.testing.assert_array_equal(data.positions, arrays["positions"])


def test_split_and_subjects_are_optional_and_other_arrays_ignored(tmp_path: Path) -> None:
    arrays = good_arrays() | {"styles": np.array([{}], dtype=object)}
    del arrays["split"], arrays["subjects"]
    data = load_motion(write(tmp_path / "some.npz", arrays))
    assert data.is_test is None
    assert data.subjects.tolist() == [[-1, -1]] * 4


def test_one_subject_a_sequence_counts_for_every_person(tmp_path: Path) -> None:
    data = load_motion(write(tmp_path / "some.npz", good_arrays() | {"subjects": np.array([5, 6, 7, -1])}))
    assert data.subjects.tolist() == [[5, 5], [6, 6], [7, 7], [-1, -1]]


@share_of_examples(0.25)
@given(
    lengths=st.lists(st.integers(1, 6), min_size=2, max_size=5),
    persons=st.integers(1, 2),
    fps=st.sampled_from([12.5, 25.0, 29.97, 59.94, 120.0]),
    seed=st.integers(0, 99),
    synthetic=st.booleans(),
    recorded=st.booleans(),
    divided=st.booleans(),
)
def test_round_trip(
    tmp_path_factory: pytest.TempPathFactory,
    lengths: list[int],
    persons: int,
    fps: float,
    seed: int,
    synthetic: bool,
    recorded: bool,
    divided: bool,
) -> None:
    rng = np.random.default_rng(seed)
    data = MotionData(
        name="written",
        positions=rng.normal(size=(sum(lengths), persons, 2, 3)).astype(np.float32),
        offsets=np.cumsum([0, *lengths]),
        labels=np.zeros(len(lengths), dtype=np.int64),
        class_names=("böse",),
        sequence_names=tuple(f"s{i}" for i in range(len(lengths))),
        fps=fps,
        skeleton=Skeleton(("a", "b"), ((0, 1),)),
        is_test=np.arange(len(lengths)) == 0 if divided else None,
        subjects=rng.integers(-1, 4, size=(len(lengths), persons)),
        license="x",
        synthetic=synthetic,
        views=rng.integers(1, 4, size=len(lengths)) if recorded else None,
    )
    path = tmp_path_factory.mktemp("round") / "written.npz"
    save_motion(path, data)
    back = load_motion(path)
    assert back.sha256 == data.sha256
    assert (back.fps, back.synthetic, back.license, back.name) == (fps, synthetic, "x", "written")
    np.testing.assert_array_equal(back.subjects, data.subjects)
    np.testing.assert_array_equal(back.views, data.views)
    assert os.listdir(path.parent) == ["written.npz"]


def changed(field: str, index: Any, value: Any) -> Arrays:
    arrays = good_arrays()
    arrays[field][index] = value
    return arrays


@pytest.mark.parametrize(
    ("arrays", "field", "words"),
    [
        (changed("positions", (5, 1, 2, 0), np.nan), "positions", "NaN in sequence 'b', frame 2;"),
        (changed("positions", (12, 0, 0, 0), np.inf), "positions", "infinite in sequence 'd', frame 0"),
        (changed("positions", slice(3, 5), np.nan), "positions", "sequence 'b', frame 0, and 1 more"),
        (good_arrays() | {"positions": np.full((14, 2, 3, 3), 1e300)}, "positions", "infinite"),
        (good_arrays() | {"positions": np.zeros((14, 2, 3, 2))}, "positions", "(14, 2, 3, 2), expected"),
        (good_arrays() | {"positions": np.zeros((14, 3, 3))}, "positions", "(total_frames, persons, joints, 3)"),
        (good_arrays() | {"positions": np.zeros((14, 0, 3, 3))}, "positions", "(14, 0, 3, 3)"),
        (good_arrays() | {"positions": np.zeros((14, 2, 3, 3), dtype=int)}, "positions", "int64, expected floats"),
        (changed("labels", 2, 2), "labels", "got 2 for sequence 'c', expected 0 to 1"),
        (changed("labels", 2, -1), "labels", "got -1 for sequence 'c'"),
        (good_arrays() | {"labels": np.zeros(4)}, "labels", "float64, expected integers"),
        (changed("offsets", 0, 1), "offsets", "got 1 first, expected 0"),
        (changed("offsets", 2, 3), "offsets", "got 3 then 3 around sequence 'b'"),
        (changed("offsets", 4, 15), "offsets", "got 15 last, expected 14"),
        (good_arrays() | {"offsets": np.array([0, 14])}, "offsets", "got shape (2,), expected (5,)"),
        (changed("split", 1, "val"), "split", "got 'val' for sequence 'b', expected train or test"),
        (changed("split", 3, "train"), "split", "no test sequence of walk"),
        (changed("split", 0, "test"), "split", "no train sequence of wave"),
        (changed("bones", (1, 1), 3), "bones", "got [0, 3] as bone 1, expected joints from 0 to 2"),
        (changed("bones", (1, 1), -1), "bones", "got [0, -1]"),
        (good_arrays() | {"bones": np.zeros((0, 2), dtype=int)}, "bones", "at least one"),
        (good_arrays() | {"bones": np.zeros((2, 3), dtype=int)}, "bones", "expected (bones, 2)"),
        (good_arrays() | {"fps": np.array(0.0)}, "fps", "got 0.0, expected frames per second above 0"),
        (good_arrays() | {"fps": np.array(-25)}, "fps", "above 0"),
        (good_arrays() | {"fps": np.array(np.nan)}, "fps", "got nan"),
        (good_arrays() | {"fps": np.array([25.0])}, "fps", "got shape (1,), expected ()"),
        (good_arrays() | {"fps": np.array("25")}, "fps", "expected a number"),
        (good_arrays() | {"class_names": np.array(["wave", "wave"])}, "class_names", "'wave' appears 2 times"),
        (good_arrays() | {"sequence_names": np.array(["a", "b", "a", "d"])}, "sequence_names", "'a' appears 2 times"),
        (good_arrays() | {"joint_names": np.array(["hip", "hip", "x"])}, "joint_names", "'hip' appears 2 times"),
        (good_arrays() | {"joint_names": np.array(["hip", "x"])}, "joint_names", "got shape (2,), expected (3,)"),
        (good_arrays() | {"sequence_names": np.array(["a", "b", "c"])}, "sequence_names", "got shape (3,)"),
        (good_arrays() | {"class_names": np.array([b"wave", b"walk"])}, "class_names", "expected strings"),
        (good_arrays() | {"subjects": np.array([1, 2, 3])}, "subjects", "got shape (3,), expected (4,)"),
        (good_arrays() | {"subjects": np.zeros((4, 3), dtype=int)}, "subjects", "expected (4, 2)"),
        (good_arrays() | {"subjects": np.array([0, 0, 0, -2])}, "subjects", "got -2"),
        (good_arrays() | {"license": np.array(["a", "b"])}, "license", "expected ()"),
        (good_arrays() | {"positions": np.float32(1), "missing": np.zeros(4, dtype=bool)}, "positions", "got shape ()"),
    ],
)
def test_bad_arrays_are_named(tmp_path: Path, arrays: Arrays, field: str, words: str) -> None:
    path = write(tmp_path / "bad.npz", arrays)
    message = error_of(lambda: load_motion(path))
    assert message.startswith(f"{path}: {field}: ")
    assert words in message


@pytest.mark.parametrize("field", sorted(set(good_arrays()) - {"split", "subjects"}))
def test_missing_array_is_named(tmp_path: Path, field: str) -> None:
    arrays = good_arrays()
    del arrays[field]
    path = write(tmp_path / "bad.npz", arrays)
    assert error_of(lambda: load_motion(path)).startswith(f"{path}: {field}: missing")


class Intruder:
    """Leaves a trace where it is unpickled."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self) -> Any:
        return os.mkdir, (str(self.trace),)


@pytest.mark.parametrize("field", ["positions", "labels", "class_names", "license"])
def test_object_arrays_are_never_unpickled(tmp_path: Path, field: str) -> None:
    trace = tmp_path / "trace"
    path = write(tmp_path / "bad.npz", good_arrays() | {field: np.array([Intruder(trace)], dtype=object)})
    message = error_of(lambda: load_motion(path))
    assert message.startswith(f"{path}: {field}: ") and "object array" in message
    assert not trace.exists()


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"no array at all", "expected an array as numpy saves it"),
        (b"\x93NUMPY\x01\x00\x10\x00{'descr': '<i8',\n", "cannot be read"),  # its header ends too soon
    ],
)
def test_a_member_that_is_no_array(tmp_path: Path, content: bytes, problem: str) -> None:
    arrays = good_arrays()
    del arrays["labels"]
    path = write(tmp_path / "bad.npz", arrays)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("labels.npy", content)
    message = error_of(lambda: load_motion(path))
    assert message.startswith(f"{path}: labels: cannot be read: ") and problem in message


def test_numbers_of_people_that_the_file_cannot_hold(tmp_path: Path) -> None:
    data = tiny_data()
    far = replace(data, subjects=data.subjects + 2**32 + 1)  # as int32 they would be other people
    with pytest.raises(DataError, match=r"^subjects: got \d+, expected at most 2147483647$"):
        save_motion(tmp_path / "far.npz", far)


def test_a_damaged_directory_of_the_archive(tmp_path: Path) -> None:
    path = tmp_path / "bad.npz"
    save_motion(path, tiny_data())
    content = bytearray(path.read_bytes())
    begin = content.index(b"PK\x01\x02")  # the directory at the end of the archive
    content[begin : begin + 20] = bytes(20)
    path.write_bytes(content)
    assert error_of(lambda: load_recordings(str(path))).startswith(f"{path}: the archive: cannot be read: ")


def test_a_file_that_may_not_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "secret.npz"
    save_motion(path, tiny_data())

    def refuse(path: Path, mode: str) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    assert error_of(lambda: load_motion(path)) == f"{path}: cannot be read: Permission denied"


def test_files_that_are_no_npz(tmp_path: Path) -> None:
    path = tmp_path / "bad.npz"
    assert "no such file" in error_of(lambda: load_motion(path))
    assert "no such file" in error_of(lambda: load_motion(tmp_path))
    path.write_bytes(b"")
    assert "not an .npz" in error_of(lambda: load_motion(path))
    np.save(tmp_path / "plain.npy", np.zeros(3))
    assert "not an .npz" in error_of(lambda: load_motion(tmp_path / "plain.npy"))
    np.array([Intruder(tmp_path / "trace")], dtype=object).dump(path)
    assert "not an .npz" in error_of(lambda: load_motion(path))
    assert not (tmp_path / "trace").exists()


@share_of_examples(0.6)
@given(where=st.floats(0, 1), value=st.integers(0, 255), cut=st.booleans())
def test_damaged_files_are_refused_or_harmless(
    tmp_path_factory: pytest.TempPathFactory, where: float, value: int, cut: bool
) -> None:
    path = write(tmp_path_factory.mktemp("damaged") / "some.npz", good_arrays())
    content = bytearray(path.read_bytes())
    index = int(where * (len(content) - 1))
    if cut:
        del content[index:]
    else:
        content[index] = value
    path.write_bytes(content)
    try:
        assert load_motion(path).positions.shape == (14, 2, 3, 3)
    except DataError as error:
        assert str(path) in str(error) and "\n" not in str(error)


def test_what_could_not_be_read_back_is_not_written(tmp_path: Path) -> None:
    data = load_motion(write(tmp_path / "good.npz", good_arrays()))
    path = tmp_path / "out.npz"
    split = replace(data, is_test=np.ones(4, dtype=bool))
    assert re.search("split: no train sequence of wave, walk", error_of(lambda: save_motion(path, split)))
    assert os.listdir(tmp_path) == ["good.npz"]


def test_saving_replaces_the_file_whole_or_leaves_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / "some.npz", good_arrays())
    before = path.read_bytes()
    data = replace(load_motion(path), fps=50.0)

    def fail(file: Any, **arrays: Any) -> None:
        file.write(b"half")
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(np, "savez", fail)
        assert "No space left" in error_of(lambda: save_motion(path, data))
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["some.npz"]
    save_motion(path, data)
    assert load_motion(path).fps == 50.0


def test_saving_makes_the_folder_or_says_why_not(tmp_path: Path) -> None:
    data = load_motion(write(tmp_path / "some.npz", good_arrays()))
    save_motion(tmp_path / "new" / "folder" / "out.npz", data)
    assert load_motion(tmp_path / "new" / "folder" / "out.npz").sha256 == data.sha256
    assert "cannot be written" in error_of(lambda: save_motion(tmp_path / "some.npz" / "out.npz", data))


@pytest.mark.parametrize(
    ("name", "persons", "sequences", "classes", "fps", "tests", "lengths"),
    [
        ("hdm05", 1, 288, 11, 60.0, 99, (28, 451)),
        ("bandai2", 1, 600, 10, 30.0, 260, (35, 415)),
        ("sbu", 2, 175, 8, 15.0, 65, (10, 44)),
    ],
)
def test_real_files(
    name: str, persons: int, sequences: int, classes: int, fps: float, tests: int, lengths: tuple[int, int]
) -> None:
    path = DATA / f"{name}.npz"
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    data = load_motion(path)
    assert (data.persons, len(data.labels), len(data.class_names), data.fps) == (persons, sequences, classes, fps)
    assert data.is_test is not None and int(data.is_test.sum()) == tests
    assert (data.lengths.min(), data.lengths.max()) == lengths
    assert data.subjects.shape == (sequences, persons)
