"""A folder of .npy and .csv files with an ehar.json: units, axes, rate, labels, gaps, and broken files of each kind."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.data.preparing.layouts import BODY12
from ehar.data.preparing.mapping import mapped
from ehar.data.readers.arrays import prepare_arrays
from ehar.data.readers.humanml3d import prepare_humanml3d
from ehar.data.source import load_data
from ehar.errors import EharError
from ehar.files import write_text
from eval.conformance.data import check_data
from tests.helpers.places import SHARED

TOLD = {"joints": "body12", "fps": 60, "pattern": "{label}_s{subject}_{split}_{take}.{ending}"}
NUMBERED = "{label}_{number}.{ending}"
SAMPLE = SHARED / "formats_sample" / "humanml3d" / "012314.npy"
JOINTS = np.random.default_rng(0).normal(size=(5, 12, 3))


def folder(root: Path, *, arrays: dict[str, np.ndarray] | None = None, **told: Any) -> Path:
    (root / "ehar.json").write_text(json.dumps(TOLD | told))
    for name, array in (arrays or {"wave_s1_train_1.npy": JOINTS, "wave_s2_test_1.npy": JOINTS}).items():
        if name.endswith(".npy"):
            np.save(root / name, array)
        else:
            np.savetxt(root / name, array.reshape(len(array), -1), delimiter=",")
    return root


def test_what_the_json_says(tmp_path: Path) -> None:
    file = JOINTS[:, :, [0, 2, 1]] * [1, 1, -1] * 1000  # y up
    arrays = {"wave_s3_train_1.npy": file, "wave_s4_test_1.csv": file}
    data = prepare_arrays(folder(tmp_path, arrays=arrays, unit="mm", up="y", license="mine"))
    assert data.skeleton == BODY12 and (data.fps, data.license, data.class_names) == (60, "mine", ("wave",))
    assert data.sequence_names == ("wave_s3_train_1", "wave_s4_test_1") and data.subjects[:, 0].tolist() == [3, 4]
    assert data.is_test is not None and data.is_test.tolist() == [False, True]
    for index in range(2):
        np.testing.assert_allclose(data.sequence(index)[:, 0], JOINTS, atol=1e-5)


def test_endings_in_capitals(tmp_path: Path) -> None:
    place = folder(tmp_path, arrays={"wave_s3_train_1.npy": JOINTS, "wave_s4_test_1.npy": JOINTS})
    (place / "wave_s3_train_1.npy").rename(place / "wave_s3_train_1.NPY")
    data = prepare_arrays(place)
    assert data.subjects[:, 0].tolist() == [3, 4] and data.class_names == ("wave",)


@pytest.mark.parametrize("ending", ["npy", "csv"])
def test_a_real_sample(ending: str, tmp_path: Path) -> None:
    """Joints of HumanML3D, as an array with a description: as its own reader reads them."""
    if not SAMPLE.is_file():
        pytest.skip(f"{SAMPLE} is absent")
    (tmp_path / "arrays").mkdir()
    arrays = {f"sit_1.{ending}": np.load(SAMPLE)}
    source = folder(tmp_path / "arrays", arrays=arrays, joints="smpl22", fps=20, up="y", pattern=NUMBERED)
    write_text(tmp_path / "labels.csv", ["012314,sit\n"])
    data, known = prepare_arrays(source), prepare_humanml3d(SAMPLE.parent, labels=tmp_path / "labels.csv")
    np.testing.assert_allclose(data.positions, known.positions, atol=1e-6)
    assert (data.fps, data.class_names, data.skeleton) == (known.fps, known.class_names, known.skeleton)
    found = check_data(data)
    assert found.passed, str(found)


def test_options_correct_what_the_json_says(tmp_path: Path) -> None:
    body = mapped(load_data("solo"), "body12").sequence(0)[:, 0].astype(np.float64)
    wrong = body[:, :, [0, 2, 1]] * [1, 1, -1] * 1000
    source = folder(tmp_path, arrays={"wave_s3_train_1.npy": wrong})
    advice = " ".join(check.mend for check in check_data(prepare_arrays(source)).failed)
    assert "--unit mm" in advice and "--up y" in advice
    mended = prepare_arrays(source, unit="mm", up="y")
    assert check_data(mended).passed
    np.testing.assert_allclose(mended.positions[:, 0], body, atol=1e-4)


def test_two_people_names_bones_and_gaps(tmp_path: Path) -> None:
    pair = np.random.default_rng(1).normal(size=(4, 2, 3, 3))
    pair[1, 1], pair[2, 0, 2] = 0, np.nan
    data = prepare_arrays(
        folder(
            tmp_path,
            arrays={"hug.npy": pair},
            pattern="{label}.npy",
            joints=["pelvis", "lhand", "rhand"],
            bones=[[0, 1], [0, 2]],
            persons=2,
        )
    )
    assert data.positions.shape == (4, 2, 3, 3) and data.skeleton.bones == ((0, 1), (0, 2)) and data.is_test is None
    assert data.missing is not None and data.missing.tolist() == [False, True, True, False]
    np.testing.assert_allclose(data.positions[1, 1], (pair[0, 1] + pair[2, 1]) / 2, atol=1e-6)


def test_a_header_and_empty_cells(tmp_path: Path) -> None:
    rows = JOINTS.reshape(5, -1).astype(str)
    rows[2, 4] = ""
    text = "\n".join([",".join(f"x{i}" for i in range(36)), *(",".join(row) for row in rows)])
    source = folder(tmp_path, arrays={"wave_s1_train_1.npy": JOINTS})
    (source / "walk_s1_train_2.csv").write_text(f"{text}\n")
    data = prepare_arrays(source)
    walk = data.sequence(data.sequence_names.index("walk_s1_train_2"))
    assert data.missing is not None and data.missing.sum() == 1
    np.testing.assert_allclose(walk[2, 0, 1], (JOINTS[1, 1] + JOINTS[3, 1]) / 2, atol=1e-6)  # the whole joint is lost


def test_a_header_of_numbers_is_no_frame(tmp_path: Path) -> None:
    """Pandas numbers columns that have no names; no frame looks so."""
    rows = [",".join(map(str, range(36))), *(",".join(map(str, row)) for row in JOINTS.reshape(5, -1))]
    source = folder(tmp_path, arrays={"wave_s1_train_1.npy": JOINTS})
    (source / "walk_s1_train_2.csv").write_text("\n".join(rows))
    data = prepare_arrays(source)
    walk = data.sequence(data.sequence_names.index("walk_s1_train_2"))
    np.testing.assert_allclose(walk[:, 0], JOINTS, atol=1e-6)


def test_who_performs_together_is_told_as_left_out(tmp_path: Path) -> None:
    pair = np.random.default_rng(1).normal(size=(4, 2, 12, 3))
    data = prepare_arrays(folder(tmp_path, arrays={"hug_s1_train_1.npy": pair}, persons=2))
    assert (data.subjects == -1).all() and "who performs is left out: one number cannot name 2 people" in data.notes
    alone = prepare_arrays(folder(tmp_path, arrays={"hug_s1_train_1.npy": pair[:, 0]}))
    assert (alone.subjects == 1).all() and not any("who performs" in note for note in alone.notes)


def test_a_class_may_have_several_words(tmp_path: Path) -> None:
    arrays = {"pick_up_01.npy": JOINTS, "pick_down_01.npy": JOINTS}
    data = prepare_arrays(folder(tmp_path, arrays=arrays, pattern="{label}_{number}.npy"))
    assert data.class_names == ("pick_down", "pick_up")


@pytest.mark.parametrize(
    ("told", "problem"),
    [
        ({"joints": "coco18"}, "joints: got 'coco18', expected names, or one of coco17"),
        ({"joints": ["a", "b"]}, r"bones: got none"),
        ({"joints": ["a", "a"], "bones": [[0, 1]]}, "joints: expected names that all differ"),
        ({"bones": [[0, 12]]}, r"bones: got \[0, 12\], expected pairs of joints from 0 to 11"),
        ({"unit": "inch"}, "unit: got 'inch'"),
        ({"up": "x"}, "up: "),
        ({"fps": 0}, "fps: expected a number above 0, got 0"),
        ({"fps": "30"}, "fps: expected a number, got '30'"),
        ({"pattern": "{name}.npy"}, r"pattern: got '\{name\}.npy', expected \{label\} in it"),
        ({"pattern": "{label}{label}"}, r"expected \{label\} in it once"),
        ({"pattern": "{label}_{subject}{subject}"}, r"expected \{subject\} in it once"),
        ({"pattern": "x_{label}.npy"}, "a name that does not fit the pattern"),
        ({"persons": 0}, "persons: expected at least 1"),
        ({"person": 2}, "unknown person"),
    ],
)
def test_broken_descriptions(told: dict[str, Any], problem: str, tmp_path: Path) -> None:
    with pytest.raises(EharError, match=problem) as caught:
        prepare_arrays(folder(tmp_path, **told))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("array", "problem"),
    [
        (JOINTS[:, :11], r"got float64 of shape \(5, 11, 3\), expected numbers of shape \(frames, 1, 12, 3\)"),
        (JOINTS[:0], "of shape"),
        (JOINTS.reshape(5, -1), r"got float64 of shape \(5, 36\)"),
        (np.float64(3), "a single number"),
        (JOINTS.astype(complex), "got complex128"),
        (np.array([None]), "not a readable .npy"),
        (np.zeros((5, 12, 3)), "got no sequence of 1 people"),
        (np.where(np.arange(12)[:, None] == 3, np.nan, JOINTS), "joint 'right_elbow' of person 1 is in no frame"),
    ],
)
def test_broken_arrays(array: np.ndarray, problem: str, tmp_path: Path) -> None:
    source = folder(tmp_path, arrays={"wave_s1_train_1.npy": array})
    with pytest.raises(EharError, match=problem):
        prepare_arrays(source)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", r"got float64 of shape \(0, 0\)"),
        ("a,b\n", r"got float64 of shape \(0, 0\)"),
        ("1,2,3\n", r"got float64 of shape \(1, 3\), expected .*, or 36 numbers a row"),
        ("1,2\n1,2,3\n", "line 2: got 3 numbers, expected 2 as in the first"),
        ("1,2\n1,left\n", "line 2: got 'left', expected a number"),
        ("1;2;3\n4;5;6\n", "line 2: got '4;5;6', expected a number"),
    ],
)
def test_broken_rows(text: str, problem: str, tmp_path: Path) -> None:
    source = folder(tmp_path)
    (source / "wave_s1_train_2.csv").write_text(text)
    with pytest.raises(EharError, match=problem):
        prepare_arrays(source)


def test_folders_without_a_description_or_arrays(tmp_path: Path) -> None:
    with pytest.raises(EharError, match=r"ehar\.json: expected a description of arrays"):
        prepare_arrays(tmp_path)
    (tmp_path / "ehar.json").write_text(json.dumps(TOLD))
    with pytest.raises(EharError, match=r"got no \.npy and no \.csv"):
        prepare_arrays(tmp_path)
    (tmp_path / "ehar.json").write_text("{")
    with pytest.raises(EharError, match="expected the JSON of a description of arrays"):
        prepare_arrays(tmp_path)
