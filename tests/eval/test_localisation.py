"""A world with another localisation: all that follows people in streams follows it, a run records it and says so."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import recognition  # noqa: F401  # registers the environments
from ehar import Conditions, EharError
from ehar.arrays import FloatArray
from ehar.data.scenario import localised, windows
from ehar.data.streams.data import StreamData
from ehar.data.streams.followed import following_centre, thought_to_be
from ehar.flight.centre import centre_limits
from ehar.flight.vehicle import VEHICLES
from ehar.localisation import Localisation
from ehar.sensors.perfect import PerfectSensor
from ehar.viewpoint import HOVER, Workspace
from ehar.world import PAPER, World, load_world
from eval import Watcher, benchmark, compare, read_run, verify
from eval.conformance.world import small_batch
from eval.live import rehearsal
from eval.live.setpoints import Setpoints
from eval.running.episodes import cut_scenarios, random_starts
from eval.running.jobs import Workload
from eval.running.run import Run
from eval.running.training import TrainAllConfig, has_fixed_best, has_gain_field, has_recogniser
from eval.studies.explain import explain
from eval.studies.trainings import trainings
from recognition.environments import make_stream_env
from recognition.setting import Setting, load_setting
from recognition.training.clips import ClipSource
from tests.helpers.commands import fails_with
from tests.helpers.live_worlds import START, frame, person, save_live_world
from tests.helpers.random_networks import save_random_world
from tests.helpers.settings import tiny_conditions
from tests.helpers.tiny_benchmarks import Log

LENGTH, CLIP = 90, 8  # frames, of streams and of clips
WORSE = Localisation(noise=0.4, delay=0.5, agility=0.5)
SPACE = {
    "distance_min": 5,
    "distance_max": 15,
    "polar_min_deg": 0,
    "polar_max_deg": 90,
    "distance_step": 0.1,
    "angle_step_deg": 3.6,
    "start_cells": [100, 100, 25],
    "camera": {"width": 1280, "height": 720, "focal_length": 850},
}
TOLD = "people are localised with noise 0.4 m, delay 0.5 s, agility 0.5 m/s^2, but weights were trained with another"
USUALLY = "noise 0.05 m, delay 0.1 s, agility 2 m/s^2"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with streams, weights of the paper's world, and a file of it with a worse localisation."""
    folder = save_live_world(tmp_path_factory.mktemp("localised"))
    (folder / "worse.json").write_text(json.dumps(SPACE | {"localisation": vars(WORSE)}), encoding="utf-8")
    return folder


def told(folder: Path, **changes: Any) -> Conditions:
    usual = {"data": str(folder / "raising.npz"), "models": folder / "models", "length": LENGTH}
    return Conditions(**{**usual, "world": str(folder / "worse.json"), **changes})


@pytest.fixture(scope="module")
def run(folder: Path) -> Run:
    return benchmark(["no-act", "h-rotate", "fixed-best"], told(folder), out=folder / "run", reporter=Log())


def of_benchmark(setting: Setting) -> FloatArray:
    scenarios = cut_scenarios(setting.recordings, setting.sequences[:1], LENGTH, lambda _: None)
    return random_starts(scenarios, 1, 0, setting.world).batch(0).positions[0]


def of_workload(setting: Setting) -> FloatArray:
    scenarios = cut_scenarios(setting.recordings, setting.sequences[:1], LENGTH, lambda _: None)
    return Workload(setting.runner, random_starts(scenarios, 1, 0, setting.world)).followed.batch(0).positions[0]


def of_trainings(setting: Setting) -> FloatArray:
    """Return what gain fields, fixed places, teachers and validation of agents learn from."""
    scenarios = windows(setting.recordings, setting.sequences[:1], LENGTH, LENGTH)
    rng = np.random.default_rng(0)
    return setting.runner.batch(scenarios, np.array([0]), START[None], rng).positions[0]


def of_kits(setting: Setting) -> FloatArray:
    data = setting.recordings
    assert isinstance(data, StreamData)
    return small_batch(data, setting.world).positions[0]


