"""Runs of several trainings are one table, if they have the same episodes and conditions and other weights."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ehar.errors import DataError, UsageError
from eval.cli.main import main
from eval.studies.trainings import trainings
from tests.helpers.commands import fails_with
from tests.helpers.made_records import make_records, write_finished


def run(folder: Path, training: int, people: int = 6, **options: Any) -> Path:
    skills = {"no-act": 0.0, "nbv": 1.0, "oracle": 3.0}
    records = {
        name: make_records(10 * training + row, skill=skill, episodes=60, people=people)
        for row, (name, skill) in enumerate(skills.items())
    }
    return write_finished(folder / str(training), records, **{"recogniser_sha256": str(training), **options})


def test_the_command_prints_one_table_and_writes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runs = [str(run(tmp_path, seed)) for seed in (1, 2, 3)]
    main(["study", "trainings", *runs, "--out", str(tmp_path / "out")])
    printed = capsys.readouterr().out
    assert "3 trainings of recogniser and gain field" in printed and "nbv minus it [95 %]" in printed
    found = trainings(runs)
    held = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert held["folders"] == runs and held["planner"] == "nbv"
    assert held["planners"][1]["acc_mean"] == pytest.approx(found.summary.planners[1].acc_mean)
    assert held["differences"][0]["difference"]["ci95"] != held["differences"][0]["difference"]["ci95_corrected"]
    table = (tmp_path / "out" / "table.md").read_text()
    (shown,) = found.tables()
    assert all(str(cell).replace("*", r"\*") in table for row in shown.rows for cell in row)
    assert not shown.notice and "Intervals rest on 6 people and their 30 sequences." in shown.footnotes
    assert repr(found).endswith("3 planners)")


def test_few_trainings_and_few_people_are_told_aloud(tmp_path: Path) -> None:
    (table,) = trainings([run(tmp_path, seed, people=4) for seed in (1, 2)]).tables()
    assert "only 4 people" in table.notice and "Only 2 trainings: a claim takes at least 3." in table.notice


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"seed": 1}, r"expected runs of the same episodes; they differ in seed \(0, 1\)"),
        ({"sensor": "estimator"}, r"they differ in sensor \(perfect, estimator\)"),
        ({"views": "paper"}, r"they differ in views \(moving, paper\)"),
        ({"track": "px4-max"}, r"they differ in track \(ideal, px4-max\)"),
        ({"recogniser_sha256": "1"}, "expected other trainings of the recogniser, got the same"),
    ],
)
def test_runs_that_are_no_trainings_of_one_another_are_refused(
    tmp_path: Path, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(UsageError, match=message) as refused:
        trainings([run(tmp_path, 1), run(tmp_path, 2, **options)])
    assert "\n" not in str(refused.value)


def test_episodes_that_differ_are_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = run(tmp_path, 1), tmp_path / "b"
    other = {name: make_records(row, episodes=60, people=5) for row, name in enumerate(("no-act", "nbv"))}
    write_finished(b, other, recogniser_sha256="2")
    with pytest.raises(DataError, match="that differ in sequence, first frame, start, label or people"):
        trainings([a, b])
    moved = {name: replace(held, start=held.start + 1) for name, held in other.items()}
    write_finished(b, moved, recogniser_sha256="2")
    assert "expected the same episodes" in fails_with(["study", "trainings", str(a), str(b)], capsys)
    assert "at least 2 folders of runs, got 1" in fails_with(["study", "trainings", str(a)], capsys)
