"""The modules that a user's own file imports from beside it."""

import sys
from hashlib import sha256
from pathlib import Path

import pytest

from ehar.motion import GridMotion
from ehar.plugins.beside import imported_from_beside
from ehar.plugins.class_spec import ClassSpec
from ehar.plugins.loading import load_class, source_sha256

pytestmark = pytest.mark.usefixtures("own_modules")

FILES = {
    "lab/mine.py": "import absent, beside_a, numpy, json, ehar.motion\nfrom beside_lab.inner import deep as d",
    "lab/beside_a.py": "def late():\n    import beside_b",
    "lab/beside_b.py": "import beside_a, mine, beside_above",
    "lab/beside_lab/inner/deep.py": "from ..tools import hammer\nfrom . import near, nowhere",  # without an __init__
    "lab/beside_lab/inner/near.py": "def (",  # no Python
    "lab/beside_lab/tools/__init__.py": "",
    "lab/beside_lab/tools/hammer.py": "",
    "lab/beside_lab/tools/saw.py": "",
    "lab/site-packages/beside_installed.py": "",
    "lab/json.py": "",
    "lab/numpy.py": "",  # Python finds the installed one first
    "lab/unread.py": "",
    "beside_above.py": "",
}


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    sys.path += [str(tmp_path / "lab"), str(tmp_path), str(tmp_path / "lab" / "site-packages")]
    return tmp_path / "lab"


def names(lab: Path, file: str) -> list[str]:
    return [path.relative_to(lab).as_posix() for path in imported_from_beside(lab / file)]


def test_what_is_imported_through_one_another_is_found_and_nothing_else(lab: Path) -> None:
    inner = ["beside_lab/inner/deep.py", "beside_lab/inner/near.py"]
    tools = ["beside_lab/tools/__init__.py", "beside_lab/tools/hammer.py"]
    assert names(lab, "mine.py") == ["beside_a.py", "beside_b.py", *inner, *tools]
    assert not {"mine", "beside_a", "beside_lab"} & set(sys.modules), "nothing is run"


def test_what_is_above_or_installed_does_not_count(lab: Path) -> None:
    (lab / "mine.py").write_text("import beside_above, beside_installed")
    assert names(lab, "mine.py") == []


def test_the_hash_is_that_of_the_file_alone_unless_it_imports_one_beside_it(lab: Path) -> None:
    alone, helped = "class Mine: pass\n", "from beside_lab.tools.hammer import *\nclass Mine: pass\n"
    (lab / "own.py").write_text(alone)
    spec = ClassSpec(str(lab / "own.py"), "Mine")
    assert source_sha256(load_class(spec, "planner")) == sha256(alone.encode()).hexdigest()
    (lab / "own.py").write_text(helped)
    found = {source_sha256(load_class(spec, "planner"))}
    assert found != {sha256(helped.encode()).hexdigest()}
    (lab / "unread.py").write_text("x = 1")
    assert source_sha256(load_class(spec, "planner")) in found
    (lab / "beside_lab" / "tools" / "hammer.py").write_text("x = 1")
    assert source_sha256(load_class(spec, "planner")) not in found


def test_the_hash_of_a_class_of_ehar_is_that_of_its_file() -> None:
    path = Path(str(sys.modules["ehar.motion"].__file__))
    assert source_sha256(GridMotion) == sha256(path.read_bytes()).hexdigest()
