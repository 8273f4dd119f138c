"""A run with a user's own planners and recogniser: they can be made again from the records."""

import json
import sys
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path
from typing import Any

import pytest

from ehar.data.motion_file import save_motion
from ehar.errors import UsageError
from eval.cli.main import main
from eval.records.config import CONFIG
from eval.verification.checks import FAILED, OK, UNCHECKED, Verification
from eval.verification.verify import verify
from planners import own_planner
from planners.own_planner import GROUP
from tests.helpers.edited_runs import rewrite_figures
from tests.helpers.fakes import FakeRecogniser, tiny_data
from tests.helpers.own_recogniser import OWN as RECOGNISER
from tests.helpers.seeing import Seeing
from tests.helpers.tiny_benchmarks import HashedRecogniser, Log
from tests.helpers.tiny_benchmarks import run as run_tiny

PLANNER = """
from pathlib import Path
import numpy as np
from ehar.planner import Planner

class Wander(Planner):
    name = "wander"

    def __init__(self, *, step: float = 0.1, at: tuple[float, ...] = (), file: Path | None = None, loose=None):
        self.step, self.given = step, (at, file, loose)
        assert loose is None or loose == {"pitch": 1.0}
        assert file is None or isinstance(file, Path)

    def reset(self, context):
        self.way = context.rng.choice([-self.step, self.step], size=context.episodes)

    def act(self, observation):
        target = observation.viewpoint.copy()
        target[:, 1] += np.clip(self.way, -1, 1)
        return target
"""
GIVEN = "(step=1e999, at=(1, 2.5), file='a/b', loose={'pitch': 1.0})"


