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
from ehar.onsets import begins
from ehar.planner import Context, Observation, Planner
from eval import benchmark
from eval.records.config import read_config
from eval.records.episodes import read_episodes
from eval.records.run_files import EPISODES, SUMMARY
from eval.running.run import Run, read_run_of_clips
from eval.scores.streams.scores import stream_scores
from eval.scores.summary import read_summary
from planners.value.config import GainTrainingConfig
from planners.value.training import train_gain_field
from recognition.setting import load_setting
from recognition.storage import load_recogniser
from recognition.training.config import TrainingConfig
from recognition.training.trainer import train_recogniser
from tests.helpers.commands import fails_with
from tests.helpers.fakes import tiny_data
from tests.helpers.stream_worlds import save_stream_world
from tests.helpers.streams import raising_streams
from tests.helpers.tiny_benchmarks import Log, file_hash

LENGTH = 50  # frames, 5 s


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with streams, raising.npz, and models that learned on them for a moment."""
    return save_stream_world(tmp_path_factory.mktemp("streams"))


def watched(folder: Path, planners: Any, **options: Any) -> Run:
    told = {"data": str(folder / "raising.npz"), "models": folder / "models", "length": LENGTH}
    told |= {name: options.pop(name) for name in ("starts", "seed", "fps", "onset", "length") if name in options}
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
    summary = read_summary(tmp_path / SUMMARY, run.config, run.records)
    assert [planner.streams for planner in summary.planners] == [planner.streams for planner in run.summary.planners]
    assert summary.planner("oracle").streams == stream_scores(held, 10.0)
    back = read_episodes(tmp_path / EPISODES)["oracle"]
    np.testing.assert_array_equal(back.label, held.label)
    np.testing.assert_array_equal(back.predicted, held.predicted)
    config = json.loads((tmp_path / "config.json").read_text())
    assert (config["fps"], config["length"]) == (10.0, LENGTH)


def test_planners_watch_streams_in_which_people_get_lost(folder: Path) -> None:
    data = raising_streams()
    lost = replace(data, missing=np.arange(len(data.positions)) % 50 < 8)
    planners = ("towards", "h-rotate", "near-level", "front", "side", "oracle-lookahead")
    run = benchmark(planners, Conditions(data=lost, models=folder / "models", length=LENGTH), reporter=Log())
    assert len(run.records["side"]) == 4
    assert (run.records["side"].true_probability != watched(folder, "side").records["side"].true_probability).any()


def test_a_known_onset_is_named_and_is_the_recogniser_begun_anew(folder: Path, tmp_path: Path) -> None:
    planners = ("no-act", "oracle", "oracle-lookahead")
    known = watched(folder, planners, onset="known", out=tmp_path / "known")
    unknown = watched(folder, planners, out=tmp_path / "unknown")
    assert "onset known" in str(known) and "onset known" not in str(unknown)
    assert "onset known" in (tmp_path / "known" / "table.md").read_text()
    assert read_config(tmp_path / "known").conditions.onset == "known"
    assert read_config(tmp_path / "unknown").conditions.onset == "unknown"
    assert "onset" not in json.loads((tmp_path / "unknown" / "config.json").read_text())
    a, b = (run.records["no-act"] for run in (known, unknown))
    np.testing.assert_array_equal(a.label, b.label)
    told = begins(np.where(a.label == NO_ACTIVITY, 3, a.label), 3)
    same = (a.true_probability == b.true_probability) & (a.predicted == b.predicted)
    before = np.cumsum(told, axis=1) == 0
    assert same[before].all() and not same[~before].all()


def test_clips_have_no_onset_to_be_known(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    message = fails_with(["benchmark", "no-act", "--onset", "known", "--out", str(tmp_path / "run")], capsys)
    assert "onset: expected unknown for duo, whose episodes begin with their activity, got known" in message
    with pytest.raises(UsageError, match="unknown onset 'late'; expected one of: unknown, known"):
        Conditions(onset="late")  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())


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
    for told in (60, 42):  # 60 is no other than the rest, though it is the usual length of clips
        one = load_setting(Conditions(data=str(folder / "raising.npz"), models=folder / "models", length=told))
        assert one.conditions.length == told


def test_streams_that_are_too_short(folder: Path) -> None:
    with pytest.raises(
        DataError, match=r"expected test streams of at least 300 frames \(30 s\), the longest of 2 has 120"
    ):
        benchmark("no-act", Conditions(data=str(folder / "raising.npz"), models=folder / "models"), reporter=Log())


def test_episodes_in_which_no_activity_begins_and_ends(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(
        DataError, match=r"begins and ends within an episode of 8 frames \(0.8 s\), got none in 30: a lon"
    ):
        watched(folder, "no-act", length=8, out=tmp_path / "run")
    assert not list(tmp_path.iterdir())


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
    with pytest.raises(UsageError, match="expected a run of clips, got one of streams, which ehar report, replay"):
        read_run_of_clips(tmp_path / "run")


def test_what_is_missing_is_suggested_as_it_was_told(folder: Path, tmp_path: Path) -> None:
    told = Conditions(data=str(folder / "raising.npz"), models=tmp_path)
    with pytest.raises(EharError, match=r"--views moving --out") as error:  # without the length of an episode
        load_setting(told)
    assert "--length" not in str(error.value)


def test_weights_of_clips_do_not_watch_streams(folder: Path) -> None:
    clips = tiny_data(fps=10.0)
    with pytest.raises(EharError, match="class_names do not fit tiny"):
        load_recogniser(Conditions(data=clips, models=folder / "models"), clips)
