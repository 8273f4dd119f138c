"""A user's own planners: by file, by module, by entry point."""

import json
import sys
from hashlib import sha256
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from typing import Any

import cloudpickle
import numpy as np
import pytest

from ehar.errors import EpisodeError, UsageError
from planners import own_planner
from planners.own_planner import GROUP, Origin, make_own_planner, own_spec
from planners.registry import check_spec, resolve_planner
from tests.helpers.fakes import tiny_data
from tests.helpers.gain_models import model_of, peak_weights
from tests.helpers.tiny_benchmarks import run as run_tiny

OWN = """
from __future__ import annotations
from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from ehar.planner import Planner
from beside import STEP

class Mine(Planner):
    name = "mine"

    def act(self, observation):
        return observation.viewpoint + STEP

class Spiral(Mine):
    name = "spiral"

    def __init__(self, *, radius: float = 5.0, turns: int = 1, way: Literal["left", "right"] = "left",
                 smooth: bool = False, at: tuple[float, float] = (0.0, 1.0), file: Path | None = None,
                 name: str = "spiral", loose=None):
        if radius < 0:
            raise ValueError(f"radius {radius} is negative")
        self.name = name
        self.given = (radius, turns, way, smooth, at, file, loose)

@dataclass
class Data(Mine):
    radius: float
    name: str = "data"

class Plain:
    name = "plain"
    privileged = False
    def reset(self, context): pass
    def act(self, observation): return observation.viewpoint

@dataclass(frozen=True)
class Frozen(Plain):
    radius: float = 5.0

class Incomplete:
    name = "incomplete"

class Nameless(Planner):
    def act(self, observation): return observation.viewpoint

class Still(Planner):
    name = "still"

class Raising(Mine):
    def act(self, observation):
        return observation.viewpoint[:, 7]

class Odd(Mine):
    def __init__(self, size: Missing = 1): pass

class Loud(Planner):
    @property
    def name(self): raise RuntimeError("no\\nname")
    def act(self, observation): return observation.viewpoint

NUMBER = 3
"""
FIELD = """
from ehar.planner import Planner
from planners.value.model import GainModel

class Ring(Planner):
    name = "ring"
    def __init__(self, *, model: GainModel, radius: float = 5.0):
        self.model = model
    def act(self, observation):
        return observation.viewpoint
"""

DERIVE = "; a class that derives from ehar.Planner has all but act"

pytestmark = pytest.mark.usefixtures("own_modules")


@pytest.fixture
def own(tmp_path: Path) -> Path:
    (tmp_path / "beside.py").write_text("STEP = 0.5\n")
    path = tmp_path / "own.py"
    path.write_text(OWN)
    return path


def made(text: str) -> tuple[Any, Origin]:
    planner, origin = resolve_planner(text)
    assert origin is not None
    return planner, origin


def refused(text: str) -> str:
    with pytest.raises(UsageError) as error:
        resolve_planner(text)
    message = str(error.value)
    assert "\n" not in message
    return message


def test_a_planner_from_a_file_which_imports_what_lies_beside_it(own: Path) -> None:
    planner, origin = made(f"{own}:Mine")
    assert (planner.name, planner.privileged) == ("mine", False)
    assert origin == Origin(f"{own}:Mine", {})
    assert made(f"{own}:Plain")[0].name == "plain", "it need not inherit"
    assert sys.path[-1] == str(own.parent), "its folder comes last: nothing of ours is shadowed"


def test_a_file_runs_once_unless_it_changed(own: Path) -> None:
    assert type(made(f"{own}:Mine")[0]) is type(made(f"{own}:Mine")[0])
    own.write_text(OWN.replace('"mine"', '"changed"'))
    assert made(f"{own}:Mine")[0].name == "changed"


def test_arguments_have_the_types_of_their_annotations(own: Path) -> None:
    assert made(f"{own}:Spiral")[0].given == (5.0, 1, "left", False, (0.0, 1.0), None, None)
    given = "radius='4', turns='2', way='right', smooth='true', at='3 4', file='a/b', loose=7"
    planner, origin = made(f"{own}:Spiral({given})")
    assert planner.given == (4.0, 2, "right", True, (3.0, 4.0), Path("a/b"), 7)
    assert origin.arguments == {
        "radius": 4.0,
        "turns": 2,
        "way": "right",
        "smooth": True,
        "at": (3.0, 4.0),
        "file": Path("a/b"),
        "loose": 7,
    }
    same = made(f"{own}:Spiral(radius=4, turns=2, way='right', smooth=True, at=(3, 4), file='a/b', loose=7)")[0]
    assert same.given == planner.given
    assert same.name == planner.name
    assert made(f"{own}:Spiral(file=None, radius=-0.0, name='--x')")[0].given[-2] is None


