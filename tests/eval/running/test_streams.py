"""Streams from end to end: a recogniser learns on them, planners watch them, and what knows clips only refuses them."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.conditions import Conditions
from ehar.data.any_source import load_recordings
from ehar.data.source import load_data
from ehar.data.streams.data import NO_ACTIVITY
from ehar.data.streams.file import save_streams
from ehar.errors import DataError, EharError, UsageError
from ehar.flight.centre import around_centre, centre_limits
from ehar.flight.vehicle import VEHICLES
from ehar.onsets import begins
from ehar.planner import Context, Observation, Planner
from ehar.world import ROOM
from eval import benchmark, check_planner, verify
from eval.records.config import read_config
from eval.records.episode_lines import read_episodes
from eval.records.run_files import EPISODES, SUMMARY
from eval.running.choice import ModelPlace
from eval.running.episodes import cut_scenarios, random_starts
from eval.running.jobs import Workload
from eval.running.run import Run, read_run_of_clips
from eval.running.training import TrainAllConfig, train_all
from eval.scores.streams.scores import stream_scores
from eval.scores.summary import read_summary
from eval.studies.explain import explain
from planners.agents import training as agent_training
from planners.agents.storage import load_agent
from planners.agents.training import train_agents
from planners.place.config import FixedBestConfig
from planners.place.fit import fit_fixed_best
from planners.value.belief.streams import StreamBeliefModel
from planners.value.config import GainTrainingConfig
from planners.value.model import load_gain_model
from planners.value.training import train_gain_field
from planners.value.view_value import ViewValue
from recognition.setting import load_setting
from recognition.storage import load_recogniser
from recognition.training.config import TrainingConfig
from recognition.training.trainer import train_recogniser
from tests.helpers.agent_trainings import TinyTraining, silent
from tests.helpers.commands import fails_with
from tests.helpers.fakes import FakeRecogniser, tiny_context, tiny_data
from tests.helpers.gain_models import model_of
from tests.helpers.settings import changed
from tests.helpers.small_trainings import searching, small_trainings
from tests.helpers.stream_worlds import save_stream_world
from tests.helpers.streams import raising_streams
from tests.helpers.tiny_benchmarks import Log, file_hash

LENGTH = 50  # frames, 5 s


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with streams, raising.npz, and models that learned on them for a moment."""
    folder = save_stream_world(tmp_path_factory.mktemp("streams"))
    learn_to_look(folder)
    return folder


def learn_to_look(folder: Path) -> None:
    """Train a gain field, and find a place, with as little as will do."""
    conditions = Conditions(data=str(folder / "raising.npz"), models=folder / "models", length=40)
    with small_trainings():
        trained = train_gain_field(
            GainTrainingConfig(conditions=conditions, batches=1, workers=1), searching, lambda *_: None
        )
        fit_fixed_best(FixedBestConfig(conditions=conditions, workers=1), lambda *_: None)
    assert all("ratio" not in fit.field.parts for fit in trained.fits.values())  # nobody knows it in a stream


def watched(folder: Path, planners: Any, **options: Any) -> Run:
    told = {"data": str(folder / "raising.npz"), "models": folder / "models", "length": LENGTH}
    of_conditions = ("starts", "seed", "fps", "onset", "length", "track", "world")
    told |= {name: options.pop(name) for name in of_conditions if name in options}
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


def test_streams_are_watched_among_obstacles_and_passers_by(folder: Path) -> None:
    both = replace(ROOM, name="both", passers_by=2)
    summary = watched(folder, ("no-act", "h-rotate", "nbv-greedy", "nbv-search", "nbv", "oracle"), world=both).summary
    for planner in summary.planners:
        assert planner.contacts is not None and planner.contacts.near_frames == 0
    opened = watched(folder, "no-act").summary
    assert summary.planner("no-act").metrics["nll"] != opened.planner("no-act").metrics["nll"]


