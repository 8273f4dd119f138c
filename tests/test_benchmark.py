import hashlib
import json
import os
import signal
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from agents import save_untrained
from fakes import FakeRecogniser, tiny_context, tiny_data
from gain_models import model_of, peak_weights

from ehar.arrays import FloatArray
from ehar.errors import DataError, EharError, EpisodeError, ModelError, UsageError
from ehar.motion import GridMotion
from ehar.motion_data import MotionData
from ehar.planner import Context, Observation, Planner
from ehar.rollout import rollout
from ehar.scenario import part_of, split_parts
from ehar.sensor import PerfectSensor
from ehar.vehicle import FILE_KEYS, VEHICLES
from ehar.viewpoint import cartesian
from eval import benchmark
from eval.episodes import CHUNK, cut_scenarios, random_starts
from eval.flight_records import FlightSummary, summarise_flights
from eval.records import read_episodes
from eval.results import EPISODES, SCHEMA, SUMMARY
from eval.summary import Summary
from eval.tables import markdown_summary
from planners.belief import BeliefModel, readout
from planners.gain_model import gain_model_path, save_gain_model
from planners.heuristic import NoAct
from planners.next_best_view import NextBestView
from planners.registry import planner_names


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
    monkeypatch.setattr("recognition.storage.load_recogniser", lambda *_, **__: HashedRecogniser())


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
    summary = run(["no-act"], part="validation", out=tmp_path)
    assert set(read_episodes(tmp_path / EPISODES)["no-act"].sequence) == validation
    assert "validation part" in markdown_summary(summary)
    assert "part," not in markdown_summary(run(["no-act"]))


def test_what_the_fake_rewards_is_what_the_table_says() -> None:
    # The fake recogniser sees more the nearer to level the camera is; the oracle knows it, v-rotate goes there.
    summary = run(["no-act", "v-rotate", "oracle"])
    assert summary.planner("oracle").acc_mean > summary.planner("no-act").acc_mean
    assert summary.planner("v-rotate").acc_mean > summary.planner("no-act").acc_mean
    assert summary.planner("no-act").path_length_m == 0
    assert summary.planner("oracle").privileged
    assert not summary.planner("v-rotate").privileged


SLOW_TO_BELIEVE = BeliefModel(noise_weights=(3.0, 0.0, 0.0, 0.0, 0.0), process_noise=0.1)


@pytest.fixture
def models(tmp_path: Path) -> Path:
    """Return a folder with a gain model of the fake recogniser, that wants to look from level."""
    directory = tmp_path / "models"
    save_models(directory, recogniser_sha256="fake")
    return directory


def save_models(directory: Path, *, recogniser_sha256: str) -> None:
    model = replace(model_of(peak_weights(np.array([8.0, 1.0, np.pi / 2]))), belief=SLOW_TO_BELIEVE)
    path = gain_model_path(directory, sensor="perfect", views="moving")
    save_gain_model(path, model, recogniser_sha256=recogniser_sha256, history={})


def names(summary: Summary) -> tuple[str, ...]:
    return tuple(planner.name for planner in summary.planners)


def with_agents(models: Path) -> dict[str, str]:
    """Add agents of the fake recogniser to a models folder, and return their hashes by record name."""
    hashes = {}
    for name, seed in (("il", 0), ("ppo", 3), ("il-ppo", 0), ("il-ppo", 1), ("dagger", 0), ("il-ppo-no-vision", 0)):
        path = save_untrained(models, tiny_data(sequences=40), name, seed=seed)
        content = path.read_bytes() + path.with_suffix(".json").read_bytes()
        hashes[f"{name}/{seed}"] = hashlib.sha256(content).hexdigest()
    return hashes


def test_without_names_every_planner_runs_each_training_of_a_learned_one(models: Path, tmp_path: Path) -> None:
    log, hashes = Log(), with_agents(models)
    summary = run(None, starts=1, models=models, out=tmp_path / "run", reporter=log)
    ran = {*log.done}
    trainings = {"il/0", "ppo/3", "il-ppo/0", "il-ppo/1", "dagger/0"}
    assert ran == {*planner_names()} - {"il", "ppo", "il-ppo", "dagger"} | trainings
    assert names(summary) == planner_names(), "the trainings of a planner are one row"
    assert log.notes == []
    for planner in json.loads((tmp_path / "run" / "config.json").read_text())["planners"]:
        assert planner["weights_sha256"] == hashes.get(planner["name"])
        assert not planner["privileged"] or planner["name"].startswith("oracle")
    config = json.loads((tmp_path / "run" / "config.json").read_text())
    weights = gain_model_path(models, sensor="perfect", views="moving")
    content = weights.read_bytes() + weights.with_suffix(".json").read_bytes()
    assert config["gain_model_sha256"] == hashlib.sha256(content).hexdigest()
    assert {"casadi", "filterpy", "ruckig"} <= config["versions"].keys()


