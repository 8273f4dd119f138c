import hashlib
import json
import os
import signal
import sys
import types
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fakes import FakeRecogniser, tiny_data

from ehar.arrays import FloatArray
from ehar.errors import DataError, EharError, EpisodeError, UsageError
from ehar.motion_data import MotionData
from ehar.planner import Context, Observation, Planner
from ehar.viewpoint import cartesian
from eval import benchmark
from eval.episodes import CHUNK
from eval.records import read_episodes
from eval.results import EPISODES, SUMMARY


class HashedRecogniser(FakeRecogniser):
    sha256 = "fake"


@dataclass
class Log:
    """Remembers what a reporter hears; stops the run after so many jobs."""

    stop_after: int = 10**9
    notes: list[str] = field(default_factory=list)
    jobs: int = 0
    done: list[str] = field(default_factory=list)

    def note(self, line: str) -> None:
        self.notes.append(line)

    def begin(self, jobs: int) -> None:
        self.jobs = jobs

    def advance(self, planner: str) -> None:
        self.done.append(planner)
        if len(self.done) == self.stop_after:
            os.kill(os.getpid(), signal.SIGINT)

    def end(self) -> None:
        pass


@pytest.fixture(autouse=True)
def fake_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    module = types.ModuleType("recognition.storage")
    module.load_recogniser = lambda *_, **__: HashedRecogniser()  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "recognition.storage", module)


def run(planners: Any = ("no-act", "random", "oracle"), **options: Any) -> Any:
    defaults: dict[str, Any] = {"data": tiny_data(sequences=40), "length": 10, "starts": 4, "reporter": Log()}
    return benchmark(planners, **{**defaults, **options})


def file_hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


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
    summary = run(out=tmp_path)
    names = {"config.json", EPISODES, SUMMARY, "table.md", "accuracy.png", "accuracy.svg"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert json.loads((tmp_path / SUMMARY).read_text()) == json.loads(json.dumps(summary.to_json()))
    config = json.loads((tmp_path / "config.json").read_text())
    assert config["data_sha256"] == tiny_data(sequences=40).sha256
    assert config["recogniser_sha256"] == "fake"
    assert {"python", "ehar", "numpy", "torch"} <= config["versions"].keys()
    assert config["planners"][0] == {
        "name": "no-act",
        "privileged": False,
        "implementation": "planners.heuristic.NoAct",
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


def test_what_the_fake_rewards_is_what_the_table_says() -> None:
    # The fake recogniser sees more the nearer to level the camera is; the oracle knows it, v-rotate goes there.
    summary = run(["no-act", "v-rotate", "oracle"])
    assert summary.planner("oracle").acc_mean > summary.planner("no-act").acc_mean
    assert summary.planner("v-rotate").acc_mean > summary.planner("no-act").acc_mean
    assert summary.planner("no-act").path_length_m == 0
    assert summary.planner("oracle").privileged
    assert not summary.planner("v-rotate").privileged


def test_without_names_every_planner_runs() -> None:
    from planners.registry import planner_names

    assert tuple(planner.name for planner in run(None, starts=1).planners) == planner_names()


class Circling(Planner):
    """A user's own planner; it forgets nothing, so every batch has to begin with reset."""

    name = "circling"

    def reset(self, context: Context) -> None:
        self._turn = np.array([0.0, context.rng.choice([-1.0, 1.0]), 0.0])

    def act(self, observation: Observation) -> FloatArray:
        return observation.viewpoint + self._turn


def test_planners_of_ones_own_run_beside_the_named_ones() -> None:
    summary = run(["no-act", Circling()])
    assert [planner.name for planner in summary.planners] == ["no-act", "circling"]
    assert summary.planner("circling").path_length_m > 0


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


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_ctrl_c_leaves_the_finished_part_readable(tmp_path: Path, workers: int) -> None:
    out = tmp_path / "run"
    log = Log(stop_after=12)
    with pytest.raises(KeyboardInterrupt, match=r"finished episodes are in .*; its summary covers") as interrupt:
        run(["no-act", "towards", "random", "oracle"], out=out, reporter=log, workers=workers)
    assert (log.jobs, len(log.done)) == (4 * 160 / CHUNK, 12)
    records = read_episodes(out / EPISODES)
    whole = [name for name, episodes in records.items() if len(episodes) == 160]
    assert sum(len(episodes) for episodes in records.values()) == 12 * CHUNK
    assert [planner["name"] for planner in json.loads((out / SUMMARY).read_text())["planners"]] == whole
    assert f"the {len(whole)} of 4 planners" in str(interrupt.value)
    assert not [path for path in out.iterdir() if path.name.startswith(".")]
    # The same command may then be run again, to its end.
    run(["no-act", "towards", "random", "oracle"], out=out)
    assert len(read_episodes(out / EPISODES)) == 4


def with_lengths(lengths: list[int], labels: list[int]) -> MotionData:
    data = tiny_data(sequences=len(lengths), frames=max(lengths))
    keep = np.concatenate([np.arange(max(lengths)) < length for length in lengths])
    return replace(
        data,
        positions=data.positions[keep],
        offsets=np.cumsum([0, *lengths]),
        labels=np.array(labels),
        is_test=np.ones(len(lengths), dtype=bool),
    )


def test_shorter_sequences_are_left_out_and_counted_aloud() -> None:
    log = Log()
    summary = run(["no-act"], data=with_lengths([20, 9, 12, 8], [0, 1, 2, 0]), starts=1, reporter=log)
    assert summary.episodes == 3
    assert log.notes == [
        "tiny: 2 of 4 test sequences are shorter than 10 frames and left out",
        "tiny: class 'left' has no test sequence of 10 frames left",
    ]


def test_no_sequence_as_long_as_an_episode() -> None:
    with pytest.raises(
        DataError, match="tiny: expected test sequences of at least 30 frames, the longest of 20 has 20"
    ):
        run(length=30)


def test_a_class_without_test_sequence() -> None:
    with pytest.raises(DataError, match="class 'right' has none"):
        run(data=with_lengths([20, 20, 20], [0, 1, 0]))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"planners": ["no-act", "teleport"]}, "unknown planner 'teleport'.*no-act"),
        ({"planners": ["no-act", "no-act"]}, "'no-act' twice"),
        ({"planners": []}, "got none"),
        ({"planners": [object()]}, "without name, privileged, reset, act"),
        ({"data": "trio"}, "unknown data 'trio'.*duo, solo"),
        ({"track": "rail"}, "unknown track 'rail'; known: ideal"),
        ({"sensor": "lidar"}, "unknown sensor 'lidar'"),
        ({"views": "birds"}, "unknown views 'birds'"),
        ({"form": "square"}, "unknown form 'square'"),
        ({"starts": 0}, "starts: expected at least 1, got 0"),
        ({"workers": 0}, "workers: expected at least 1, got 0"),
        ({"seed": -1}, "seed: expected at least 0, got -1"),
        ({"length": 0}, "episode length of at least 1 frame, got 0"),
    ],
)
def test_bad_options_end_in_one_line_and_leave_nothing(tmp_path: Path, options: dict[str, Any], message: str) -> None:
    with pytest.raises(EharError, match=message) as error:
        run(**options, out=tmp_path / "run")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "run").exists()


def test_another_run_is_not_overwritten(tmp_path: Path) -> None:
    run(["no-act"], out=tmp_path)
    before = file_hash(tmp_path / EPISODES)
    with pytest.raises(UsageError, match="holds another run, which differs in planners"):
        run(["random"], out=tmp_path)
    assert file_hash(tmp_path / EPISODES) == before
