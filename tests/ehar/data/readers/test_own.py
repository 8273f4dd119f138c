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

class Lists:
    def read(self, source):
        data = load_data("solo")
        held = {name: getattr(data, name).tolist() for name in ("positions", "offsets", "labels", "subjects")}
        return replace(data, **held, class_names=list(data.class_names))

class Changes:
    def __init__(self, field: str, value: str) -> None:
        self.change = {field: eval(value)}

    def read(self, source):
        return replace(load_data("solo"), **self.change)
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
        ("Flat", r"read returned: positions: got shape \(\d+, 1, \d+, 2\), expected \(frames, persons, joints, 3\)"),
        ("Empty", r"missing: read"),
        ("Nobody", "expected a class 'Nobody'"),
        ("Mine(scale='x')", "scale: expected float, got 'x'"),
    ],
)
def test_what_a_reader_does_wrong(name: str, problem: str, mine: Path) -> None:
    with pytest.raises(EharError, match=problem) as caught:
        prepare_own(f"{mine}:{name}", mine.with_name("which.txt"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("field", "value", "problem"),
    [
        ("labels", "[0.5, 1.0]", "labels: got dtype float64, expected integers"),
        ("labels", "['jump']", "labels: got dtype <U4, expected integers"),
        ("labels", "[[0], [1, 2]]", "labels: expected an array: ValueError: "),
        ("subjects", "None", "subjects: got dtype object, expected integers"),
        ("subjects", "[0, 1]", r"subjects: got shape \(2,\), expected \(sequences, persons\)"),
        ("is_test", "[0, 1]", "is_test: got dtype int64, expected a bool"),
        ("views", "'front'", "views: got dtype <U5, expected integers"),
        ("skeleton", "None", "skeleton: got None, expected a Skeleton"),
        ("fps", "'30'", "fps: got '30', expected a number"),
        ("name", "5", "name: got 5, expected text"),
        ("class_names", "(1, 2)", r"class_names: got \(1, 2\), expected texts"),
        ("notes", "'all'", "notes: got 'all', expected texts"),
    ],
)
def test_a_field_of_another_type_is_named(field: str, value: str, problem: str, mine: Path) -> None:
    with pytest.raises(EharError, match=rf"reader .*mine\.py:Changes.*: read returned: {problem}") as caught:
        prepare_own(f"{mine}:Changes(field={field!r}, value={value!r})", mine.with_name("which.txt"))
    assert "\n" not in str(caught.value)


def test_lists_are_as_good_as_arrays(mine: Path) -> None:
    held, expected = prepare_own(f"{mine}:Lists", mine.with_name("which.txt")), load_data("solo")
    np.testing.assert_allclose(held.positions, expected.positions, rtol=1e-6)
    np.testing.assert_array_equal(held.labels, expected.labels)
    assert held.class_names == expected.class_names


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