def test_those_for_whom_nothing_was_trained_are_left_out_aloud(tmp_path: Path) -> None:
    log = Log()
    summary = run(None, starts=1, models=tmp_path / "none", reporter=log)
    trained = ("nbv", "il", "ppo", "dagger")
    assert names(summary) == tuple(name for name in planner_names() if not name.startswith(trained))
    valuing, learned = log.notes
    assert valuing.startswith("left out: nbv-greedy, nbv-search, nbv: ")
    assert "`ehar train gain-field --data tiny" in valuing
    assert learned.startswith("left out: il, ppo, il-ppo, dagger: no agent was trained for this recogniser: ")
    assert "`ehar train agent --data tiny" in learned
    log = Log()
    run(None, starts=1, form="ctrgcn", reporter=log)
    valuing, learned = log.notes
    assert valuing.endswith("gain fields are trained for the causal recogniser, and this is ctrgcn")
    assert learned.endswith("agents are trained for the causal recogniser, and this is ctrgcn")


def test_who_is_named_has_to_run(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="no such file: expected a gain field"):
        run(["no-act", "nbv"], models=tmp_path / "none")
    with pytest.raises(ModelError, match=r"agent-il-ppo-perfect-moving-seed0\.safetensors: no such file"):
        run(["no-act", "il-ppo"], models=tmp_path / "none")


@pytest.mark.parametrize("planners", [None, ["nbv-greedy"]])
def test_a_gain_field_of_another_recogniser_is_never_passed_over(models: Path, planners: list[str] | None) -> None:
    save_models(models, recogniser_sha256="another")
    with pytest.raises(ModelError, match="trained for another recogniser"):
        run(planners, models=models)


def test_a_gain_field_that_is_right_is_worth_following(models: Path) -> None:
    summary = run(["no-act", "nbv-greedy", "nbv-search", "nbv"], models=models, starts=1)
    no_act, *valuing = (planner.acc_mean for planner in summary.planners)
    assert min(valuing) > no_act
    assert [(of.planner, of.other) for of in summary.differences] == [
        ("nbv", "no-act"),
        ("nbv", "nbv-greedy"),
        ("nbv", "nbv-search"),
    ]


def test_plans_are_counted_over_all_chunks(models: Path) -> None:
    # 80 episodes of 10 frames: a plan for each of them at every frame that is a multiple of `replan`, but the last.
    summary = run(["no-act", "nbv"], models=models, starts=2)
    assert summary.episodes == 80 > CHUNK
    assert summary.planner("no-act").solves is None
    solves = summary.planner("nbv").solves
    assert solves is not None
    replan = NextBestView(model=model_of(peak_weights(np.array([8.0, 1.0, 1.0])))).replan
    assert solves.total == 80 * len(range(0, 9, replan))


def test_the_belief_is_scored_and_planners_act_the_same(models: Path, tmp_path: Path) -> None:
    run(["no-act", "oracle"], models=models, out=tmp_path / "recogniser", starts=1)
    summary = run(["no-act", "oracle"], models=models, readout="belief", out=tmp_path / "belief", starts=1)
    seen, believed = (read_episodes(tmp_path / name / EPISODES) for name in ("recogniser", "belief"))
    for name in seen:
        np.testing.assert_array_equal(seen[name].viewpoint, believed[name].viewpoint)
        assert not np.array_equal(seen[name].true_probability, believed[name].true_probability)
    assert summary.readout == summary.to_json()["readout"] == "belief"
    assert json.loads((tmp_path / "belief" / "config.json").read_text())["readout"] == "belief"
    assert "readout belief" in (tmp_path / "belief" / "table.md").read_text()
    # By hand: the belief of the fake recogniser's words from where no-act stands.
    data = tiny_data(sequences=40)
    scenarios = cut_scenarios(data, split_parts(data).test, 10, print)
    episodes = random_starts(scenarios, 1, 0)
    context = replace(tiny_context(episodes=32, length=10), frame_time=1 / data.fps)
    record = rollout(NoAct(), episodes.batch(0), FakeRecogniser(), PerfectSensor(), GridMotion(), context)
    probabilities = np.exp(readout(SLOW_TO_BELIEVE, record.log_probs, record.viewpoints))
    true = np.take_along_axis(probabilities, episodes.chunk(0).labels[:, None, None], axis=2)[..., 0]
    np.testing.assert_allclose(believed["no-act"].true_probability[:32], true, atol=1e-6)


def test_the_belief_is_not_scored_without_a_model(tmp_path: Path) -> None:
    for planners in (None, ["no-act"]):
        with pytest.raises(ModelError, match="no such file: expected a gain field"):
            run(planners, models=tmp_path / "none", readout="belief")