def test_all_planners_but_agents_that_nobody_trained_watch_streams(folder: Path) -> None:
    log = Log()
    ran = watched(folder, None, reporter=log)
    assert set(ran.records) >= {"no-act", "front", "fixed-best", "nbv-greedy", "nbv-search", "nbv", "oracle"}
    assert not set(ran.records) & {"il", "il-ppo"}
    assert any("il-ppo, dagger: no agent was trained for this recogniser" in line for line in log.notes)
    assert ran.config.length_note is None  # a window that planners learned from is no clip
    with pytest.raises(EharError, match=r"no such file: expected an agent, as made by `ehar train agent --data "):
        watched(folder, ("il",))


def test_agents_learn_on_streams_on_the_grid_and_in_flight_and_watch_them(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    models = Path(shutil.copytree(folder / "models", tmp_path / "models"))
    told = Conditions(data=str(folder / "raising.npz"), models=models, length=20)
    tiny = TinyTraining(conditions=told, episodes=8, workers=1, stages="il,il-ppo")
    with small_trainings():
        grid = train_agents(tiny, silent, silent)
        flown = train_agents(changed(tiny, track="px4-auto", stages="dagger"), silent, silent)
    assert [path.stem for path in (*grid, *flown)] == [
        "agent-il-perfect-moving-seed0",
        "agent-il-ppo-perfect-moving-seed0",
        "agent-dagger-perfect-moving-px4-auto-seed0",
    ]
    run = json.loads(flown[0].with_suffix(".json").read_text())["training"]["run"]
    spec = json.loads(flown[0].with_suffix(".json").read_text())["spec"]
    assert (spec["streams"], spec["sizes"]["position"]) == (True, 7)  # with the velocity
    assert (run["vehicle"]["name"], run["length"], run["variations"]) == ("px4-auto", 20, 3)
    assert train_agents(tiny, silent, silent) == grid  # nothing is left to do
    data, recogniser = load_recordings(folder / "raising.npz"), load_setting(told).recogniser_sha256
    flies = replace(told, track="px4-auto")
    assert load_agent(flies, data, "dagger", recogniser_sha256=recogniser, seed=0).length is None
    ran = benchmark(("il", "il-ppo", "dagger"), replace(flies, length=LENGTH), reporter=Log())
    assert set(ran.records) == {"il/0", "il-ppo/0", "dagger/0"}
    on_grid = ModelPlace.of(load_setting(told))
    reasons = [on_grid.reason_for_no_agent(name) is None for name in ("il", "il-ppo", "dagger")]
    assert reasons == [True, True, False]


def test_planners_over_the_field_move_and_fly(folder: Path) -> None:
    for track in ("ideal", "px4-auto"):
        ran = watched(folder, ("nbv-greedy", "nbv-search", "nbv"), track=track)
        for name, held in ran.records.items():
            assert np.ptp(held.viewpoint[:, :, 1:], axis=1).max() > 0.02, f"{name} stays on {track}"


def test_flights_over_streams_are_compared_with_the_grid(folder: Path, tmp_path: Path) -> None:
    planners = ("no-act", "front")
    watched(folder, planners, out=tmp_path / "grid")
    flown = watched(folder, planners, track="px4-auto", out=tmp_path / "flown", ideal=tmp_path / "grid")
    assert flown.config.ideal == str(tmp_path / "grid")
    assert verify(tmp_path / "flown").difference is None
    watched(folder, planners, onset="known", out=tmp_path / "known")
    with pytest.raises(UsageError, match=r"differs in onset \(onset: expected 'unknown', got 'known'\)"):
        watched(folder, planners, track="px4-auto", ideal=tmp_path / "known")


def test_the_belief_can_be_scored_and_moves_nothing(folder: Path) -> None:
    said, believed = (watched(folder, ("nbv-search",), readout=readout) for readout in ("recogniser", "belief"))
    one, other = said.records["nbv-search"], believed.records["nbv-search"]
    np.testing.assert_array_equal(one.viewpoint, other.viewpoint)
    assert (one.true_probability != other.true_probability).any()


def test_a_field_of_streams_is_not_for_clips(folder: Path) -> None:
    setting = load_setting(Conditions(data=str(folder / "raising.npz"), models=folder / "models"))
    model = ModelPlace.of(setting).load_gain_model()
    assert isinstance(model.belief, StreamBeliefModel)
    assert model.memory == pytest.approx(setting.runner.recogniser.memory)  # type: ignore[attr-defined]
    assert model.length is None
    with pytest.raises(UsageError, match="got one that was trained on streams, expected one for clips"):
        ViewValue(model).reset(tiny_context())
    with pytest.raises(UsageError, match="got one that was trained on clips, expected one for streams"):
        ViewValue(model_of(np.zeros(21))).reset(replace(tiny_context(), length=None))


def test_a_field_that_is_learned_in_flight_expects_as_far_as_its_paths_go(folder: Path, tmp_path: Path) -> None:
    told = Conditions(data=str(folder / "raising.npz"), models=folder / "models", track="px4-auto", length=40)
    with small_trainings():
        train_gain_field(
            GainTrainingConfig(conditions=told, out=tmp_path, batches=1, workers=1), searching, lambda *_: None
        )
    held = json.loads((tmp_path / "gain-field-perfect-moving-px4-auto.json").read_text())
    of_grid = json.loads((folder / "models" / "gain-field-perfect-moving.json").read_text())
    assert (held["lookahead"], of_grid["lookahead"]) == (3.0, 2.0)
    sha256 = load_setting(told).recogniser_sha256
    model = load_gain_model(replace(told, models=tmp_path), raising_streams(), sha256)
    assert model.lookahead == 3.0


def test_the_kit_checks_planners_on_streams(folder: Path) -> None:
    told = Conditions(data=str(folder / "raising.npz"), models=folder / "models")
    for planner in ("nbv-search", "oracle"):
        found = check_planner(planner, told)
        assert found.passed, str(found)


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
    with pytest.raises(DataError, match=r"expected streams of at least 300 frames \(30 s\), the longest of 2 has 120"):
        benchmark("no-act", Conditions(data=str(folder / "raising.npz"), models=folder / "models"), reporter=Log())


def test_episodes_in_which_no_activity_begins_and_ends(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(
        DataError, match=r"begins and ends within an episode of 8 frames \(0.8 s\), got none in 30 episodes: a lon"
    ):
        watched(folder, "no-act", length=8, out=tmp_path / "run")
    assert not list(tmp_path.iterdir())


def test_what_knows_clips_only_refuses_streams(folder: Path, tmp_path: Path) -> None:
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


def test_streams_are_an_environment_by_its_name(folder: Path) -> None:
    told = Conditions(data=str(folder / "raising.npz"), models=folder / "models", length=LENGTH, part="policy")
    env = gym.make("ehar/Stream-v0", conditions=told)
    observation, _ = env.reset(seed=0)
    assert observation["time"] == 0
    flying = gym.make_vec(
        "ehar/Stream-v0",
        num_envs=2,
        vectorization_mode="vector_entry_point",
        conditions=replace(told, track="px4-auto"),
    )
    observations, _ = flying.reset(seed=0)
    assert observations["velocity"].shape == (2, 3)
    motion = flying.unwrapped.episodes.controls.motion  # type: ignore[attr-defined]
    assert motion.vehicle == around_centre(VEHICLES["px4-auto"])  # limits count in the world's frame
    assert motion.centre.position.shape == (2, LENGTH, 3)
    with pytest.raises(UsageError, match=r"tiny: expected streams, got trimmed sequences: `ehar/Grid-v0` takes them"):
        clips = Conditions(data=tiny_data(), recogniser=FakeRecogniser())
        gym.make("ehar/Stream-v0", conditions=clips)
    with pytest.raises(UsageError, match="raising: expected trimmed sequences, got streams"):
        gym.make("ehar/Grid-v0", conditions=told)


def test_everything_that_planners_need_is_trained_on_streams(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(agent_training, "train_agents", lambda config, *_: [config.directory / "il.safetensors"])
    told = Conditions(data=str(folder / "raising.npz"), length=40)
    trained = train_all(TrainAllConfig(conditions=told, out=folder / "models"))
    lines = capsys.readouterr().out.splitlines()
    parts = ("the recogniser", "the gain field", "the place of fixed-best")
    assert lines[:3] == [f"{i} of 4: {part} in {folder / 'models'} is kept" for i, part in enumerate(parts, 1)]
    assert lines[3:] == ["4 of 4: the agents il, ppo, il-ppo and dagger"]
    assert trained.lines[0].endswith("--length 40")
    with pytest.raises(UsageError, match="--setting paper: expected trimmed sequences, got streams"):
        train_all(TrainAllConfig(conditions=replace(told, views="paper"), out=folder / "models", setting="paper"))


def test_an_episode_of_a_stream_is_explained_by_the_seconds_to_come(folder: Path, tmp_path: Path) -> None:
    told = Conditions(data=str(folder / "raising.npz"), models=folder / "models", length=LENGTH)
    found = explain(told, planner="nbv-search", episode=1, frames=2, out=tmp_path / "a.svg", reporter=Log())
    held = watched(folder, "nbv-search").records["nbv-search"]
    np.testing.assert_array_equal(np.where(found.labels == 3, NO_ACTIVITY, found.labels), held.label[1])
    np.testing.assert_allclose(found.of_true(found.recognised), held.true_probability[1], atol=1e-5)
    assert found.outcome == f"right in {int(found.right.sum())} of {LENGTH} frames"
    assert (found.ahead, found.reach, found.subject) == (2.0, 20, "a stream for 5 s")
    assert found.believed.shape == (LENGTH - 1, 4)  # with no activity
    (table,) = found.tables()
    assert [row[0] for row in table.rows] == [f"{frame / 10:.1f}" for frame in found.moments]
    assert "over the coming 2 s" in table.footnotes[1]
    assert "of the next 2 s" in (tmp_path / "a.svg").read_text()
    of_flights = replace(found, ahead=4.0, expected=3.0).tables()[0].footnotes  # as a field of flights expects
    assert "over the coming 4 s" in of_flights[1] and "the share of each class in the coming 3 s" in of_flights[2]


def test_a_vehicle_that_watches_a_stream_follows_people_within_its_limits(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    setting = load_setting(
        Conditions(data=str(folder / "raising.npz"), models=folder / "models", length=LENGTH, track="px4-auto")
    )
    scenarios = cut_scenarios(setting.recordings, setting.sequences, LENGTH, lambda _: None)
    workload = Workload(setting.runner, random_starts(scenarios, 1, 0, setting.world))
    flown = workload.followed.batch(0)
    limits = centre_limits(VEHICLES["px4-auto"])
    assert flown.centre is not None and np.linalg.norm(flown.centre.velocity, axis=-1).max() <= limits.speed
    assert workload.episodes.batch(0).centre is None
    np.testing.assert_array_equal(flown.noise.dropout, workload.episodes.batch(0).noise.dropout)
    fast = raising_streams()
    fast.positions[:, :, :, 0] += (0.2 * (np.arange(len(fast.positions)) % 120))[:, None, None]  # 2 m/s
    told = Conditions(data=fast, models=folder / "models", length=LENGTH, track="ground-robot")
    with pytest.raises(UsageError, match="track ground-robot: too slow for the people of 'stream-"):
        benchmark("no-act", told, reporter=Log())
    with pytest.raises(UsageError, match="track ground-robot: too slow for the people of 'stream-"):
        gym.make("ehar/Stream-v0", conditions=told)
    save_streams(tmp_path / "fast.npz", fast)
    options = ["--data", str(tmp_path / "fast.npz"), "--models", str(folder / "models"), "--length", str(LENGTH)]
    error = fails_with(["benchmark", "no-act", *options, "--track", "ground-robot"], capsys)
    assert "track ground-robot: too slow for the people of 'stream-" in error
