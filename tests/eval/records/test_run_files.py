"""The files of a run: what they say, and when they are not written."""

from pathlib import Path

import pytest

from ehar.errors import UsageError
from ehar.files import write_text
from eval.records.config import CONFIG, UNFINISHED, PlannerConfig, planner_config
from eval.records.run_files import check_no_run, check_out
from eval.running.run import write_records
from planners.heuristic import NoAct
from planners.oracle import Oracle
from planners.own_planner import Origin
from tests.helpers.agents import untrained_agent
from tests.helpers.made_records import CONFIG_OF_RUN, config_of_run, three_planners


def test_config_says_which_weights_a_planner_had() -> None:
    assert planner_config(NoAct()) == PlannerConfig("no-act", False, "planners.heuristic.NoAct", None)
    assert planner_config(Oracle()) == PlannerConfig("oracle", True, "planners.oracle.Oracle", None)
    learned = planner_config(untrained_agent("il-ppo/0"))
    assert learned == PlannerConfig("il-ppo/0", False, "planners.agents.agent.Agent", "of il-ppo/0")


def test_files_that_arguments_name_are_weights(tmp_path: Path) -> None:
    file, planner = tmp_path / "w.txt", NoAct()
    told = []
    for content in ("one", "two", "one"):
        file.write_text(content)
        told.append(planner_config(planner, Origin("mine.py:Mine", {"weights": file, "radius": 5})).weights_sha256)
    assert told[0] == told[2] != told[1] and None not in told
    assert planner_config(planner, Origin("mine.py:Mine", {"radius": 5})).weights_sha256 is None


def test_a_folder_that_holds_another_run_is_refused(tmp_path: Path) -> None:
    out = tmp_path / "run"
    check_out(out, CONFIG_OF_RUN.to_json())
    write_records(out, CONFIG_OF_RUN, three_planners(), None)
    check_out(out, CONFIG_OF_RUN.to_json())
    with pytest.raises(UsageError, match=r"another run, which differs in seed \(seed was 0, now 1\)"):
        check_out(out, config_of_run(seed=1).to_json())
    (out / CONFIG).write_text("{")
    with pytest.raises(UsageError, match="expected the JSON of a run"):
        check_out(out, CONFIG_OF_RUN.to_json())
    (out / CONFIG).unlink()
    with pytest.raises(UsageError, match=r"without config\.json"):
        check_out(out, CONFIG_OF_RUN.to_json())


def test_a_study_does_not_write_over_a_run(tmp_path: Path) -> None:
    check_no_run(tmp_path / "new")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "table.md").write_text("of another study")
    check_no_run(tmp_path / "other")
    for place in (tmp_path / "run", tmp_path / "begun" / UNFINISHED):
        write_records(place, CONFIG_OF_RUN, three_planners(), None)
    for name in ("run", "begun"):
        with pytest.raises(UsageError, match=rf"{name}: expected a folder without a run, this one holds the config"):
            check_no_run(tmp_path / name)


def test_a_file_where_a_folder_is_expected_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="expected a folder"):
        check_out(tmp_path / "file" / "run", CONFIG_OF_RUN.to_json())


def test_a_file_that_fails_halfway_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "file.json"
    write_text(path, ["old"])

    def broken():  # type: ignore[no-untyped-def]
        yield "ne"
        raise RuntimeError

    with pytest.raises(RuntimeError):
        write_text(path, broken())
    assert path.read_text() == "old"
    assert [file.name for file in tmp_path.iterdir()] == ["file.json"]