def test_a_vehicle_flies_within_its_limits_and_the_records_say_so(tmp_path: Path) -> None:
    summary = run(["no-act", "oracle"], track="px4-max", starts=1, out=tmp_path)
    vehicle = VEHICLES["px4-max"]
    config = json.loads((tmp_path / "config.json").read_text())
    assert config["track"] == summary.track == "px4-max"
    assert config["vehicle"] == asdict(vehicle)
    still, oracle = (planner.flight for planner in summary.planners)
    assert still == FlightSummary(0, 0, 0, 0, 0)
    assert oracle is not None
    assert 0 < oracle.peak_speed <= vehicle.speed
    assert 0 < oracle.peak_acceleration <= vehicle.acceleration * (1 + 1e-6)
    assert 0 < oracle.peak_jerk <= vehicle.jerk * (1 + 1e-6)
    assert oracle.effort > 0
    flights = read_episodes(tmp_path / EPISODES)["oracle"].flight
    assert flights is not None
    assert summarise_flights(flights) == oracle
    assert "effort" in (tmp_path / "table.md").read_text()


def test_a_vehicle_of_one_s_own_is_recorded_with_its_limits(tmp_path: Path) -> None:
    path = tmp_path / "snail.json"
    path.write_text(json.dumps(dict.fromkeys(FILE_KEYS, 0.5)))
    summary = run(["no-act", "oracle"], track=str(path), starts=1, out=tmp_path / "run")
    assert summary.track == "snail"
    assert json.loads((tmp_path / "run" / "config.json").read_text())["vehicle"]["speed"] == 0.5


def test_flights_are_compared_with_a_run_on_the_ideal_track(tmp_path: Path) -> None:
    ideal = run(["no-act", "oracle"], out=tmp_path / "ideal")
    flight = run(["no-act", "oracle"], track="tracking-drone", ideal=tmp_path / "ideal", out=tmp_path / "flight")
    assert flight.planner("no-act").acc_mean == ideal.planner("no-act").acc_mean
    gains = [of.planner("oracle").acc_mean - of.planner("no-act").acc_mean for of in (flight, ideal)]
    assert flight.planner("oracle").accuracy_kept == pytest.approx(gains[0] / gains[1])
    with pytest.raises(UsageError, match="differs in seed"):
        run(["no-act"], track="tracking-drone", ideal=tmp_path / "ideal", seed=1)


def test_the_flight_of_an_agent_is_compared_with_the_same_agent(tmp_path: Path) -> None:
    models = tmp_path / "models"
    with_agents(models)
    options: dict[str, Any] = {"planners": ["no-act", "oracle", "il-ppo"], "models": models, "starts": 1}
    run(**options, out=tmp_path / "ideal")
    flight = run(**options, track="tracking-drone", ideal=tmp_path / "ideal")
    assert flight.planner("il-ppo").accuracy_kept is not None
    save_untrained(models, tiny_data(sequences=40), "il-ppo", seed=1, like="another")
    with pytest.raises(UsageError, match="the weights of il-ppo/1 differ"):
        run(**options, track="tracking-drone", ideal=tmp_path / "ideal")


@pytest.mark.slow
def test_two_workers_give_the_same_bytes_in_flight_with_beliefs_and_plans(models: Path, tmp_path: Path) -> None:
    options: dict[str, Any] = {"models": models, "track": "px4-max", "readout": "belief", "starts": 2}
    for workers in (1, 2):
        run(["no-act", "nbv-greedy", "nbv"], out=tmp_path / str(workers), workers=workers, **options)
    one, two = (json.loads((tmp_path / name / SUMMARY).read_text()) for name in "12")
    assert file_hash(tmp_path / "1" / EPISODES) == file_hash(tmp_path / "2" / EPISODES)
    assert [planner["solves"] for planner in one["planners"]] == [planner["solves"] for planner in two["planners"]]


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
def test_trainings_that_are_named_run_alone_and_agents_reach_the_workers(tmp_path: Path) -> None:
    with_agents(tmp_path)
    for workers in (1, 2):
        log = Log()
        chosen = ["no-act", "il-ppo/1", "il-ppo-no-vision"]
        run(chosen, models=tmp_path, starts=1, out=tmp_path / str(workers), workers=workers, reporter=log)
        assert {*log.done} == {"no-act", "il-ppo/1", "il-ppo-no-vision/0"}
    assert file_hash(tmp_path / "1" / EPISODES) == file_hash(tmp_path / "2" / EPISODES)
    ways = {name: episodes.viewpoint for name, episodes in read_episodes(tmp_path / "1" / EPISODES).items()}
    assert not np.array_equal(ways["il-ppo/1"], ways["no-act"])
    assert not np.array_equal(ways["il-ppo/1"], ways["il-ppo-no-vision/0"])


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
    # What a shell starts in the background ignores Ctrl-C, these tests perhaps too.
    signal.signal(signal.SIGINT, signal.default_int_handler)
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
        (
            {"planners": [object()]},
            "planner <object.*>: expected what .*Planner has, missing: name, privileged, reset, act",
        ),
        ({"data": "trio"}, "unknown data 'trio'.*duo, solo"),
        ({"part": "training"}, "unknown part .training.; expected one of: recogniser, policy, validation, test"),
        ({"track": "rail"}, "unknown track 'rail'; expected ideal, px4-auto, px4-max, tracking-drone"),
        ({"readout": "tarot"}, "unknown readout 'tarot'; expected recogniser or belief"),
        ({"ideal": "somewhere"}, "the track is ideal; expected a vehicle"),
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
