"""A benchmark: the same episodes for all, the same bytes each time, and a user's own planners."""

import json
from pathlib import Path

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.data.scenario import part_of
from ehar.errors import EpisodeError
from ehar.planner import Context, Observation, Planner
from ehar.viewpoint import cartesian
from eval.records.config import SCHEMA
from eval.records.episode_lines import read_episodes
from eval.records.job_times import JOB_TIMES
from eval.records.run_files import EPISODES, SUMMARY
from tests.helpers.fakes import tiny_data
from tests.helpers.tiny_benchmarks import file_hash, run

pytestmark = pytest.mark.usefixtures("fake_weights")


def test_the_same_command_gives_the_same_bytes(tmp_path: Path) -> None:
    # 20 test sequences of 2 windows, 4 starts each: 160 episodes, two chunks.
    run(out=tmp_path / "a")
    run(out=tmp_path / "b", sensor="perfect")
    run(out=tmp_path / "c", seed=1)
    assert file_hash(tmp_path / "a" / EPISODES) == file_hash(tmp_path / "b" / EPISODES)
    assert file_hash(tmp_path / "a" / EPISODES) != file_hash(tmp_path / "c" / EPISODES)
    assert (tmp_path / "a" / "accuracy.svg").read_bytes() == (tmp_path / "b" / "accuracy.svg").read_bytes()


@pytest.mark.slow
def test_two_workers_give_the_same_bytes_as_one(tmp_path: Path) -> None:
    run(out=tmp_path / "one", sensor="estimator")
    run(out=tmp_path / "two", sensor="estimator", workers=2)
    assert file_hash(tmp_path / "one" / EPISODES) == file_hash(tmp_path / "two" / EPISODES)


def test_a_run_leaves_everything_needed_to_read_and_repeat_it(tmp_path: Path) -> None:
    summary = run(out=tmp_path).summary
    names = {"config.json", EPISODES, JOB_TIMES, SUMMARY, "table.md", "accuracy.png", "accuracy.svg"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert json.loads((tmp_path / SUMMARY).read_text()) == json.loads(json.dumps(summary.to_json()))
    config = json.loads((tmp_path / "config.json").read_text())
    assert config["data_sha256"] == tiny_data(sequences=40).sha256
    assert config["recogniser_sha256"] == "fake"
    assert (next(iter(config)), config["schema"], config["ideal"]) == ("schema", SCHEMA, None)
    assert {"python", "ehar", "numpy", "torch"} <= config["versions"].keys()
    assert config["planners"][0] == {
        "name": "no-act",
        "privileged": False,
        "implementation": "planners.heuristic.NoAct",
        "weights_sha256": None,
        "arguments": {},
        "source_sha256": None,
    }


def test_planners_meet_the_same_episodes(tmp_path: Path) -> None:
    run(out=tmp_path)
    records = read_episodes(tmp_path / EPISODES)
    reference = records["no-act"]
    assert len(reference) == 160
    for episodes in records.values():
        np.testing.assert_array_equal(episodes.start, reference.start)
        np.testing.assert_array_equal(episodes.viewpoint[:, 0], reference.start)
        np.testing.assert_array_equal(episodes.predicted[:, 0], reference.predicted[:, 0])


def test_only_test_sequences_are_tested_and_each_from_so_many_starts(tmp_path: Path) -> None:
    run(["no-act"], out=tmp_path)
    episodes = read_episodes(tmp_path / EPISODES)["no-act"]
    assert set(episodes.sequence) == {f"sequence-{index}" for index in range(20, 40)}
    assert set(episodes.first) == {0, 10}
    scenarios = list(zip(episodes.sequence, episodes.first, strict=True))
    assert all(scenarios.count(scenario) == 4 for scenario in set(scenarios))


def test_other_parts_run_by_name_and_the_table_says_so(tmp_path: Path) -> None:
    data = tiny_data(sequences=40)
    validation = {data.sequence_names[sequence] for sequence in part_of(data, "validation")}
    summary = run(["no-act"], part="validation", out=tmp_path).summary
    assert set(read_episodes(tmp_path / EPISODES)["no-act"].sequence) == validation
    assert "validation part" in str(summary)
    assert "part," not in str(run(["no-act"]).summary)


def test_what_the_fake_rewards_is_what_the_table_says() -> None:
    # The fake recogniser sees more the nearer to level the camera is; the oracle knows it, v-rotate goes there.
    summary = run(["no-act", "v-rotate", "oracle"]).summary
    assert summary.planner("oracle").acc_mean > summary.planner("no-act").acc_mean
    assert summary.planner("v-rotate").acc_mean > summary.planner("no-act").acc_mean
    assert summary.planner("no-act").metrics["path_length_m"] == 0
    assert summary.planner("oracle").privileged
    assert not summary.planner("v-rotate").privileged


class Circling(Planner):
    """A user's own planner; it forgets nothing, so every batch has to begin with reset."""

    name = "circling"

    def reset(self, context: Context) -> None:
        self._turn = np.array([0.0, context.rng.choice([-1.0, 1.0]), 0.0])

    def act(self, observation: Observation) -> FloatArray:
        return observation.viewpoint + self._turn


def test_own_planners_run_beside_the_named_ones() -> None:
    summary = run(["no-act", Circling()]).summary
    assert [planner.name for planner in summary.planners] == ["no-act", "circling"]
    assert summary.planner("circling").metrics["path_length_m"] > 0


@pytest.mark.slow
def test_a_planner_of_main_or_a_notebook_reaches_the_workers(tmp_path: Path) -> None:
    class Local(Circling):
        name = "local"

    run([Local()], out=tmp_path / "one")
    run([Local()], out=tmp_path / "two", workers=2)
    assert file_hash(tmp_path / "one" / EPISODES) == file_hash(tmp_path / "two" / EPISODES)


class Lost(Circling):
    name = "lost"

    def act(self, observation: Observation) -> FloatArray:
        target = super().act(observation)
        if observation.frame == 3:
            target[5] = np.nan
        return target


class Flat(Circling):
    name = "flat"

    def act(self, observation: Observation) -> FloatArray:
        return cartesian(observation.viewpoint)[:, :2]


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_planner_that_breaks_its_contract_is_named(tmp_path: Path, workers: int) -> None:
    with pytest.raises(
        EpisodeError, match=r"'lost', episode 'sequence-\d+ from frame \d+', frame 3: expected a finite"
    ):
        run(["no-act", Lost()], out=tmp_path / "run", workers=workers)
    with pytest.raises(EpisodeError, match=r"'flat'.*frame 0: expected target viewpoints of shape \(\d+, 3\)"):
        run([Flat()], out=tmp_path / "run", workers=workers)
    assert not (tmp_path / "run").exists()