@pytest.mark.parametrize("consumer", [of_benchmark, of_workload, of_trainings, of_kits])
def test_cameras_look_at_where_the_world_s_localisation_says(
    folder: Path, consumer: Callable[[Setting], FloatArray]
) -> None:
    for world in (str(folder / "worse.json"), "paper"):
        setting = load_setting(told(folder, world=world))
        data = setting.recordings
        assert isinstance(data, StreamData)
        seen = consumer(setting)
        begin = data.offsets[setting.sequences[0]]
        there = slice(begin, begin + len(seen))
        people = thought_to_be(data, load_world(world).localisation)[there]
        np.testing.assert_allclose(seen, data.positions[there] - people[:, None, None], atol=1e-5)
        assert (seen == consumer(load_setting(told(folder, world="paper")))).all() == (world == "paper")


def test_the_centre_that_a_vehicle_follows_goes_after_it(folder: Path) -> None:
    setting = load_setting(told(folder, track="px4-auto"))
    data = setting.recordings
    assert isinstance(data, StreamData)
    scenarios = windows(data, setting.sequences[:1], LENGTH, LENGTH)
    followed = following_centre(data, WORSE, centre_limits(VEHICLES["px4-auto"])).position
    begin = data.offsets[setting.sequences[0]]
    batch = setting.runner.batch(scenarios, np.array([0]), START[None], np.random.default_rng(0))
    assert batch.centre is not None
    np.testing.assert_array_equal(batch.centre.position[0], followed[begin : begin + LENGTH])
    env = make_stream_env(conditions=told(folder, track="px4-auto"))
    env.reset(seed=0)
    centre = env.episodes.controls.motion.centre.position[0]  # type: ignore[attr-defined]
    assert any((followed[first : first + LENGTH] == centre).all() for first in range(len(followed) - LENGTH + 1))


def test_flights_longer_than_all_streams_are_refused_in_one_line(folder: Path) -> None:
    with pytest.raises(EharError, match=r"^[^\n]*expected [^\n]*$"):
        make_stream_env(conditions=replace(told(folder, track="px4-auto"), length=100_000))


def test_environments_see_people_there(folder: Path) -> None:
    seen = []
    for world in (str(folder / "worse.json"), "paper"):
        env = gym.make("ehar/Stream-v0", conditions=told(folder, world=world, part="policy"))
        env.reset(seed=0)
        for _ in range(30):
            joints = env.step(HOVER)[0]["joints"]
        seen.append(joints)
    assert (seen[0] != seen[1]).any()


def test_recognisers_learn_with_it(folder: Path) -> None:
    data = load_setting(told(folder)).recordings
    drawn = []
    for world in (load_world(folder / "worse.json"), PAPER):
        options = {"length": LENGTH, "views": "moving", "form": "causal", "augment": False, "world": world}
        source = ClipSource(data=data, sequences=np.arange(6), sensor=PerfectSensor(), **options)
        drawn.append(source.draw(np.random.default_rng(0), 4).features)
    assert (drawn[0] != drawn[1]).any()


def test_a_run_records_it_and_is_verified_without_the_file(folder: Path, run: Run, tmp_path: Path) -> None:
    held = json.loads((folder / "run" / "config.json").read_text(encoding="utf-8"))
    assert held["world"]["localisation"] == vars(WORSE)
    (folder / "worse.json").rename(tmp_path / "gone.json")
    try:
        read = read_run(folder / "run")
        assert read.config == run.config and read.config.world.localisation == WORSE
        found = verify(folder / "run", rerun_episodes=2, reporter=Log())
        assert found.difference is None
        assert [check.name for check in found.checks if check.result == "not checked"] == []
    finally:
        (tmp_path / "gone.json").rename(folder / "worse.json")
    assert f"people localised with {WORSE}" in str(run.config.world) and "world worse" in str(run)
    for name in ("episodes.jsonl", "summary.json"):
        (tmp_path / name).write_bytes((folder / "run" / name).read_bytes())
    del held["world"]["localisation"]
    (tmp_path / "config.json").write_text(json.dumps(held), encoding="utf-8")
    found = verify(tmp_path, rerun_episodes=2, reporter=Log())
    assert found.difference is not None, "it did not run with the usual one"


