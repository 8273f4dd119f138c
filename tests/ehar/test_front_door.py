"""What `import ehar` gives, how fast, and that every folder shows what it says it does."""

import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import ehar
from ehar import Camera, Conditions, Skeleton, load_data
from ehar.batch import Batch
from ehar.data.scenario import part_of, windows
from ehar.plugins.loading import source_file, source_sha256

ROOT = Path(__file__).parents[2]
NOUNS = (
    "Planner Observation Context Recogniser Recognition Workspace Camera Vehicle Conditions MotionData Skeleton "
    "World Localisation "
    "load_data save_motion rollout GridMotion FlightMotion PerfectSensor EstimatorSensor EharError __version__"
).split()
HEAVY = ("torch", "scipy", "casadi", "ruckig", "gymnasium", "matplotlib", "filterpy", "sklearn", "pandas")
PACKAGES = ("ehar", "recognition", "planners", "eval")
FOLDERS = sorted(
    ".".join(file.parent.relative_to(ROOT).parts)
    for package in PACKAGES
    for file in (ROOT / package).rglob("__init__.py")
)


def printed(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


def test_the_nouns_are_all_there_and_listed() -> None:
    assert dir(ehar) == sorted(NOUNS)
    for name in NOUNS:
        assert getattr(ehar, name) is not None
    with pytest.raises(AttributeError, match="ehar has no 'Plannr'; it has: Camera, "):
        _ = ehar.Plannr


def test_importing_it_brings_nothing_that_takes_long() -> None:
    assert (
        printed(f"import sys, ehar, eval, planners; print([name for name in {HEAVY} if name in sys.modules])") == "[]"
    )


@pytest.mark.parametrize(
    "first",
    ["import ehar.rollout", "from ehar.rollout import Record", "import ehar", "import ehar.runner", "import eval"],
)
def test_rollout_is_the_function_whatever_was_imported_first(first: str) -> None:
    code = (
        f"{first}\nimport ehar.rollout\nfrom ehar import rollout\nfrom ehar.rollout import Record\nimport ehar, pickle"
    )
    told = "print(rollout.__name__, rollout is ehar.rollout, pickle.loads(pickle.dumps(rollout)) is rollout)"
    assert printed(f"{code}\n{told}") == "rollout True True"


def inits() -> list[tuple[str, ast.Module]]:
    return [(name, ast.parse((ROOT / name.replace(".", "/") / "__init__.py").read_text())) for name in FOLDERS]


@pytest.mark.parametrize(("name", "tree"), inits(), ids=FOLDERS)
def test_a_folder_says_what_it_is_and_its_nouns_are_there_for_readers_and_for_python(
    name: str, tree: ast.Module
) -> None:
    assert ast.get_docstring(tree)
    blocks = [node for node in tree.body if isinstance(node, ast.If)]
    told = {
        alias.asname: node.module
        for block in blocks
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    folder = import_module(name)
    offered = getattr(folder, "__all__", [])
    assert set(offered) - set(vars(folder)) <= told.keys() <= set(offered), "mypy and Python are told the same"
    for noun, module in told.items():
        assert getattr(folder, noun) is getattr(import_module(str(module)), noun)
        assert not (ROOT / name.replace(".", "/") / f"{noun}.py").exists(), "a module would take the name"


def test_no_folder_holds_many_more_than_fifteen_modules() -> None:
    for name in FOLDERS:
        modules = [file for file in (ROOT / name.replace(".", "/")).glob("*.py") if file.name != "__init__.py"]
        assert len(modules) <= (19 if name == "ehar" else 16), name


def test_what_a_notebook_prints_is_short() -> None:
    data = load_data("duo")
    scenarios = windows(data, part_of(data, "test"), 20, 20)
    shown = (data, data.skeleton, scenarios, Camera(), Conditions(), Conditions(data=data))
    for one in shown:
        assert len(repr(one)) <= 300, repr(one)
    assert repr(data.skeleton) == "Skeleton(joint_names=<16>, bones=<15>)"
    assert repr(Skeleton(("a", "b"), ((0, 1),))) == "Skeleton(joint_names=('a', 'b'), bones=((0, 1),))"
    assert repr(Conditions(length=20)) == "Conditions(data='duo', length=20)"
    assert "float32[" in repr(Batch(*(data.positions[None],) * 4, names=("one",)))  # type: ignore[arg-type]


def test_a_class_of_a_notebook_has_no_file(monkeypatch: pytest.MonkeyPatch) -> None:
    cell: dict[str, type] = {"__name__": "__main__"}  # type: ignore[dict-item]
    exec("class Mine: pass", cell)
    monkeypatch.delattr(sys.modules["__main__"], "__file__", raising=False)
    assert source_file(cell["Mine"]) is None
    assert source_sha256(cell["Mine"]) is None
