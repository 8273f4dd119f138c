"""A reader of your own: a class of a file, with arguments, on the command line; what it does wrong is one line."""

from pathlib import Path

import numpy as np
import pytest

from ehar.data.motion_file import load_motion
from ehar.data.preparing.mapping import mapped
from ehar.data.readers.own import prepare_own
from ehar.data.source import load_data
from ehar.errors import EharError
from eval.cli.main import main
from tests.helpers.pages import DOCS, python_blocks

SOURCE = """
from dataclasses import replace
from ehar import load_data

class Mine:
    def __init__(self, scale: float = 1.0) -> None:
        self.scale = scale

    def read(self, source):
        data = load_data(source.read_text())
        return replace(data, positions=data.positions * self.scale, name="mine")

class Breaks:
    def read(self, source):
        return 1 / 0

class Leaves:
    def read(self, source):
        raise SystemExit(3)

class Lies:
    def read(self, source):
        return "data"

class Flat:
    def read(self, source):
        data = load_data("solo")
        return replace(data, positions=data.positions[..., :2])

class Empty:
    pass
"""


@pytest.fixture
def mine(tmp_path: Path, own_modules: None) -> Path:
    (tmp_path / "mine.py").write_text(SOURCE)
    (tmp_path / "which.txt").write_text("solo")
    return tmp_path / "mine.py"


def test_a_reader_on_the_command_line(mine: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, out = str(mine.with_name("which.txt")), mine.with_name("mine.npz")
    main(["data", "prepare", "own", f"{mine}:Mine", "--scale", "100", source, str(out), "--unit", "cm"])
    assert "11 passed" in capsys.readouterr().out
    np.testing.assert_allclose(load_motion(out).positions, load_data("solo").positions, atol=1e-5)
    with pytest.raises(SystemExit) as ended:
        main(["data", "prepare", "own", f"{mine}:Mine", "--scale", "1000", source, str(out)])
    assert ended.value.code == 1
    assert "--unit mm" in capsys.readouterr().out


def test_the_page_about_it_shows_a_reader_that_works(
    tmp_path: Path, own_modules: None, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.py").write_text(python_blocks(DOCS / "own-reader.md")[0])
    body, recordings = mapped(load_data("solo"), "body12"), tmp_path / "recordings"
    recordings.mkdir()
    for index, name in enumerate(("walk_1", "walk_2", "jump_1")):
        np.savetxt(recordings / f"{name}.txt", body.sequence(index).reshape(body.lengths[index], -1))
    out = tmp_path / "mine.npz"
    main(["data", "prepare", "own", f"{tmp_path}/mine.py:Rows", "--fps", "25", str(recordings), str(out)])
    assert "11 passed" in capsys.readouterr().out
    data = load_motion(out)
    assert data.class_names == ("jump", "walk") and data.labels.tolist() == [0, 1, 1]
    assert data.fps == 25


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("Breaks", r"read raised ZeroDivisionError: division by zero \(.*mine\.py, line 15\)"),
        ("Leaves", r"read raised SystemExit: 3 \(.*mine\.py, line \d+\)"),
        ("Lies", r"read returned str, expected an ehar\.MotionData"),
        ("Flat", r"read returned positions \(\d+, 1, \d+, 2\), expected \(frames, persons, joints, 3\)"),
        ("Empty", r"missing: read"),
        ("Nobody", "expected a class 'Nobody'"),
        ("Mine(scale='x')", "scale: expected float, got 'x'"),
    ],
)
def test_what_a_reader_does_wrong(name: str, problem: str, mine: Path) -> None:
    with pytest.raises(EharError, match=problem) as caught:
        prepare_own(f"{mine}:{name}", mine.with_name("which.txt"))
    assert "\n" not in str(caught.value)


def test_joints_in_a_camera_s_axes_stay_in_them(tmp_path: Path, own_modules: None) -> None:
    """As other readers turn them: x to the camera's right, y away from it."""
    (tmp_path / "seen.py").write_text(
        "import numpy as np\n"
        "from dataclasses import replace\n"
        "from ehar import load_data\n\n"
        "class Seen:\n"
        "    def read(self, source):\n"
        "        data = load_data('solo')\n"
        "        return replace(data, views=np.zeros(len(data.labels), dtype=int))\n"
    )
    turned = prepare_own(f"{tmp_path}/seen.py:Seen", tmp_path, up="y").positions
    across, up, toward = np.moveaxis(load_data("solo").positions, -1, 0)
    np.testing.assert_allclose(turned, np.stack([-across, toward, up], axis=-1), atol=1e-6)


def test_its_own_errors_stay(mine: Path) -> None:
    mine.with_name("which.txt").write_text("nowhere")
    with pytest.raises(EharError, match="nowhere"):
        prepare_own(f"{mine}:Mine", mine.with_name("which.txt"))
