"""HumanML3D: joints of SMPL with y up, classes from captions or rows, and the published test."""

from pathlib import Path

import numpy as np
import pytest

from ehar.data.readers.humanml3d import prepare_humanml3d
from ehar.errors import EharError
from eval.conformance.data import check_data
from tests.helpers.places import SHARED

SAMPLE = SHARED / "formats_sample" / "humanml3d"
GOOD = np.random.default_rng(0).normal(size=(5, 22, 3)).astype(np.float32)
CAPTIONS = {
    "000001": "a man walks.#a/DET man/NOUN walk/VERB#0.0#0.0\nhe runs.#he/PRON run/VERB#0.0#0.0\n",
    "000002": "someone jumps.#someone/PRON jump/VERB#0.0#0.0\n",
    "M000001": "a man walks.#a/DET man/NOUN walk/VERB#0.0#0.0\n",
    "000003": "a dance.#a/DET dance/NOUN#0.0#0.0\n",
    "000004": "a man walks.#a/DET man/NOUN walk/VERB#0.0#0.0\n",
    "000005": "someone jumps.#someone/PRON jump/VERB#0.0#0.0\n",
}


def folder(root: Path) -> Path:
    for name, text in CAPTIONS.items():
        for place, content in (("new_joints", GOOD), ("texts", text)):
            (root / place).mkdir(exist_ok=True)
            if isinstance(content, str):
                (root / place / f"{name}.txt").write_text(content)
            else:
                np.save(root / place / f"{name}.npy", content)
    (root / "test.txt").write_text("000004\n000005\n")
    return root


def test_the_real_sample(tmp_path: Path) -> None:
    if not SAMPLE.is_dir():
        pytest.skip(f"{SAMPLE} is absent")
    (tmp_path / "labels.csv").write_text("012314,sit\n\n000000,walk\n")
    data = prepare_humanml3d(SAMPLE, labels=tmp_path / "labels.csv")
    assert data.class_names == ("sit",) and data.lengths.tolist() == [170] and data.fps == 20
    file = np.load(SAMPLE / "012314.npy")
    np.testing.assert_allclose(data.positions[7, 0], file[7][:, [0, 2, 1]] * [1, -1, 1], atol=1e-6)
    found = check_data(data)
    alone = "all show sit: no recogniser can learn from them alone"
    assert found.passed and [check.name for check in found.checks if check.doubtful] == [alone], str(found)


def test_classes_are_first_verbs_and_the_published_test_is_taken(tmp_path: Path) -> None:
    data = prepare_humanml3d(folder(tmp_path))
    assert data.sequence_names == ("000001", "000002", "000004", "000005", "M000001")
    assert [data.class_names[label] for label in data.labels] == ["walk", "jump", "walk", "jump", "walk"]
    assert data.is_test is not None and data.is_test.tolist() == [False, False, True, True, False]
    assert data.notes == ("1 of 6 files have no class, or one of fewer than 1",)
    assert prepare_humanml3d(tmp_path, least=3).class_names == ("walk",)
    (tmp_path / "test.txt").unlink()
    assert prepare_humanml3d(tmp_path).is_test is None


@pytest.mark.parametrize(
    ("joints", "problem"),
    [
        (GOOD[:, :21], r"got float32 of shape \(5, 21, 3\), expected floats \(frames, 22, 3\)"),
        (np.zeros((5, 263), dtype=np.float32), r"got float32 of shape \(5, 263\)"),
        (GOOD[:0], r"of shape \(0, 22, 3\)"),
        (GOOD.astype(int), "got int64"),
        (np.array([None, {}]), "not a readable .npy: Object arrays cannot be loaded"),
    ],
)
def test_broken_files(joints: np.ndarray, problem: str, tmp_path: Path) -> None:
    file = folder(tmp_path) / "new_joints" / "000002.npy"
    np.save(file, joints)
    with pytest.raises(EharError, match=problem) as caught:
        prepare_humanml3d(tmp_path)
    assert str(caught.value).startswith(f"{file}: ") and "\n" not in str(caught.value)


def test_frames_without_numbers_are_gaps_and_a_file_of_them_is_left_out(tmp_path: Path) -> None:
    """As in the data set as it is made: 007975 and its mirror image are NaN."""
    place = folder(tmp_path) / "new_joints"
    np.save(place / "000002.npy", np.where(np.arange(5)[:, None, None] == 2, np.inf, GOOD))
    np.save(place / "000004.npy", np.full_like(GOOD, np.nan))
    data = prepare_humanml3d(tmp_path)
    assert data.sequence_names == ("000001", "000002", "000005", "M000001")
    assert data.missing is not None and np.flatnonzero(data.missing).tolist() == [5 + 2]
    assert any("are left out: 000004" in note for note in data.notes), data.notes


def test_truncated_files(tmp_path: Path) -> None:
    file = folder(tmp_path) / "new_joints" / "000002.npy"
    content = file.read_bytes()
    for size in (0, 20, len(content) - 1):
        file.write_bytes(content[:size])
        with pytest.raises(EharError, match=r"000002\.npy: not a readable \.npy"):
            prepare_humanml3d(tmp_path)


def test_nothing_names_classes(tmp_path: Path) -> None:
    np.save(tmp_path / "000001.npy", GOOD)
    with pytest.raises(EharError, match="texts: no such folder; expected texts of HumanML3D there, or --labels"):
        prepare_humanml3d(tmp_path)
    labels = tmp_path / "labels.csv"
    labels.write_text("000001,walk,fast\n")
    with pytest.raises(EharError, match=r"labels\.csv: row 1: got '000001,walk,fast', expected a name and a class"):
        prepare_humanml3d(tmp_path, labels=labels)
    labels.write_text("000002,walk\n")
    with pytest.raises(EharError, match="got no sequence with a class of at least 1, of 1 files"):
        prepare_humanml3d(tmp_path, labels=labels)
    with pytest.raises(EharError, match="least: got 0"):
        prepare_humanml3d(tmp_path, labels=labels, least=0)
    with pytest.raises(EharError, match=r"none\.csv: expected a \.csv"):
        prepare_humanml3d(tmp_path, labels=tmp_path / "none.csv")
    with pytest.raises(EharError, match=r"got no \*\.npy"):
        prepare_humanml3d(tmp_path / "none")
