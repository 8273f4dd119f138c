"""Runs with a user's own sensor and motion: their files are compared by hash, and run only where that is asked for."""

from pathlib import Path
from typing import Any

import pytest

from ehar.conditions import Conditions
from ehar.data.motion_file import save_motion
from ehar.errors import UsageError
from ehar.motion import GridMotion
from ehar.sensors.perfect import PerfectSensor
from eval import benchmark
from eval.replays.rerun import replay_run
from eval.running.run import read_run
from eval.verification.checks import FAILED, UNCHECKED, Verification
from eval.verification.inputs import check_inputs
from eval.verification.verify import verify
from tests.helpers.fakes import tiny_data
from tests.helpers.own_world import OWN
from tests.helpers.tiny_benchmarks import HashedRecogniser, Log

pytestmark = pytest.mark.usefixtures("own_modules")
PLANNERS = ["no-act", "towards", "random", "oracle"]


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "mine.py").write_text(OWN)
    save_motion(tmp_path / "tiny.npz", tiny_data(sequences=20))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("recognition.storage.load_recogniser", lambda *_, **__: HashedRecogniser())
    return tmp_path


def run(**options: Any) -> Path:
    benchmark(PLANNERS, Conditions(data="tiny.npz", length=10, **options), out="run", reporter=Log())
    return Path("run")


def again(episodes: int = 1000) -> Verification:
    return verify("run", rerun_episodes=episodes, reporter=Log())


def unchecked(found: Verification) -> dict[str, str]:
    return {check.name: check.what for check in found.checks if check.result == UNCHECKED}


def test_they_see_and_move_as_they_did(lab: Path) -> None:
    run(sensor="mine.py:Blurred(pixels=9)", track="mine.py:Slow(every=3)")
    found = again()
    assert found.verdict == "verified, but for what was not checked: steps", found.checks
    said = {check.name: check.what for check in found.checks}
    assert said["sensor"].startswith("mine.py:Blurred(pixels=9), sha256 ")
    assert said["motion"].startswith("mine.py:Slow(every=3), sha256 ")
    assert said["moves again"] == f"{4 * 20 * 9} of {4 * 20 * 9} frames of 4 planners"


def test_a_flight_of_an_own_motion_is_flown_again(lab: Path) -> None:
    run(track="mine.py:Drone")
    found = again()
    assert found.verdict == "verified, but for what was not checked: steps", found.checks
    assert next(check.what for check in found.checks if check.name == "motion").startswith("mine.py:Drone, sha256 ")


def test_their_files_run_only_where_that_is_asked_for(lab: Path) -> None:
    run(sensor="mine.py:Blurred", track="mine.py:Slow")
    (lab / "mine.py").write_text("raise RuntimeError('not run')")
    found = verify("run", reporter=Log())
    assert unchecked(found) == {
        "steps": "mine.py:Slow: nobody knows what your own motion can do",
        "sensor": "mine.py:Blurred runs with --rerun-episodes only",
        "motion": "mine.py:Slow runs with --rerun-episodes only",
    }
    assert found.difference is None
    with pytest.raises(UsageError, match=r"run once more: sensor file mine.py: RuntimeError: not run"):
        again()
    (lab / "mine.py").write_text(OWN + "# changed\n")
    found = again()
    assert [check.name for check in found.checks if check.result == FAILED] == ["sensor", "motion"]
    assert str(found.difference).startswith("config.json: sensor: got sha256 ")
    inputs = check_inputs(read_run("run").config, None, None, run_own_code=True)
    assert str(inputs.reason_against).startswith("config.json: sensor: got sha256 ")


def test_objects_are_not_replayable(lab: Path) -> None:
    class Mine(PerfectSensor):
        name = "mine"

    run(sensor=Mine(), track=GridMotion())
    reasons = {
        "sensor": "sensor mine: not replayable, as it was given as an object",
        "motion": "motion GridMotion: not replayable, as it was given as an object",
    }
    steps = {"steps": "GridMotion: nobody knows what your own motion can do"}
    assert unchecked(verify("run", reporter=Log())) == reasons | steps
    with pytest.raises(UsageError, match=f"no episode can be run once more: {reasons['sensor']}"):
        again()


def test_what_a_sensor_saw_and_where_planners_went_is_replayed(lab: Path) -> None:
    run(sensor="mine.py:Blurred", track="mine.py:Slow")
    finished = read_run("run")
    inputs = check_inputs(finished.config, None, None, run_own_code=True)
    replays = replay_run(finished, inputs, [0, 7], ["towards", "no-act"], advance=lambda _: None)
    assert replays.notes == ()
    assert all(target is not None for target in replays.planners["towards"].targets)
