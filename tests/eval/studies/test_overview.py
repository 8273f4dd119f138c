"""Runs side by side say what their summaries say, and in which conditions they differ."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from ehar.errors import DataError, UsageError
from eval.records.config import PlannerConfig, RunConfig
from eval.studies.overview import difference_table, gap_table, read_overview
from tests.helpers.made_records import CONFIG_OF_RUN


def planner(name: str, acc: float, gap: float | None, privileged: bool = False) -> dict[str, Any]:
    ends = None if gap is None else [gap - 0.1, gap + 0.1]
    return {"name": name, "privileged": privileged, "acc_mean": acc, "gap_closed": gap, "gap_closed_ci95": ends}


def summary(**changes: Any) -> dict[str, Any]:
    return {
        "data": "sbu (interactions)",
        "sensor": "perfect",
        "views": "moving",
        "track": "ideal",
        "readout": "recogniser",
        "episodes": 65,
        "planners": [
            planner("no-act", 50.0, 0.0),
            planner("nbv", 54.0, 0.4),
            planner("il-ppo", 55.0, 0.5),
            planner("oracle", 60.0, 1.0, privileged=True),
            planner("oracle-lookahead", 63.0, 1.3, privileged=True),
        ],
        "differences": [{"planner": "il-ppo", "other": "nbv", "acc_mean": 1.0, "ci95": [0.25, 2.0]}],
        **changes,
    }


def write(folder: Path, content: Any, config: RunConfig = CONFIG_OF_RUN) -> Path:
    folder.mkdir()
    (folder / "config.json").write_text(json.dumps(asdict(config)))
    (folder / "summary.json").write_text(json.dumps(content))
    return folder


def test_a_run_is_a_column_and_a_planner_a_row(tmp_path: Path) -> None:
    few = [planner("no-act", 40.0, None), planner("nbv", 41.0, None)]
    runs = [write(tmp_path / "a", summary()), write(tmp_path / "b", summary(data="solo", planners=few))]
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
    runs = [write(tmp_path / "a", summary()), write(tmp_path / "b", summary(track="px4-max"))]
    assert [run.title for run in read_overview(runs)] == ["sbu ideal", "sbu px4-max"]


def test_differences_are_turned_to_the_planner_that_is_asked_for(tmp_path: Path) -> None:
    runs = read_overview([write(tmp_path / "a", summary())])
    assert difference_table(runs, "il-ppo").rows == (("nbv", "+1.0 [0.2, 2.0]"),)
    turned = difference_table(runs, "nbv")
    assert turned.rows == (("il-ppo", "-1.0 [-2.0, -0.2]"),)
    assert turned.bold == {(0, 1)}
    across = summary(differences=[{"planner": "il-ppo", "other": "nbv", "acc_mean": 1.0, "ci95": [-0.2, 2.0]}])
    assert not difference_table(read_overview([write(tmp_path / "b", across)]), "nbv").bold


def test_a_planner_that_was_not_compared_is_named(tmp_path: Path) -> None:
    runs = read_overview([write(tmp_path / "a", summary())])
    with pytest.raises(UsageError, match=r"no differences of .random.*il-ppo, nbv"):
        difference_table(runs, "random")


@pytest.mark.parametrize("content", [[], {}, summary(planners=[{"name": "nbv"}]), summary(differences=[{}])])
def test_what_is_no_summary_is_named(tmp_path: Path, content: Any) -> None:
    folder = write(tmp_path / "a", content)
    with pytest.raises(DataError, match=r"summary\.json: expected the (summary|JSON object)"):
        read_overview([folder])


def test_missing_runs_are_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"missing/config\.json"):
        read_overview([tmp_path / "missing"])
    (write(tmp_path / "a", summary()) / "summary.json").unlink()
    with pytest.raises(UsageError, match=r"a/summary\.json"):
        read_overview([tmp_path / "a"])
    with pytest.raises(UsageError, match="at least one"):
        read_overview([])


def test_runs_of_another_schema_and_incomplete_ones_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="got schema 2, expected a run of ehar benchmark of schema 1; run the"):
        read_overview([write(tmp_path / "newer", summary(), replace(CONFIG_OF_RUN, schema=2))])
    planners = tuple(PlannerConfig(name, False, "") for name in ("no-act", "il-ppo/0", "il-ppo/1", "random"))
    with pytest.raises(DataError, match="this run is incomplete, expected figures of random too"):
        read_overview([write(tmp_path / "cut", summary(), replace(CONFIG_OF_RUN, planners=planners))])
