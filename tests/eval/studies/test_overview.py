"""Runs side by side say what their summaries say, and in which conditions they differ."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ehar.errors import DataError, UsageError
from eval.cli.main import main
from eval.records.config import PlannerConfig
from eval.running.run import write_records
from eval.scores.differences import Difference
from eval.scores.planner_summary import PlannerSummary
from eval.studies.overview import difference_table, gap_table, overview, read_overview, rule_table
from tests.helpers.made_records import config_of_run, make_records, summary_of

TITLE = "sbu (interactions)"
NAMES = ("no-act", "front", "nbv", "il-ppo", "oracle", "oracle-lookahead")
RECORDS = {name: make_records(0) for name in NAMES}
MADE = summary_of(RECORDS)


def planner(name: str, acc: float, gap: float | None, privileged: bool = False) -> PlannerSummary:
    ends = None if gap is None else (gap - 0.1, gap + 0.1)
    return replace(MADE.planner(name), privileged=privileged, acc_mean=acc, gap_closed=gap, gap_closed_ci95=ends)


def difference(acc: float, ci95: tuple[float, float]) -> Difference:
    return replace(MADE.differences[0], planner="il-ppo", other="nbv", acc_mean=acc, ci95_corrected=ci95)


PLANNERS = (
    planner("no-act", 50.0, 0.0),
    planner("nbv", 54.0, 0.4),
    planner("il-ppo", 55.0, 0.5),
    planner("oracle", 60.0, 1.0, privileged=True),
    planner("oracle-lookahead", 63.0, 1.3, privileged=True),
)
DIFFERENCES = (difference(1.0, (0.25, 2.0)),)


def write(folder: Path, scored: tuple[PlannerSummary, ...] = PLANNERS, **options: Any) -> Path:
    """Write a run in whose summary stands what is asked for; options are of its summary and its configuration."""
    told = {"differences": DIFFERENCES, **{name: options.pop(name) for name in ("differences",) if name in options}}
    config = config_of_run(**{"data": TITLE, **options})
    records = {planner.name: RECORDS[planner.name] for planner in scored}
    write_records(folder, config, records, replace(MADE, config=config, planners=scored, episodes=65, **told))
    return folder


def test_a_run_is_a_column_and_a_planner_a_row(tmp_path: Path) -> None:
    few = (planner("no-act", 40.0, None), planner("nbv", 41.0, None))
    runs = [write(tmp_path / "a"), write(tmp_path / "b", few, data="solo")]
    table = gap_table(read_overview(runs))
    assert table.header == ("planner", "sbu", "solo")
    assert table.rows == (
        ("nbv", "40 [30, 50]", "-"),
        ("il-ppo", "50 [40, 60]", "-"),
        ("oracle-lookahead*", "130 [120, 140]", "-"),
        ("no-act to oracle, mean acc", "50.0 to 60.0", "40.0 to -"),
        ("episodes", "65", "65"),
    )
    assert table.bold == {(1, 1)}  # il-ppo: the oracle that looks ahead is more accurate, and privileged


def test_columns_name_the_conditions_in_which_the_runs_differ(tmp_path: Path) -> None:
    runs = [write(tmp_path / "a"), write(tmp_path / "b", track="px4-max")]
    assert [run.title for run in read_overview(runs)] == ["sbu ideal", "sbu px4-max"]
    within = [write(tmp_path / "c", world="room"), write(tmp_path / "d", world="crowd", onset="known")]
    assert [run.title for run in read_overview(within)] == ["sbu unknown room", "sbu known crowd"]
    several = [write(tmp_path / "e"), write(tmp_path / "f", data="sbu (synthetic), 3 trainings")]
    assert [run.title for run in read_overview(several)] == ["sbu", "sbu, 3 trainings"]


def test_without_an_oracle_accuracies_stand_in_place_of_gaps(tmp_path: Path) -> None:
    few = (planner("no-act", 40.0, None), planner("nbv", 41.0, None))
    runs = [write(tmp_path / name, few, world=name) for name in ("room", "crowd")]
    table = overview(runs)[0]
    assert table.title == "Mean accuracy, in percent [95 %]"
    assert [row[0] for row in table.rows] == ["no-act", "nbv", "episodes"]
    assert table.rows[1][1].startswith("41.0 [")
    assert table.bold == {(1, 1), (1, 2)}
    assert sum("rest on" in note for note in table.footnotes) == 1  # as these runs have the same people
    assert any(note.startswith("sbu room, sbu crowd: ") for note in table.footnotes)


def test_differences_are_turned_to_the_planner_that_is_asked_for(tmp_path: Path) -> None:
    runs = read_overview([write(tmp_path / "a")])
    assert difference_table(runs, "il-ppo").rows == (("nbv", "+1.0 [0.2, 2.0]"),)
    turned = difference_table(runs, "nbv")
    assert turned.rows == (("il-ppo", "-1.0 [-2.0, -0.2]"),)
    assert turned.bold == {(0, 1)}
    across = write(tmp_path / "b", differences=(difference(1.0, (-0.2, 2.0)),))
    assert not difference_table(read_overview([across]), "nbv").bold


def test_the_best_rule_of_each_run_is_that_with_the_highest_accuracy_there(tmp_path: Path) -> None:
    some = (planner("no-act", 40.0, None), planner("front", 42.0, None), planner("nbv", 44.0, None))
    flown = replace(some[2], accuracy_kept=0.5, accuracy_kept_ci95=(0.25, 0.75))
    beside = (
        replace(DIFFERENCES[0], planner="nbv", other="no-act", acc_mean=4.0, ci95_corrected=(1.0, 7.0)),
        replace(DIFFERENCES[0], planner="front", other="nbv", acc_mean=-2.0, ci95_corrected=(-5.0, 1.0)),
    )
    runs = [
        write(tmp_path / "a", (*PLANNERS[:2], planner("front", 49.0, None)), world="room"),
        write(tmp_path / "b", (*some[:2], flown), world="crowd", differences=beside),
        write(tmp_path / "c", (planner("nbv", 44.0, None), planner("il-ppo", 43.0, None))),
    ]
    table = rule_table(read_overview(runs), "nbv")
    assert table.header == ("run", "no-act", "best rule", "nbv", "nbv - no-act", "nbv - best rule", "kept % [95 %]")
    assert table.rows == (
        ("sbu room", "50.0", "no-act 50.0", "54.0", "-", "-", "-"),
        ("sbu crowd", "40.0", "front 42.0", "44.0", "+4.0 [1.0, 7.0]", "+2.0 [-1.0, 5.0]", "50.0 [25.0, 75.0]"),
    )
    assert table.bold == {(1, 4)}
    assert [shown.title.split()[0] for shown in overview(runs[1:2], planner="nbv")] == ["Mean", "Mean", "nbv"]


def test_a_planner_that_was_not_compared_is_named(tmp_path: Path) -> None:
    runs = read_overview([write(tmp_path / "a")])
    with pytest.raises(UsageError, match=r"no differences of .random.*il-ppo, nbv"):
        difference_table(runs, "random")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([], "expected the JSON object of a finished run of ehar benchmark, got"),
        ({}, "expected"),
        ({"episodes": 65, "planners": [{"name": "nbv"}], "basis": {"sequences": 3}}, r"planners\[0\]"),
        ({"episodes": 65, "planners": [], "basis": {"sequences": 3}, "differences": [{}]}, r"differences"),
    ],
)
def test_what_is_no_summary_is_named(tmp_path: Path, content: Any, message: str) -> None:
    folder = write(tmp_path / "a")
    (folder / "summary.json").write_text(json.dumps(content))
    with pytest.raises(DataError, match=rf"summary\.json: .*{message}"):
        read_overview([folder])


def test_missing_runs_are_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"missing/config\.json"):
        read_overview([tmp_path / "missing"])
    (write(tmp_path / "a") / "summary.json").unlink()
    with pytest.raises(DataError, match=r"a: expected a finished run, this one is incomplete: no summary\.json"):
        read_overview([tmp_path / "a"])
    with pytest.raises(UsageError, match="at least one"):
        read_overview([])


def test_runs_of_another_schema_and_incomplete_ones_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="got schema 1, expected a run of ehar benchmark of schema 2; run the"):
        read_overview([write(tmp_path / "older", schema=1)])
    planners = tuple(PlannerConfig(name, False, "") for name in ("no-act", "il-ppo/0", "il-ppo/1", "random"))
    with pytest.raises(DataError, match="this one is incomplete: no episodes of il-ppo/0, il-ppo/1, random"):
        read_overview([write(tmp_path / "cut", (planner("no-act", 40.0, None),), planners=planners)])
    folder = write(tmp_path / "a")
    held = json.loads((folder / "summary.json").read_text())
    held["planners"].pop()
    (folder / "summary.json").write_text(json.dumps(held))
    with pytest.raises(DataError, match=r"expected the planners of the records, no-act, .*, oracle-lookahead, got no-"):
        read_overview([folder])


def test_the_command_prints_tables_and_writes_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "overview.md"
    main(["study", "overview", str(write(tmp_path / "a")), "--planner", "nbv", "--out", str(out)])
    printed = capsys.readouterr().out
    assert "40 [30, 50]" in printed and "-1.0 [-2.0, -0.2]" in printed
    assert "40 [30, 50]" in out.read_text() and "-1.0 [-2.0, -0.2]" in out.read_text()