def test_a_usual_localisation_leaves_files_as_they_were(folder: Path) -> None:
    usual = benchmark(["no-act"], told(folder, world="paper"), reporter=Log())
    held = usual.config.to_json()
    assert "localisation" not in held["world"] and "trained_localisations" not in held
    assert usual.config.warnings == () and "localised" not in str(usual.config.world)


def test_weights_from_another_localisation_are_used_and_that_is_said_aloud(folder: Path, tmp_path: Path) -> None:
    log = Log()
    ran = benchmark(["no-act", "fixed-best", "nbv-greedy", "il"], told(folder), out=tmp_path / "run", reporter=log)
    said = f"{TOLD} localisation: recogniser, gain field, fixed-best, il/2, il/10 with {USUALLY}"
    assert f"warning: {said}" in log.notes
    assert f"Warning: {said}." in ran.summary.tables()[0].footnotes
    assert read_run(tmp_path / "run").config.warnings == (said,)
    there = save_live_world(tmp_path / "there", world=load_world(folder / "worse.json"))
    log = Log()
    assert benchmark(["fixed-best", "nbv-greedy", "il"], told(folder, models=there / "models"), reporter=log)
    assert not any("localised" in note for note in log.notes)
    log = Log()
    benchmark(["no-act"], told(folder, models=there / "models", world="paper"), reporter=log)
    expected = f"people are localised with {USUALLY}, but weights were trained with another localisation: recogniser"
    assert f"warning: {expected} with {WORSE}" in log.notes
    log = Log()
    explain(told(folder), planner="nbv-greedy", frames=1, reporter=log)
    assert any(note.startswith(f"warning: {TOLD}") for note in log.notes)


def test_another_world_is_still_refused(folder: Path) -> None:
    near = World("near", replace(PAPER.workspace, distance_max=14.0), PAPER.camera, localisation=WORSE)
    with pytest.raises(EharError, match=r"trained in the world paper .* asked for near .*people localised with noise"):
        load_setting(told(folder, world=near))


def test_what_a_worse_localisation_costs_can_be_compared(folder: Path, run: Run, tmp_path: Path) -> None:
    benchmark(["no-act", "h-rotate"], told(folder, world="paper"), out=tmp_path / "usual", reporter=Log())
    found = compare(tmp_path / "usual", folder / "run")
    assert found.differing == {"localisation": (f"({USUALLY})", f"({WORSE})")}
    with pytest.raises(EharError, match=r"they differ in localisation \(usual, noise 0.4, delay 0.5, agility 0.5\)"):
        trainings([tmp_path / "usual", folder / "run"])


def test_what_was_trained_with_another_localisation_is_not_kept(folder: Path) -> None:
    usual, other = (
        TrainAllConfig(conditions=told(folder, models=None, world=world), out=folder / "models")
        for world in ("paper", str(folder / "worse.json"))
    )
    assert has_recogniser(usual) and has_gain_field(usual) and has_fixed_best(usual)
    assert not has_gain_field(other) and not has_fixed_best(other)
    with pytest.raises(EharError, match=r"trained with another localisation: noise .* remove it to train again"):
        has_recogniser(other)


