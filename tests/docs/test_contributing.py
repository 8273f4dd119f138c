"""What docs/contributing.md adds, a metric, a sensor, a reader and a report figure, works in a copy of the project."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ehar.data.preparing.mapping import mapped
from ehar.data.source import load_data
from tests.helpers.own_recogniser import OWN
from tests.helpers.places import ROOT

PACKAGES = ("ehar", "recognition", "planners", "eval")
PAGE = (ROOT / "docs" / "contributing.md").read_text(encoding="utf-8")
REGISTERED = {  # what is added: where it is registered, behind which line, and what has to be imported there
    "metric": (
        "eval/scores/planner_metrics.py",
        "METRICS: tuple[Metric, ...] = (NLL, ECE, LATE_ECE, PATH_LENGTH)\n",
        "from eval.scores.earliness import SETTLED\n",
    ),
    "sensor": (
        "ehar/sensors/registry.py",
        '    "perfect": ',
        "from ehar.sensors.rounded import RoundedSensor\n",
    ),
    "reader": ("ehar/data/readers/__init__.py", '    "bvh": ', ""),
    "report figure": (
        "eval/reports/sections.py",
        "SECTIONS: tuple[Section, ...] = ",
        "from eval.reports.distances import DISTANCES\n",
    ),
}


def blocks(what: str) -> tuple[str, str]:
    """Return the new file and the entry of one section of the page."""
    section = PAGE.partition(f"## Add a {what}\n")[2].partition("\n## ")[0]
    file, entry = re.findall(r"```(?:python|text)\n(.*?)```", section, flags=re.DOTALL)
    return file, entry


def add(root: Path, what: str) -> None:
    """Add one thing as the page says: a file, and an entry with its import."""
    file, entry = blocks(what)
    path = re.match(r"# (\S+\.py)\n", file)
    assert path is not None
    assert not (root / path[1]).exists()
    (root / path[1]).write_text(file, encoding="utf-8")
    place, line, imported = REGISTERED[what]
    assert f"`{place}`" in PAGE
    before = (root / place).read_text(encoding="utf-8")
    assert before.count(line) == 1
    start = before.index(line)
    # A tuple is written anew, to the end of its statement; a dictionary gets one more line.
    end = before.index(")\n", start) + 2 if line.endswith("= ") or line.endswith(")\n") else start
    head = before[:start] + entry + before[end:]
    after = re.sub(r"^(?=from )", imported, head, count=1, flags=re.MULTILINE)
    (root / place).write_text(after, encoding="utf-8")


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the project to which all four were added."""
    root = tmp_path_factory.mktemp("project")
    for package in PACKAGES:
        ignored = shutil.ignore_patterns("*.pyc.*", "weights")  # compiled files go along, but none half written
        shutil.copytree(ROOT / package, root / package, ignore=ignored)
        if (ROOT / package / "weights").is_dir():
            (root / package / "weights").symlink_to(ROOT / package / "weights")
    for what in REGISTERED:
        add(root, what)
    return root


def ehar(root: Path, *words: str) -> str:
    """Run a command in the copy, and return what it prints."""
    environment = os.environ | {"PYTHONPATH": str(root)}
    ended = subprocess.run(
        [sys.executable, "-m", "eval.cli.main", *words], capture_output=True, text=True, cwd=root, env=environment
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def test_a_reader_is_a_command(copied: Path) -> None:
    body = mapped(load_data("solo"), "body12")
    for index, name in enumerate(("walk_1", "walk_2", "walk_3", "jump_1", "jump_2", "jump_3")):
        rows = body.sequence(index).reshape(body.lengths[index], -1)
        (copied / "recordings").mkdir(exist_ok=True)
        np.savetxt(copied / "recordings" / f"{name}.csv", rows, delimiter=",")
    assert "rows" in ehar(copied, "data", "prepare", "--help")
    said = ehar(copied, "data", "prepare", "rows", "recordings", "rows.npz", "--fps", "30")
    assert said.startswith("rows.npz: 6 sequences of 2 classes, 30 frames/s\n") and "11 passed" in said


def test_a_metric_a_sensor_and_a_figure_are_in_a_run(copied: Path) -> None:
    (copied / "mine.py").write_text(OWN)
    told = ("--data", "duo", "--length", "8", "--part", "validation", "--workers", "1", "--sensor", "rounded")
    printed = ehar(copied, "benchmark", "no-act", "towards", *told, "--recogniser", "mine.py:Mine", "--out", "run")
    assert "sensor rounded" in printed
    assert " settled " in printed
    planners = json.loads((copied / "run" / "summary.json").read_text())["planners"]
    assert all(0 <= planner["settled"] <= 1 for planner in planners)
    report = (copied / "run" / "report.html").read_text(encoding="utf-8")
    assert '<section id="distances">' in report
    assert report.index('id="cost"') < report.index('id="distances"') < report.index('id="differences"')
    assert "settled" in report
    assert "verified" in ehar(copied, "verify", "run")