def test_two_settings_of_one_class_have_two_names(own: Path) -> None:
    assert made(f"{own}:Spiral(radius=4)")[0].name == "spiral(radius=4)"
    assert made(f"{own}:Spiral(radius=4.5, turns=2)")[0].name == "spiral(radius=4.5, turns=2)"
    assert made(f"{own}:Spiral(radius=4, name='near')")[0].name == "near"
    assert made(f"{own}:Data(radius=4)")[0].name == "data(radius=4)"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Incomplete", f"expected what ehar.planner.Planner has, missing: reset, act{DERIVE}"),
        ("Nameless", f"expected what ehar.planner.Planner has, missing: name{DERIVE}"),
        ("Still", "expected what ehar.planner.Planner has, missing: act"),
        ("Planner", "expected what ehar.planner.Planner has, missing: act"),
        ("Path", f"expected what ehar.planner.Planner has, missing: reset, act{DERIVE}"),
        ("Data", "expected its argument radius: float, got none; "
            "give it as --radius VALUE after it, or as Data(radius=...)"),
        ("Mine(radius=5)", "unknown argument 'radius'; it takes none"),
        ("Data(raduis=5)", "unknown argument 'raduis'; it takes radius: float, name: str = 'data'"),
        ("Spiral(radius='five')", "radius: expected float, got 'five'"),
        ("Spiral(radius=True)", "radius: expected float, got True"),
        ("Spiral(turns=1.5)", "turns: expected int, got 1.5"),
        ("Spiral(way='up')", "way: expected Literal['left', 'right'], got 'up'"),
        ("Spiral(smooth='no-act')", "smooth: expected bool, got 'no-act'"),
        ("Spiral(at=(1, 2, 3))", "at: expected tuple[float, float], got (1, 2, 3)"),
        ("Spiral(name='')", "name: expected a line of text, got ''"),
        ("Spiral(radius=-1)", "its constructor raised ValueError: radius -1.0 is negative ({own}, line 22)"),
        ("Frozen(radius=4)", "expected a name that can be set to 'plain(radius=4)': "
            "FrozenInstanceError: cannot assign to field 'name'"),
        ("Loud", "name: RuntimeError: no name ({own}, line 59)"),
        ("Odd(size=3)", "its constructor's annotations cannot be read: NameError: name 'Missing' is not defined"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_in_one_line(own: Path, text: str, message: str) -> None:
    assert refused(f"{own}:{text}") == f"planner {own}:{text.partition('(')[0]}: {message.format(own=own)}"


@pytest.mark.parametrize("name", ["Missing", "NUMBER"])
def test_a_file_without_the_class_says_what_it_defines(own: Path, name: str) -> None:
    defined = "Mine, Spiral, Data, Plain, Frozen, Incomplete, Nameless, Still, Raising, Odd, Loud"
    assert refused(f"{own}:{name}") == f"planner file {own}: expected a class {name!r}, it defines: {defined}"


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("x = 1\ndef (", "SyntaxError: invalid syntax ({path}, line 2)"),
        ("import absent_module", "ModuleNotFoundError: "
            "No module named 'absent_module' ({path}, line 1) while it was loaded"),
        ("\n\n1 / 0", "ZeroDivisionError: division by zero ({path}, line 3) while it was loaded"),
        ("raise SystemExit(1)", "SystemExit: 1 ({path}, line 1) while it was loaded"),
        ("x = 1", "expected a class 'Mine', it defines: no class"),
    ],
)  # fmt: skip
def test_a_file_that_does_not_run(tmp_path: Path, source: str, message: str) -> None:
    path = tmp_path / "broken.py"
    path.write_text(source)
    assert refused(f"{path}:Mine") == f"planner file {path}: {message.format(path=path)}"
    assert not [name for name in sys.modules if name.endswith("_broken")][1:]


def test_a_file_or_module_that_is_not_there(tmp_path: Path) -> None:
    expected = "expected path/to/file.py:ClassName or package.module:ClassName"
    assert refused(f"{tmp_path}/absent.py:Mine") == f"planner file {tmp_path}/absent.py: no such file; {expected}"
    assert refused("absent_lab:Mine") == f"planner module absent_lab: no module 'absent_lab'; {expected}"
    assert refused("json.absent:Mine") == f"planner module json.absent: no module 'json.absent'; {expected}"
    assert refused("oracle:Mine") == f"planner module oracle: no module 'oracle'; {expected}"


def test_a_planner_from_a_module_of_the_present_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "lab_of_mine").mkdir()
    (tmp_path / "lab_of_mine" / "__init__.py").write_text("")
    (tmp_path / "lab_of_mine" / "views.py").write_text(OWN.replace("from beside import STEP", "STEP = 1"))
    (tmp_path / "lab_of_mine" / "broken.py").write_text("import absent_module")
    monkeypatch.chdir(tmp_path)
    planner, origin = made("lab_of_mine.views:Spiral(radius=3)")
    assert planner.name == "spiral(radius=3)"
    assert origin == Origin("lab_of_mine.views:Spiral", {"radius": 3.0})
    assert refused("lab_of_mine.views:Missing").startswith(
        "planner module lab_of_mine.views: expected a class 'Missing', "
    )
    assert refused("lab_of_mine.broken:Mine").startswith(
        "planner module lab_of_mine.broken: ModuleNotFoundError: No mod"
    )