def test_a_rehearsal_plays_people_where_it_says(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[FloatArray] = []

    def sensed(sensor: Any, positions: FloatArray, *others: Any) -> Any:
        shown.append(positions[0])
        return rehearsed(sensor, positions, *others)

    rehearsed = rehearsal.sense
    monkeypatch.setattr(rehearsal, "sense", sensed)
    watchers: list[Watcher] = []
    notes: list[str] = []

    def outputs(watcher: Watcher) -> list[Any]:
        watchers.append(watcher)
        return []

    conditions = told(folder, world="paper", track="px4-auto", length=30)
    options = {"planner": "no-act", "belief": None, "sure": 0.9, "minutes": 1 / 60, "loss": 0.0, "note": notes.append}
    found = rehearsal.rehearse(conditions, **options, outputs=outputs, world=folder / "worse.json")
    setting = load_setting(told(folder, length=30))
    data = setting.recordings
    assert isinstance(data, StreamData)
    begin = data.offsets[setting.sequences[0]]
    there = slice(begin, begin + 30)
    expected = data.positions[there] - thought_to_be(data, WORSE)[there][:, None, None]
    np.testing.assert_allclose(shown, expected, atol=1e-5)
    assert found.apart[0] <= rehearsal.EQUAL
    assert any(note.startswith(f"warning: {TOLD}") for note in notes)
    assert watchers[0].note is not None and watchers[0].note.startswith(TOLD)


def test_a_rehearsal_is_in_the_world_of_the_weights(tmp_path: Path) -> None:
    world = World("worse", PAPER.workspace, PAPER.camera, PAPER.start_cells, localisation=WORSE)
    there = save_live_world(tmp_path, world=world)
    notes: list[str] = []
    options = {"planner": "no-act", "belief": None, "sure": 0.9, "minutes": 0.2 / 60, "loss": 0.0, "note": notes.append}
    rehearsal.rehearse(told(there, world="paper", track="px4-auto", length=6), **options, outputs=lambda _: [])
    assert not any("localised" in note for note in notes)


def test_a_live_loop_follows_places_as_well_as_they_are_told(folder: Path) -> None:
    """Of one who begins to walk, a filter that expects noise is told less by each place."""
    centres = {}
    for name, world in (("usual", None), ("worse", folder / "worse.json")):
        watcher = Watcher(models=folder / "models", sensor="perfect", planner="no-act", world=world)
        for number in range(60):
            watcher.see(frame(number / 30, person(), origin=[number / 30, 0.0, 0.0]))
            setpoint = watcher.setpoint()
        assert setpoint is not None and setpoint.centre is not None
        centres[name] = setpoint.centre.position[0]
    assert centres["worse"] < centres["usual"] - 0.02
    setpoints = [
        Setpoints(vehicle=VEHICLES["px4-auto"], workspace=Workspace(), frame_time=1 / 30, localisation=localisation)
        for localisation in (Localisation(), Localisation(delay=3.0))
    ]
    for flight in setpoints:
        assert flight.begin(START)
    followed = [[flight.follow((number / 30, 0.0, 0.0), number / 30) for number in range(9)] for flight in setpoints]
    assert followed[0] == followed[1], "live, the delay is the real one"


def test_a_live_world_is_that_of_the_weights_but_for_its_localisation(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(EharError, match=r"models: trained in the world paper .* asked for indoor"):
        Watcher(models=folder / "models", sensor="perfect", world="indoor")
    with pytest.raises(EharError, match="world room, which has obstacles: nobody tells a live loop where they are"):
        Watcher(models=folder / "models", sensor="perfect", world="room")


def test_clips_have_no_localisation(tmp_path: Path) -> None:
    save_random_world(tmp_path, CLIP)
    worse = replace(PAPER, name="worse", localisation=WORSE)
    one, other = (
        benchmark(["no-act"], tiny_conditions(tmp_path, length=CLIP, world=world), reporter=Log())
        for world in (PAPER, worse)
    )
    np.testing.assert_array_equal(one.records["no-act"].true_probability, other.records["no-act"].true_probability)
    assert other.config.warnings == ()
    clips = windows(load_setting(tiny_conditions(tmp_path, length=CLIP)).data, np.arange(3), CLIP, CLIP)
    assert localised(clips, worse) is clips


def test_a_localisation_that_cannot_be_ends_in_one_line(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bad.json").write_text(json.dumps(SPACE | {"localisation": {"delay": -1}}), encoding="utf-8")
    options = ["--data", str(folder / "raising.npz"), "--models", str(folder / "models"), "--length", str(LENGTH)]
    line = fails_with(["benchmark", "no-act", *options, "--world", str(tmp_path / "bad.json")], capsys)
    assert "bad.json: localisation.delay: expected at least 0, got -1" in line