pytestmark = pytest.mark.usefixtures("own_modules")


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the present folder, with data, planners in a file, a module and an entry point, and a recogniser."""
    for name in ("wander.py", "lab_views.py", "lab_installed.py"):
        (tmp_path / name).write_text(PLANNER)
    (tmp_path / "mine.py").write_text(RECOGNISER)
    save_motion(tmp_path / "tiny.npz", tiny_data(sequences=20))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("recognition.storage.load_recogniser", lambda *_, **__: HashedRecogniser())
    points = EntryPoints([EntryPoint("swirl", "lab_installed:Wander", GROUP)])
    monkeypatch.setattr(own_planner, "entry_points", lambda **which: points.select(**which))
    return tmp_path


def run(planners: list[Any], **options: Any) -> Path:
    run_tiny(planners, data="tiny.npz", starts=1, out=Path("run"), **options)
    return Path("run")


def again(run: Path, episodes: int = 1000) -> Verification:
    return verify(run, rerun_episodes=episodes, reporter=Log())


def unchecked(found: Verification) -> list[str]:
    return [check.what for check in found.checks if check.result == UNCHECKED]


def test_planners_of_a_file_a_module_and_an_entry_point_move_as_they_did(lab: Path) -> None:
    run([f"wander.py:Wander{GIVEN}", "wander.py:Wander", "lab_views:Wander(step=0.2)", "swirl(step=0.3)", "no-act"])
    config = json.loads((lab / "run" / CONFIG).read_text())
    given = {"step": "inf", "at": [1.0, 2.5], "file": "a/b", "loose": {"pitch": 1.0}}
    assert config["planners"][0]["arguments"] == given
    found = again(Path("run"))
    assert found.verdict == "verified"
    assert found.checks[-2].what == f"{5 * 20 * 9} of {5 * 20 * 9} frames of 5 planners"


def test_another_argument_is_another_planner(lab: Path) -> None:
    run(["wander.py:Wander(step=0.1)", "no-act"])
    path = lab / "run" / CONFIG
    path.write_text(path.read_text().replace('"step": 0.1', '"step": -0.5'))
    (reason,) = unchecked(again(Path("run")))
    # Its name is made of its arguments.
    assert reason == (
        "wander(step=0.1): not replayable, as another is made: name wander(step=-0.5), ran: wander(step=0.1)"
    )


def test_one_that_is_told_the_truth_is_not_made_as_one_that_is_not(lab: Path) -> None:
    (lab / "wander.py").write_text(PLANNER.replace('name = "wander"', 'name = "wander"\n    privileged = True'))
    run(["wander.py:Wander", "no-act"])
    path = lab / "run" / CONFIG
    path.write_text(path.read_text().replace('"privileged": true', '"privileged": false'))
    rewrite_figures(lab / "run")
    assert verify("run", reporter=Log()).verdict == "verified", "without its file nobody knows"
    found = again(Path("run"))
    assert [check.name for check in found.checks if check.result == FAILED] == ["moves again"]
    assert str(found.difference).startswith("config.json: wander: privileged: got False, expected True")


def test_one_whose_file_has_changed_or_gone_is_not_made_again(lab: Path) -> None:
    run(["wander.py:Wander", "lab_views:Wander(step=0.2)", Seeing(), "random"])
    (lab / "wander.py").write_text(PLANNER.replace("step: float", "stride: float") + "# changed\n")
    (lab / "lab_views.py").write_text("def (")
    del sys.modules["lab_views"]
    reasons = unchecked(again(Path("run")))
    changed = "wander: not replayable: its file, or one beside it that it imports, has changed: got sha256 "
    assert reasons[0].startswith(changed)
    assert reasons[1].startswith("wander(step=0.2): not replayable: planner module lab_views: SyntaxError: ")
    assert reasons[2] == "seeing: not replayable, as it cannot be made from its name"
    (lab / "wander.py").unlink()
    found = again(Path("run"))
    assert unchecked(found)[0].startswith("wander: not replayable: planner file wander.py: no such file; expected ")
    assert ("moves again", OK) in [(check.name, check.result) for check in found.checks], "random moves as it did"


def test_a_planner_that_moves_otherwise_is_found(lab: Path) -> None:
    # What a file reads is not in its hash.
    reading = PLANNER.replace("[-self.step, self.step]", "[float(Path('step').read_text())]")
    (lab / "wander.py").write_text(reading)
    (lab / "step").write_text("0.1")
    run(["wander.py:Wander", "no-act"])
    (lab / "step").write_text("-0.1")
    found = again(Path("run"))
    assert found.difference is not None and "wander, episode 0 (" in found.difference


def test_an_own_recogniser_sees_what_it_saw(lab: Path) -> None:
    run(["no-act", "wander.py:Wander", "oracle"], recogniser="mine.py:Mine(gain=2)")
    found = again(Path("run"))
    assert found.verdict == "verified"
    recogniser = next(check.what for check in found.checks if check.name == "recogniser")
    assert recogniser.startswith("mine.py:Mine(gain=2), sha256 ")
    (lab / "mine.py").write_text("raise RuntimeError('not run')")
    found = verify(Path("run"), reporter=Log())
    assert unchecked(found) == ["mine.py:Mine(gain=2) runs with --rerun-episodes only"]
    with pytest.raises(UsageError, match=r"no episode can be run once more: recogniser file mine.py: RuntimeError: no"):
        again(Path("run"))
    (lab / "mine.py").write_text(RECOGNISER + "# changed\n")
    found = again(Path("run"))
    assert [check.name for check in found.checks if check.result == FAILED] == ["recogniser"]
    assert str(found.difference).startswith("config.json: recogniser: got sha256 ")
    assert str(found.difference).endswith(", which mine.py:Mine(gain=2) has")


def test_a_recogniser_that_looks_at_other_episodes_is_found(lab: Path) -> None:
    """Episodes that run together show few classes: by them it could tell which."""
    run(["no-act"], recogniser="mine.py:Together")
    found = again(Path("run"), episodes=1)
    (seen,) = (check for check in found.checks if check.name == "seen again")
    assert seen.result == FAILED and "episodes.jsonl: no-act, episode" in seen.what and "got " in seen.what


def test_a_recogniser_that_was_an_object_is_not_replayable(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run(["no-act"], recogniser=FakeRecogniser())
    reason = "recogniser tests.helpers.fakes.FakeRecogniser: not replayable, as it was given as an object"
    assert unchecked(verify(Path("run"), reporter=Log())) == [reason]
    with pytest.raises(SystemExit) as ended:
        main(["verify", "run", "--rerun-episodes", "1"])
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"ehar: error: run: no episode can be run once more: {reason}\n"
