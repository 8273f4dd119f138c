"""Files of every format whose unit, axis or side is wrong: the check says so, and the option that it names mends it."""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.data.motion_file import load_motion
from ehar.data.preparing.axes import UNITS, Up, up_rotation
from eval.cli.main import main
from tests.helpers.original_files import FORMATS, walker

OF_CAMERAS = ("ntu", "nwucla")  # whose joints are in the frame of each camera


def in_file(kind: str, *, unit: str, up: Up) -> FloatArray:
    """Return the walker as a file of some unit and axis has it."""
    turn = up_rotation(up, of_camera=kind in OF_CAMERAS)
    joints: FloatArray = walker(FORMATS[kind][2]) @ turn / UNITS[unit]
    return joints


def wrong_unit(kind: str, unit: str, up: Up) -> tuple[FloatArray, str]:
    other = "mm" if unit == "m" else "m"
    return in_file(kind, unit=other, up=up), f"--unit {other}"


def wrong_axis(kind: str, unit: str, up: Up) -> tuple[FloatArray, str]:
    other: Up = "z" if up == "y" else "y"
    return in_file(kind, unit=unit, up=other), f"--up {other}"


def mirrored(kind: str, unit: str, up: Up) -> tuple[FloatArray, str]:
    return in_file(kind, unit=unit, up=up) * [-1, 1, 1], "--mirror"


def prepared(source: Path, kind: str, out: Path, *options: str) -> int:
    """Return the exit code of `ehar data prepare`."""
    place = source / "a.pkl" if kind == "pyskl" else source
    try:
        main(["data", "prepare", FORMATS[kind][0], str(place), str(out), *options])
    except SystemExit as ended:
        return int(ended.code or 0)
    return 0


@pytest.mark.parametrize("wrong", [wrong_unit, wrong_axis, mirrored])
@pytest.mark.parametrize("kind", FORMATS)
def test_the_option_that_the_check_names_mends_the_file(
    kind: str,
    wrong: Callable[[str, str, str], tuple[FloatArray, str]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if kind == "c3d" and find_spec("ezc3d") is None:
        pytest.skip("ezc3d is not installed: pip install -e '.[c3d]'")
    _, write, skeleton, unit, up = FORMATS[kind]
    source, out = tmp_path / "files", tmp_path / "out.npz"
    source.mkdir()
    joints, option = wrong(kind, unit, up)
    write(source, joints)
    if kind != "pyskl":  # which is one file; others are walked through, and macOS leaves these beside them
        for file in [*source.rglob("*_*.*"), *source.rglob("*.npy"), *source.rglob("*.skeleton")]:
            file.with_name(f"._{file.name}").write_bytes(b"\x00\x05\x16\x07")
    assert prepared(source, kind, out) == 1
    assert f"prepare it again with {option}" in capsys.readouterr().out
    if (kind, option) == ("c3d", "--unit m"):  # the file itself says mm
        assert prepared(source, kind, out, *option.split()) == 2
        assert "--unit 1 if the file is wrong" in capsys.readouterr().err
        option = "--unit 1"
    assert prepared(source, kind, out, *option.split()) == 0
    data = load_motion(out)
    order = [data.skeleton.joint_names.index(name) for name in skeleton.joint_names]
    assert len(data.labels) == 1
    np.testing.assert_allclose(data.positions[:, 0, order], walker(skeleton), atol=2e-3 if kind == "c3d" else 1e-4)
