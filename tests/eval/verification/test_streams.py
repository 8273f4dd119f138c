"""A run of streams is verified like one of clips: its data are looked at, and its episodes run once more."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ehar.data.streams.data import NO_ACTIVITY
from eval.records.run_files import EPISODES
from eval.running.run import read_run
from eval.studies.compare import compare
from eval.verification.checks import FAILED
from eval.verification.verify import verify
from tests.helpers.stream_runs import forgetful, stream_run
from tests.helpers.tiny_benchmarks import Log


@pytest.fixture(autouse=True)
def forgets(monkeypatch: pytest.MonkeyPatch) -> None:
    forgetful(monkeypatch)


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a run of streams."""
    with pytest.MonkeyPatch.context() as patch:
        forgetful(patch)
        return stream_run(tmp_path_factory.mktemp("watched"), ("no-act", "random", "oracle"))


@pytest.fixture
def run(watched: Path, tmp_path: Path) -> Path:
    """Return a copy of the run to be edited."""
    return Path(shutil.copytree(watched, tmp_path / "run"))


def edit_first(run: Path, edit: Callable[[dict[str, Any]], object]) -> None:
    """Edit the first episode of every planner in the same way."""
    rows = [json.loads(line) for line in (run / EPISODES).read_text().splitlines()]
    for row in rows[:: len(rows) // 3]:
        edit(row)
    (run / EPISODES).write_text("".join(json.dumps(row) + "\n" for row in rows))


def test_a_run_of_streams_is_verified_and_watched_once_more(watched: Path) -> None:
    found = verify(watched, rerun_episodes=12, reporter=Log())
    what = {check.name: check.what for check in found.checks}
    assert found.verdict == "verified"
    assert what["records"].startswith("episodes are those of the data")
    assert what["seen again"] == "12 episodes of 3 planners, 12 drawn and those of their chunks"
    assert what["moves again"] == f"{3 * 4 * 49} of {3 * 4 * 49} frames of 3 planners"


def test_a_label_that_the_data_do_not_have_is_named_with_its_frame(run: Path) -> None:
    def edit(row: dict[str, Any]) -> None:
        row["label"][15] = 2 if row["label"][15] != 2 else 0  # a frame without an activity

    was = next(iter(read_run(run).records.values())).label[0, 15]
    edit_first(run, edit)
    found = verify(run, reporter=Log())
    assert was == NO_ACTIVITY and found.difference is not None
    assert found.difference.endswith("no-act, episode 0 ('stream-6' from frame 0), frame 15: label: got 2, expected -1")


def test_a_probability_that_nobody_saw_is_named(run: Path) -> None:
    def edit(row: dict[str, Any]) -> None:
        row["second_probability"][20] /= 2
        row["true_probability"][20] = min(row["true_probability"][20], row["top_probability"][20])

    edit_first(run, lambda row: edit(row) if row["planner"] == "random" else None)
    found = verify(run, rerun_episodes=12, reporter=Log())
    assert [check.name for check in found.checks if check.result == FAILED] in (["records"], ["seen again"])
    assert found.difference is not None and "random, episode 0 ('stream-6' from frame 0), frame 20" in found.difference


def test_runs_of_streams_are_compared_by_their_activities(watched: Path) -> None:
    compared = compare(watched, watched, ("oracle", "no-act"))
    assert (compared.activities, compared.episodes) == (6, 4)
    (row,) = compared.planners
    run = read_run(watched)
    assert row.acc == (run.summary.planner("oracle").acc_mean, run.summary.planner("no-act").acc_mean)
    assert "6 activities in 4 episodes" in str(compared)


def test_a_flight_after_people_who_walk_is_flown_once_more(tmp_path: Path) -> None:
    flown = stream_run(tmp_path, ("no-act", "front"), track="px4-auto")
    found = verify(flown, rerun_episodes=4, reporter=Log())
    assert found.verdict == "verified", str(found)
