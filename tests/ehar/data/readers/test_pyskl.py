"""Annotation pickles of pyskl: 3D joints, splits and labels; nothing is executed, and 2D is refused."""

import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.data.readers.pyskl import prepare_pyskl
from ehar.errors import DataError
from tests.helpers.places import SHARED

SAMPLE = SHARED / "formats_sample" / "pyskl" / "sample.pkl"


def annotation(name: str = "S1", label: int = 0, people: int = 2, frames: int = 4, **more: Any) -> dict[str, Any]:
    joints = np.random.default_rng(abs(label)).normal(size=(people, frames, 25, 3)).astype(np.float16)
    return {"frame_dir": name, "label": label, "keypoint": joints, "total_frames": frames, **more}


def dump(folder: Path, content: Any, protocol: int = 4) -> Path:
    file = folder / "a.pkl"
    file.write_bytes(pickle.dumps(content, protocol=protocol))
    return file


def whole() -> dict[str, Any]:
    names = ["A", "B", "C", "D", "E"]
    annotations = [annotation(name, label=index % 2) for index, name in enumerate(names)]
    annotations[1]["keypoint"][1] = 0  # pyskl pads with zeros where there is one person
    return {"split": {"xsub_train": names[:2], "xsub_val": names[2:4]}, "annotations": annotations}


@pytest.mark.parametrize("protocol", [2, 4])
def test_joints_split_and_classes(protocol: int, tmp_path: Path) -> None:
    (tmp_path / "classes.txt").write_text("wave\nwalk\n")
    file = dump(tmp_path, whole(), protocol)
    data = prepare_pyskl(file, split="xsub", classes=tmp_path / "classes.txt")
    assert data.sequence_names == ("A", "B", "C", "D")  # E is in no part of the split
    assert data.class_names == ("wave", "walk") and data.labels.tolist() == [0, 1, 0, 1]
    assert data.is_test is not None and data.is_test.tolist() == [False, False, True, True]
    x, y, z = whole()["annotations"][1]["keypoint"][0, 2, 7].astype(float)
    np.testing.assert_allclose(data.sequence(1)[2, 0, 7], [x, -z, y], atol=1e-6)


def test_two_people_and_no_split(tmp_path: Path) -> None:
    data = prepare_pyskl(dump(tmp_path, whole()), persons=2)
    assert data.sequence_names == ("A", "C", "D", "E") and data.is_test is None
    assert data.class_names == ("class_000", "class_001")
    assert "1 of 5 sequences show fewer than 2 people and are left out: B" in data.notes[1]


def test_the_real_sample_is_read_and_its_lack_is_named() -> None:
    if not SAMPLE.is_file():
        pytest.skip(f"{SAMPLE} is absent")
    with pytest.raises(DataError, match=r"annotation 0, jf7RDuUTrsQ: keypoint: missing, .*Kinetics"):
        prepare_pyskl(SAMPLE)  # of Kinetics: everything but keypoints


class Intruder:
    def __init__(self, function: Any, *arguments: Any) -> None:
        self.call = (function, arguments)

    def __reduce__(self) -> Any:
        return self.call


@pytest.mark.parametrize("protocol", [0, 2, 4])
def test_nothing_is_executed(protocol: int, tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    file = dump(tmp_path, {"annotations": [Intruder(os.mkdir, str(trace))]}, protocol)
    with pytest.raises(DataError, match=r"asks for posix\.mkdir, which is not executed"):
        prepare_pyskl(file)
    assert not trace.exists()


@pytest.mark.parametrize("codec", ["rot13", "utf-8", "zlib"])
def test_bytes_in_another_encoding_than_numpys(codec: str, tmp_path: Path) -> None:
    file = tmp_path / "a.pkl"
    length = bytes([len(codec)])
    file.write_bytes(
        b"\x80\x02c_codecs\nencode\nX\x01\x00\x00\x00aX" + length + b"\x00\x00\x00" + codec.encode() + b"\x86R."
    )
    with pytest.raises(DataError, match=f"not a readable pickle: bytes in the encoding '{codec}'"):
        prepare_pyskl(file)


FLAT = np.zeros((1, 4, 17, 2), dtype=np.float16)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ([1], "annotations: missing"),
        ({"annotations": []}, "annotations: missing"),
        ({"annotations": [1]}, "annotation 0: frame_dir: missing"),
        ({"annotations": [annotation(label=-1)]}, "annotation 0, S1: label: got -1"),
        ({"annotations": [{**annotation(), "label": "wave"}]}, "label: got 'wave'"),
        ({"annotations": [{**annotation(), "keypoint": None}]}, "S1: keypoint: missing"),
        ({"annotations": [{**annotation(), "keypoint": FLAT}]}, "got 2D joints, expected 3D"),
        (
            {"annotations": [{**annotation(), "keypoint": annotation()["keypoint"][:, :, :20]}]},
            "--joints names another",
        ),
        ({"annotations": [{**annotation(), "keypoint": annotation()["keypoint"][0]}]}, r"got float16 of shape \(4, 25"),
        ({"annotations": [{**annotation(), "keypoint": annotation()["keypoint"] * np.inf}]}, "got infinite"),
        ({"annotations": [{**annotation(), "keypoint": annotation()["keypoint"] * 0}]}, "no sequence of 1 people"),
    ],
)
def test_broken_files(content: Any, problem: str, tmp_path: Path) -> None:
    file = dump(tmp_path, content)
    with pytest.raises(DataError, match=problem) as caught:
        prepare_pyskl(file)
    assert "\n" not in str(caught.value) and str(tmp_path) in str(caught.value)


def test_a_split_that_names_no_sequences(tmp_path: Path) -> None:
    split = {"xsub_train": [["S1"]], "xsub_val": []}
    with pytest.raises(DataError, match=r"split: xsub: expected names of sequences only"):
        prepare_pyskl(dump(tmp_path, {"annotations": [annotation()], "split": split}), split="xsub")


def test_truncated_files_and_wrong_options(tmp_path: Path) -> None:
    file = dump(tmp_path, whole())
    with pytest.raises(DataError, match="expected xview_train, and xview_val or xview_test, got xsub_train, xsub_val"):
        prepare_pyskl(file, split="xview")
    (tmp_path / "classes.txt").write_text("wave\n")
    with pytest.raises(DataError, match="label: got 1, expected a number from 0 to 0"):
        prepare_pyskl(file, classes=tmp_path / "classes.txt")
    (tmp_path / "classes.txt").write_text("wave\nwave\n")
    with pytest.raises(DataError, match="got 2 classes, expected at least one, and all different"):
        prepare_pyskl(file, classes=tmp_path / "classes.txt")
    content = file.read_bytes()
    for size in (0, 10, len(content) - 1):
        file.write_bytes(content[:size])
        with pytest.raises(DataError, match="not a readable pickle"):
            prepare_pyskl(file)
    with pytest.raises(DataError, match="no such file"):
        prepare_pyskl(tmp_path / "b.pkl")
