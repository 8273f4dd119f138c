"""Streams from end to end: a recogniser learns on them, planners watch them, and what knows clips only refuses them."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.conditions import Conditions
from ehar.data.source import load_data
from ehar.data.streams.data import NO_ACTIVITY
from ehar.errors import DataError, EharError, UsageError
from ehar.planner import Context, Observation, Planner
from ehar.world import ROOM
from eval import benchmark
from eval.records.episodes import read_episodes
from eval.records.run_files import EPISODES
from eval.reports.page import make_report
from eval.running.run import Run
from planners.value.config import GainTrainingConfig
from planners.value.training import train_gain_field
from recognition.setting import load_setting
from recognition.storage import load_recogniser
from recognition.training.config import TrainingConfig
from recognition.training.trainer import train_recogniser
from tests.helpers.fakes import tiny_data
from tests.helpers.stream_worlds import save_stream_world
from tests.helpers.tiny_benchmarks import Log, file_hash

LENGTH = 50  # frames, 5 s


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with streams, raising.npz, and models that learned on them for a moment."""
    return save_stream_world(tmp_path_factory.mktemp("streams"))


def watched(folder: Path, planners: Any, **options: Any) -> Run:
    told = {"data": str(folder / "raising.npz"), "models": folder / "models", "length": LENGTH}
    told |= {name: options.pop(name) for name in ("starts", "seed", "fps", "world") if name in options}
    return benchmark(planners, Conditions(**told), **{"reporter": Log(), **options})


def test_planners_watch_streams_and_activities_are_scored(folder: Path, tmp_path: Path) -> None:
    run = watched(folder, ("no-act", "random", "front", "oracle", "oracle-lookahead"), out=tmp_path)
    held = run.records["oracle"]
    assert held.label.shape == held.predicted.shape == (4, LENGTH)  # two test streams of 120 frames
    assert set(np.unique(held.label)) == {NO_ACTIVITY, 0, 1, 2}
    assert [planner.name for planner in run.summary.planners][-1] == "oracle-lookahead"
    # Of the episodes from frame 0 and 50 on, those at 20, 60 and 80 begin and end within one.
    assert (run.summary.episodes, run.summary.activities) == (4, 6)
    assert "6 activities in 4 episodes of 50 frames" in str(run)
    right = {name: records.true_probability.mean() for name, records in run.records.items()}
    assert right["oracle"] > max(right["no-act"], right["random"], right["front"])
    assert "false alarms/min" in str(run) and "false alarms/min" in (tmp_path / "table.md").read_text()
    back = read_episodes(tmp_path / EPISODES)["oracle"]
    np.testing.assert_array_equal(back.label, held.label)
    np.testing.assert_array_equal(back.predicted, held.predicted)
    config = json.loads((tmp_path / "config.json").read_text())
    assert (config["fps"], config["length"]) == (10.0, LENGTH)


def test_streams_are_watched_among_obstacles_and_passers_by(folder: Path) -> None:
    both = replace(ROOM, name="both", passers_by=2)
    summary = watched(folder, ("no-act", "h-rotate", "oracle"), world=both).summary
    for planner in summary.planners:
        assert planner.contacts is not None and planner.contacts.near_frames == 0
    opened = watched(folder, "no-act").summary
    assert summary.planner("no-act").metrics["nll"] != opened.planner("no-act").metrics["nll"]


def test_planners_that_need_more_than_a_recogniser_are_left_out(folder: Path) -> None:
    log = Log()
    ran = watched(folder, None, reporter=log)
    assert set(ran.records) >= {"no-act", "random", "front", "oracle"}
    assert not set(ran.records) & {"nbv", "fixed-best", "il", "il-ppo"}
    assert any("nothing but a recogniser is trained on streams yet" in line for line in log.notes)
    for name in ("nbv", "fixed-best", "il"):
        with pytest.raises(EharError, match="raising: nothing but a recogniser is trained on streams yet"):
            watched(folder, (name,))


def test_workers_make_no_difference(folder: Path, tmp_path: Path) -> None:
    watched(folder, ("random",), out=tmp_path / "one", starts=9)
    watched(folder, ("random",), out=tmp_path / "two", starts=9, workers=2)
    assert file_hash(tmp_path / "one" / EPISODES) == file_hash(tmp_path / "two" / EPISODES)


class Watcher(Planner):
    """Stays, and keeps what it is told of time."""

    name = "watcher"

    def reset(self, context: Context) -> None:
        self.lengths: list[Any] = [context.length]
        self.times: list[float] = []

    def act(self, observation: Observation) -> FloatArray:
        self.lengths += [observation.length, observation.ratio]
        self.times.append(observation.time)
        assert observation.log_probs.shape[1] == 4  # three classes, and no activity
        return observation.viewpoint


def test_nobody_is_told_how_long_a_stream_lasts(folder: Path) -> None:
    watcher = Watcher()
    watched(folder, [watcher])
    assert set(watcher.lengths) == {None}
    np.testing.assert_allclose(watcher.times, np.arange(LENGTH - 1) / 10)


def test_the_usual_length_is_30_seconds(folder: Path) -> None:
    setting = load_setting(Conditions(data=str(folder / "raising.npz"), models=folder / "models"))
    assert setting.conditions.length == 300
    assert setting.length_note is None  # evidence that fades is not meant for one length


def test_streams_that_are_too_short(folder: Path) -> None:
    with pytest.raises(
        DataError, match=r"expected test streams of at least 300 frames \(30 s\), the longest of 2 has 120"
    ):
        benchmark("no-act", Conditions(data=str(folder / "raising.npz"), models=folder / "models"), reporter=Log())


def test_what_knows_clips_only_refuses_streams(folder: Path, tmp_path: Path) -> None:
    conditions = Conditions(data=str(folder / "raising.npz"), models=folder / "models", length=40)
    with pytest.raises(UsageError, match="raising: expected trimmed sequences, got streams"):
        train_gain_field(GainTrainingConfig(conditions=conditions), lambda model: Watcher(), lambda *_: None)
    with pytest.raises(UsageError, match="form: expected causal for raising, which holds streams, got ctrgcn"):
        published = Conditions(data=str(folder / "raising.npz"), length=40, form="ctrgcn")
        train_recogniser(TrainingConfig(conditions=published, out=tmp_path))
    with pytest.raises(DataError, match=r"raising\.npz: expected trimmed sequences, got streams: `segments` in place"):
        load_data(folder / "raising.npz")
    with pytest.raises(UsageError, match="solo-stream: expected trimmed sequences, got streams"):
        load_data("solo-stream")
    watched(folder, ("no-act",), out=tmp_path / "run")
    with pytest.raises(EharError, match="expected a run of clips, got one of streams"):
        make_report(tmp_path / "run")


def test_what_is_missing_is_suggested_as_it_was_told(folder: Path, tmp_path: Path) -> None:
    told = Conditions(data=str(folder / "raising.npz"), models=tmp_path)
    with pytest.raises(EharError, match=r"--views moving --out") as error:  # without the length of an episode
        load_setting(told)
    assert "--length" not in str(error.value)


def test_weights_of_clips_do_not_watch_streams(folder: Path) -> None:
    clips = tiny_data(fps=10.0)
    with pytest.raises(EharError, match="class_names do not fit tiny"):
        load_recogniser(Conditions(data=clips, models=folder / "models"), clips)