def test_an_entry_point_is_called_by_its_name(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (own.parent / "lab_installed.py").write_text(OWN)
    monkeypatch.syspath_prepend(own.parent)
    points = EntryPoints(
        [
            EntryPoint("swirl", "lab_installed:Spiral", GROUP),
            EntryPoint("twice", "lab_installed:Spiral", GROUP),
            EntryPoint("twice", "lab_installed:Mine", GROUP),
            EntryPoint("gone", "lab_installed:Gone", GROUP),
            EntryPoint("nbv", "lab_installed:Mine", GROUP),
        ]
    )
    monkeypatch.setattr(own_planner, "entry_points", lambda **which: points.select(**which))
    check_spec("swirl(radius=2)")
    planner, origin = made("swirl")
    assert (planner.name, origin) == ("swirl", Origin("swirl", {}))
    assert made("swirl(radius=2)")[0].name == "swirl(radius=2)"
    assert refused("twice") == (
        "planner 'twice': expected one package to bring it, got lab_installed:Spiral, lab_installed:Mine"
    )
    assert refused("gone").startswith(
        "planner 'gone' of lab_installed:Gone: module lab_installed: expected a class 'Gone'"
    )
    assert "oracle-lookahead, gone, swirl, twice, or path" in refused("towers")
    assert refused("nbv") == "planner 'nbv': expected a gain model to value views with, got none", "ours are ours"


def test_a_constructor_that_asks_for_the_gain_model_is_handed_it(tmp_path: Path) -> None:
    (tmp_path / "field.py").write_text(FIELD)
    spec = own_spec(f"{tmp_path}/field.py:Ring(radius=4)")
    assert spec is not None
    model = model_of(peak_weights(np.array([8.0, 1.0, 1.0])))
    planner, origin = make_own_planner(spec, lambda: model)
    assert getattr(planner, "model", None) is model
    assert planner.name == "ring(radius=4)"
    assert origin.arguments == {"radius": 4.0}
    assert refused(f"{tmp_path}/field.py:Ring").endswith(
        ":Ring: expected a gain model for its argument 'model', got none"
    )


def test_it_can_be_sent_to_another_process(own: Path) -> None:
    planner, _ = made(f"{own}:Data(radius=2)")
    payload = cloudpickle.dumps(planner)
    del sys.modules[type(planner).__module__]
    assert cloudpickle.loads(payload).radius == 2.0


def run(planners: list[Any], **options: Any) -> Any:
    return run_tiny(planners, data=tiny_data(sequences=20), starts=1, **options)


@pytest.mark.usefixtures("fake_weights")
def test_two_settings_run_side_by_side_and_the_config_says_which(own: Path, tmp_path: Path) -> None:
    spirals = [f"{own}:Spiral(radius={radius}, file='a')" for radius in (4, 6)]
    summary = run([*spirals, f"{own}:Mine", "no-act"], out=tmp_path / "run").summary
    names = ["spiral(radius=4, file=a)", "spiral(radius=6, file=a)", "mine", "no-act"]
    assert [planner.name for planner in summary.planners] == names
    config = json.loads((tmp_path / "run" / "config.json").read_text())
    first, _, mine, no_act = config["planners"]
    assert first["implementation"] == f"{own}:Spiral"
    assert first["arguments"] == {"radius": 4.0, "file": "a"}
    assert mine["arguments"] == {}
    together = own.read_bytes() + b"\0beside.py\0" + own.with_name("beside.py").read_bytes()
    assert first["source_sha256"] == mine["source_sha256"] == sha256(together).hexdigest()
    assert (no_act["implementation"], no_act["source_sha256"]) == ("planners.heuristic.NoAct", None)
    own.write_text(OWN + "# changed\n")
    with pytest.raises(UsageError, match="holds another run, which differs in planners"):
        run([*spirals, f"{own}:Mine", "no-act"], out=tmp_path / "run")


@pytest.mark.usefixtures("fake_weights")
@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_what_its_code_raises_is_one_line_with_its_own(own: Path, workers: int) -> None:
    with pytest.raises(EpisodeError) as error:
        run([f"{own}:Raising"], workers=workers)
    assert str(error.value) == (
        f"planner 'mine', frame 0: IndexError: index 7 is out of bounds for axis 1 with size 3 ({own}, line 52)"
    )
    assert "IndexError" in repr(error.value.__cause__)


@pytest.mark.slow
@pytest.mark.usefixtures("fake_weights")
def test_two_workers_run_it_as_one_does(own: Path, tmp_path: Path) -> None:
    for workers in (1, 2):
        run([f"{own}:Spiral(radius=4)", "no-act"], workers=workers, out=tmp_path / str(workers))
    written = [(tmp_path / str(workers) / "episodes.jsonl").read_bytes() for workers in (1, 2)]
    assert written[0] == written[1]
