"""Northwestern-UCLA: the original files give the joints, labels, split and views that are known of them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.data.motion_file import load_motion
from ehar.data.readers.nwucla import prepare_nwucla
from ehar.errors import DataError
from eval.conformance.data import check_data
from tests.helpers.places import SHARED

SAMPLE = SHARED / "formats_sample" / "nwucla"
GOOD = np.random.default_rng(0).normal(size=(4, 20, 3)).tolist()


def write(folder: Path, content: Any, name: str = "a01_s01_e00_v01.json") -> Path:
    file = folder / name
    file.write_text(content if isinstance(content, str) else json.dumps(content))
    return file


def test_the_real_sample_is_what_is_known_of_it() -> None:
    known = SHARED / "nwucla.npz"
    if not (SAMPLE.is_dir() and known.is_file()):
        pytest.skip(f"{SAMPLE} or {known} is absent")
    data, whole = prepare_nwucla(SAMPLE), load_motion(known)
    assert data.skeleton == whole.skeleton and data.fps == whole.fps
    for index, name in enumerate(data.sequence_names):
        at = whole.sequence_names.index(name)
        np.testing.assert_allclose(data.sequence(index), whole.sequence(at), atol=1e-6)
        assert data.class_names[data.labels[index]] == whole.class_names[whole.labels[at]]
        assert data.subjects[index] == whole.subjects[at]
        assert data.views is not None and whole.views is not None and data.views[index] == whole.views[at]
    assert len(data.labels) == 3 and data.is_test is not None and data.is_test.tolist() == [False, False, True]
    assert check_data(data).passed


def test_only_one_camera_leaves_no_split(tmp_path: Path) -> None:
    write(tmp_path, {"skeletons": GOOD, "label": 1})
    data = prepare_nwucla(tmp_path)
    assert data.is_test is None and data.notes[1].startswith("no split: the published one has no test sequence")


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("{", "expected JSON"),
        ("[" * 100_000, "expected JSON"),
        ([1], "skeletons: missing"),
        ({"label": 1}, "skeletons: missing"),
        ({"skeletons": []}, r"skeletons: got shape \(0,\)"),
        ({"skeletons": [row[:19] for row in GOOD]}, r"got shape \(4, 19, 3\)"),
        ({"skeletons": [*GOOD, GOOD[0][:19]]}, "ragged list"),
        ({"skeletons": "text"}, "ragged list|got shape"),
        ({"skeletons": [[["x"] * 3] * 20]}, "ragged list"),
        ({"skeletons": [*GOOD, [[float("nan")] * 3] * 20]}, "NaN or infinite in frame 4"),
    ],
)
def test_broken_files(content: Any, problem: str, tmp_path: Path) -> None:
    file = write(tmp_path, content)
    with pytest.raises(DataError, match=problem) as caught:
        prepare_nwucla(tmp_path)
    assert str(file) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["walk.json", "a07_s01_e00_v01.json", "a01_s01_e00.json"])
def test_names_of_other_sets(name: str, tmp_path: Path) -> None:
    write(tmp_path, {"skeletons": GOOD}, name)
    with pytest.raises(DataError, match=f"{name}: got a name"):
        prepare_nwucla(tmp_path)


def test_a_folder_without_files(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"got no \*\.json"):
        prepare_nwucla(tmp_path)
