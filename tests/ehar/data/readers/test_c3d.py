"""C3D: named markers become joints; files that ezc3d hangs on, or dies of, end in one line."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.data.readers import c3d
from ehar.data.readers.c3d import nearest_bones, prepare_c3d, read_c3d
from ehar.data.readers.utd_mhad import prepare_utd_mhad
from ehar.errors import DataError, UsageError
from eval.conformance.data import check_data
from tests.helpers.places import SHARED

ezc3d = pytest.importorskip("ezc3d", reason="ezc3d is not installed: pip install -e '.[c3d]'")

SAMPLE = SHARED / "formats_sample" / "utd_mhad"
NAMES = ("HEAD", "CLAV", "LSHO", "RSHO", "LANK", "RANK")
STANDING = np.array([[0, 0, 1700], [0, 0, 1450], [0, 200, 1400], [0, -200, 1400], [0, 100, 80], [0, -100, 80]])  # [mm]
FRAMES = 12


def save(file: Path, *, names: tuple[str, ...] = NAMES, unit: str = "mm", fps: float = 100.0, **more: Any) -> Path:
    """Write people who rise by a millimetre a frame; the last marker is lost in frame 3."""
    made = ezc3d.c3d()
    points = np.ones((4, len(names), FRAMES))
    place = np.resize(STANDING, (len(names), 3))
    points[:3] = place.T[:, :, None] + np.arange(FRAMES) * np.array([0, 0, 1])[:, None, None]
    points[:3, -1, 3] = np.nan
    points = more.get("points", points)
    made["parameters"]["POINT"]["RATE"]["value"] = [fps]
    made["parameters"]["POINT"]["UNITS"]["value"] = [unit]
    made["parameters"]["POINT"]["LABELS"]["value"] = list(names)
    made["data"]["points"] = points
    made.write(str(file))
    return file


def test_markers_become_joints_in_metres(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    save(tmp_path / "walk_1.c3d", names=tuple(f"Anna:{name}" for name in NAMES))
    save(tmp_path / "sub" / "bow_2.c3d", names=(*NAMES[::-1], "*12", "STICK"))
    data = prepare_c3d(tmp_path)
    assert data.class_names == ("bow", "walk") and data.sequence_names == ("sub/bow_2", "walk_1")
    assert set(data.skeleton.joint_names) == set(NAMES) and data.fps == 100
    left, right = (data.skeleton.joint_names.index(name) for name in ("LANK", "RANK"))
    assert data.skeleton.mirror[left] == right
    order = [data.skeleton.joint_names.index(name) for name in NAMES]
    np.testing.assert_allclose(data.sequence(1)[0, 0, order], STANDING / 1000, atol=1e-6)
    np.testing.assert_allclose(data.sequence(1)[:, 0, order[-1], 2], 0.08 + np.arange(FRAMES) / 1000, atol=1e-6)
    assert data.missing is not None and np.flatnonzero(data.missing).tolist() == [FRAMES + 3]  # of RANK, not of STICK
    assert any("1 markers are not in all files" in note for note in data.notes)


def test_a_real_sample(tmp_path: Path) -> None:
    """Real motion of UTD-MHAD as markers in a C3D file: there is no C3D file among the samples."""
    if not SAMPLE.is_dir():
        pytest.skip(f"{SAMPLE} is absent")
    known = prepare_utd_mhad(SAMPLE)
    motion, names = known.sequence(0)[:, 0], known.skeleton.joint_names
    points = np.ones((4, len(names), len(motion)))
    points[:3] = 1000 * motion.transpose(2, 1, 0)
    save(tmp_path / "swipe_1.c3d", names=names, points=points, fps=known.fps)
    data = prepare_c3d(tmp_path)
    order = [data.skeleton.joint_names.index(name) for name in names]
    np.testing.assert_allclose(data.sequence(0)[:, 0, order], motion, atol=1e-5)
    assert data.fps == known.fps and data.missing is None
    assert check_data(data).passed, str(check_data(data))


def test_bones_join_the_nearest(tmp_path: Path) -> None:
    line = np.array([[0.0, 0, 0], [3, 0, 0], [1, 0, 0], [2, 0, 0]])
    assert nearest_bones(np.stack([line, line + 1])) == ((0, 2), (1, 3), (2, 3))


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (lambda held: b"", "got no header of a C3D file"),
        (lambda held: b"PK\x03\x04" + held[4:], "got no header of a C3D file"),
        (lambda held: held[:900], "it ends too soon"),
        (lambda held: held[: len(held) // 2], "it ends too soon"),
        (lambda held: held[:2] + b"\x00\x00" + held[4:], "got a header of 0 markers"),
        (lambda held: held[:512] + bytes(4) + held[516:], "not a readable C3D file|labels|frame rate"),
    ],
)
def test_a_broken_file_ends_in_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: Any, problem: str
) -> None:
    monkeypatch.setattr(c3d, "LIMIT", 20.0)
    file = save(tmp_path / "walk_1.c3d")
    file.write_bytes(content(file.read_bytes()))
    with pytest.raises(DataError, match=problem) as raised:
        read_c3d(file)
    assert "\n" not in str(raised.value) and str(file) in str(raised.value)


def test_a_file_that_takes_forever_ends_in_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(c3d, "LIMIT", 0.2)
    monkeypatch.setattr(c3d, "_READ", "import time; time.sleep(60)")
    with pytest.raises(DataError, match=r"ezc3d takes longer than 0\.2 s"):
        read_c3d(save(tmp_path / "walk_1.c3d"))


def test_what_does_not_fit_is_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"got no \.c3d files"):
        prepare_c3d(tmp_path)
    save(tmp_path / "walk_1.c3d", unit="m")
    with pytest.raises(
        DataError, match=r"POINT:UNITS: got m, expected mm; --unit m reads it, --unit 0\.001 if the file"
    ):
        prepare_c3d(tmp_path)
    with pytest.raises(DataError, match="does not fit the pattern"):
        prepare_c3d(tmp_path, pattern="{label}-{number}.c3d")
    save(tmp_path / "walk_2.c3d", unit="m", names=("A", "B", "C", "D"))
    with pytest.raises(DataError, match="got 0 markers that all files name, expected at least 4"):
        prepare_c3d(tmp_path, unit="m")
    save(tmp_path / "walk_2.c3d", unit="m", fps=50.0)
    with pytest.raises(DataError, match="got 50 frames a second, expected 100"):
        prepare_c3d(tmp_path, unit="m")


@pytest.mark.parametrize(("word", "unit"), [("Meters", "m"), ("millimetres", "mm"), ("MM", "mm"), ("centimeter", "cm")])
def test_units_in_words(tmp_path: Path, word: str, unit: str) -> None:
    save(tmp_path / "walk_1.c3d", unit=word)
    assert prepare_c3d(tmp_path, unit=unit).lengths.tolist() == [FRAMES]
    with pytest.raises(DataError, match=f"POINT:UNITS: got {unit}, expected"):
        prepare_c3d(tmp_path, unit="mm" if unit == "m" else "m")


def test_a_unit_that_is_not_known_is_told(tmp_path: Path) -> None:
    save(tmp_path / "walk_1.c3d", unit="in")
    assert "POINT:UNITS: in is no unit that is known, 0.0254 is taken" in prepare_c3d(tmp_path, unit="0.0254").notes


def test_without_the_library_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(c3d, "find_spec", lambda _: None)
    with pytest.raises(UsageError, match=r"pip install -e '\.\[c3d\]'"):
        prepare_c3d(tmp_path)
