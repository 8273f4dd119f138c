"""The whole path as a user walks it: the installed command, real networks, and the shipped weights."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from ehar.conditions import Conditions
from ehar.data.motion_file import save_motion
from eval import benchmark
from tests.helpers.fakes import tiny_data
from tests.helpers.places import ROOT, SHARED

EHAR = Path(sys.executable).parent / "ehar"


def ehar(*arguments: object, code: int = 0) -> str:
    """Run the command and return what it printed, on standard output or, where it fails, on standard error."""
    done = subprocess.run([EHAR, *map(str, arguments)], capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    return done.stderr if code else done.stdout


@pytest.mark.slow
def test_train_then_benchmark_twice(tmp_path: Path) -> None:
    data, models = tmp_path / "tiny.npz", tmp_path / "models"
    save_motion(data, tiny_data(sequences=24))
    ehar(
        "train",
        "recogniser",
        "--data",
        data,
        "--out",
        models,
        "--length",
        10,
        "--clips",
        32,
        "--batch",
        16,
        "--threads",
        1,
    )
    options = ("--data", data, "--models", models, "--length", 10, "--starts", 1)
    printed = ehar("benchmark", *options, "--out", tmp_path / "one", "--workers", 1)
    assert "oracle-lookahead*" in printed
    again = ("no-act", "random", "oracle")
    ehar("benchmark", *again, *options, "--out", tmp_path / "two", "--workers", 2, "--no-report")
    one, two = ((tmp_path / name / "episodes.jsonl").read_text().splitlines() for name in ("one", "two"))
    assert two == [line for line in one if json.loads(line)["planner"] in again]
    summary = json.loads((tmp_path / "one" / "summary.json").read_text())
    assert [planner["name"] for planner in summary["planners"]][:2] == ["no-act", "random"]
    assert {path.name for path in (tmp_path / "one").iterdir()} >= {"config.json", "accuracy.png", "accuracy.svg"}
    line = ehar("benchmark", "--data", data, "--models", models, "--sensor", "estimator", code=2)
    assert line.startswith("ehar: error: ")
    assert line.count("\n") == 1


@pytest.mark.slow
@pytest.mark.parametrize("name", ["duo", "solo"])
def test_the_synthetic_sets_leave_something_to_win(name: str) -> None:
    """Asked of the validation part, which is small: the oracle takes eight times as long as a camera that stays."""
    summary = benchmark(["no-act", "oracle"], Conditions(data=name, part="validation"), workers=1).summary
    stays = summary.planner("no-act").acc_mean
    assert 60 <= stays <= 85
    assert summary.planner("oracle").acc_mean >= stays + 1.5


@pytest.mark.slow
@pytest.mark.skipif(not SHARED.is_dir(), reason=f"no real motion at {SHARED}")
def test_weights_of_another_set_are_refused() -> None:
    weights = ROOT / "recognition" / "weights" / "duo"
    line = ehar("benchmark", "no-act", "--data", SHARED / "hdm05.npz", "--models", weights, code=2)
    assert "class_names do not fit hdm05" in line
    assert line.count("\n") == 1
