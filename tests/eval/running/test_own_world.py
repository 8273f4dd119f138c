"""A user's own sensor, motion and recogniser through the benchmark and the trainings, here and in workers."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.conditions import Conditions
from ehar.data.motion_file import save_motion
from ehar.data.scenario import split_parts, windows
from ehar.errors import ModelError, UsageError
from ehar.processes import Processes
from eval import benchmark
from eval.records.config import KEYS, NEW, read_config
from eval.running.run import read_run
from eval.running.training import train_agents, train_fixed_best, train_gain_field, train_recogniser
from planners.agents.demonstrations import DemonstrationTask, demonstrate
from planners.place.config import FixedBestConfig
from planners.value.body_filter import trunk_pairs
from planners.value.collection import CollectionTask, run_batches
from planners.value.config import GainTrainingConfig
from recognition.setting import load_setting
from recognition.training import material
from recognition.training.config import TrainingConfig
from tests.helpers.agent_trainings import TinyTraining
from tests.helpers.commands import fails_with
from tests.helpers.fakes import FakeRecogniser, tiny_data
from tests.helpers.own_recogniser import OWN as RECOGNISER
from tests.helpers.own_world import OWN
from tests.helpers.small_trainings import small_trainings
from tests.helpers.tiny_benchmarks import Log, names

pytestmark = pytest.mark.usefixtures("own_modules")
LEARNED = "il, ppo, il-ppo, dagger"


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the present folder, with data, sensors and motions in one file, and recognisers in another."""
    (tmp_path / "world.py").write_text(OWN)
    (tmp_path / "mine.py").write_text(RECOGNISER)
    save_motion(tmp_path / "tiny.npz", tiny_data(sequences=40))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def told(**options: Any) -> Conditions:
    return Conditions(**{"data": "tiny.npz", "length": 10, "recogniser": "mine.py:Mine", **options})


def episodes(run: str) -> bytes:
    return (Path(run) / "episodes.jsonl").read_bytes()


@pytest.mark.slow
def test_two_workers_run_a_sensor_and_a_motion_as_one_does(lab: Path) -> None:
    conditions = told(starts=2, sensor="world.py:Blurred(pixels=20)", track="world.py:Slow")
    for workers in (1, 2):
        benchmark(["no-act", "towards", "oracle"], conditions, workers=workers, out=f"run-{workers}", reporter=Log())
    assert episodes("run-1") == episodes("run-2")
    held = json.loads((lab / "run-1" / "config.json").read_text())
    assert tuple(held) == tuple(name for name in KEYS if name not in NEW)
    assert None not in (held["sensor_sha256"], held["track_sha256"])
    assert (held["sensor"], held["track"]) == ("world.py:Blurred(pixels=20)", "world.py:Slow")
    assert json.loads(json.dumps(read_config(Path("run-1")).to_json())) == held
    assert read_run("run-1").flown
    benchmark(["no-act"], told(sensor="world.py:Blurred(pixels=20)"), out="other", reporter=Log())
    other = json.loads((lab / "other" / "config.json").read_text())
    assert other["sensor_sha256"] == held["sensor_sha256"]
    assert other["track_sha256"] is None


def test_objects_do_what_their_classes_do(lab: Path) -> None:
    from ehar.plugins.class_spec import ClassSpec
    from ehar.plugins.loading import load_class

    sensor, motion = (load_class(ClassSpec("world.py", name), "class")() for name in ("Blurred", "Slow"))
    benchmark(["towards"], told(sensor="world.py:Blurred", track="world.py:Slow"), out="named", reporter=Log())
    run = benchmark(["towards"], told(sensor=sensor, track=motion), out="objects", reporter=Log())
    assert episodes("named") == episodes("objects")
    assert (run.conditions.sensor, run.conditions.track) == ("blurred joints", "Slow")
    assert None not in (run.config.sensor_sha256, run.config.track_sha256)


def test_flights_of_an_own_motion_are_recorded(lab: Path) -> None:
    flown = benchmark(["towards"], told(track="world.py:Drone"), reporter=Log())
    vehicle = benchmark(["towards"], told(track="px4-auto"), reporter=Log())
    flight, expected = flown.records["towards"].flight, vehicle.records["towards"].flight
    assert flight is not None
    assert expected is not None
    assert flight.peak_speed.max() == pytest.approx(expected.peak_speed.max())
    assert flown.config.vehicle == vehicle.config.vehicle
    assert benchmark(["towards"], told(track="world.py:Slow"), reporter=Log()).records["towards"].flight is None


@pytest.mark.parametrize(
    ("option", "message"),
    [
        (["--sensor", "world.py:Blind"], "sensor world.py:Blind: expected what ehar.sensors.sensor.Sensor has"),
        (["--sensor", "world.py:Broken"], "sensor world.py:Broken: its constructor raised RuntimeError: no lens"),
        (["--sensor", "world.py:Nobody"], "sensor file world.py: expected a class 'Nobody', it defines: "),
        (["--sensor", "world.py:Narrow"], "sensor Narrow, frame 0: expected finite confidence of shape (32, 1, 6)"),
        (["--sensor", "world.py:Endless"], "sensor Endless, frame 0: expected finite joints_2d"),
        (["--sensor", "world.py:Raising"], "sensor Raising, frame 0: RuntimeError: no light ("),
        (
            ["--track", "world.py:Still"],
            "motion world.py:Still: expected what ehar.motion.Motion has, missing: advance",
        ),
        (["--track", "world.py:Slow", "--every", "often"], "motion world.py:Slow: every: expected int, got 'often'"),
        (["--track", "world.py:Stalling"], "motion Stalling, frame 0: RuntimeError: no power ("),
        (["--track", "world.py:Flat"], "motion Flat, frame 0: viewpoints: expected finite numbers of shape (32, 3)"),
    ],
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_what_is_wrong_ends_in_one_line(
    lab: Path, capsys: pytest.CaptureFixture[str], option: list[str], message: str
) -> None:
    words = ["benchmark", "no-act", "--data", "tiny.npz", "--length", "10", "--recogniser", "mine.py:Mine"]
    assert fails_with([*words, "--workers", "1", *option], capsys).removeprefix("ehar: error: ").startswith(message)


def test_what_cannot_be_sent_to_a_worker_is_said(lab: Path) -> None:
    recogniser = FakeRecogniser(quality=(value for value in ()))  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=r"^the recogniser, the sensor or the motion cannot be sent to a worker"):
        benchmark(["no-act", "random"], told(recogniser=recogniser), workers=2, reporter=Log())


@pytest.mark.slow
def test_a_recogniser_is_trained_to_see_through_an_own_sensor(lab: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(material, "VALIDATION_CLIPS", 24)
    conditions = told(sensor="world.py:Blurred(pixels=8)", recogniser=None)
    config = TrainingConfig(conditions=conditions, out=Path("models"), clips=64)
    (path,) = train_recogniser(config).paths
    assert path.stem == f"causal-{conditions.seen}"
    trained = told(sensor="world.py:Blurred(pixels='8')", recogniser=None, models="models")
    run = benchmark(["no-act"], trained, reporter=Log())
    assert run.config.sensor_sha256 is not None
    with pytest.raises(
        ModelError,
        match=r"as made by `ehar train recogniser --data tiny.npz --sensor world.py:Blurred --views m",
    ):
        benchmark(["no-act"], told(sensor="world.py:Blurred", recogniser=None, models="models"), reporter=Log())


@pytest.mark.slow
def test_gain_field_and_agents_are_trained_for_an_own_recogniser(lab: Path) -> None:
    conditions = told(models="models", length=8)
    log = Log()
    benchmark(None, conditions, reporter=log)
    missing = (
        "`ehar train agent --data tiny.npz --sensor perfect --views moving --length 8 --recogniser mine.py:Mine "
        "--models models`"
    )
    assert log.notes[-1] == (
        f"left out: {LEARNED}: no agent was trained for this recogniser: expected those of {missing}"
    )
    with small_trainings():
        train_gain_field(GainTrainingConfig(conditions=conditions, batches=2, workers=1))
        train_fixed_best(FixedBestConfig(conditions=conditions, workers=1))
        train_agents(TinyTraining(conditions=conditions, stages="il,ppo", episodes=8, variations=0, workers=1))
    log = Log()
    run = benchmark(None, conditions, reporter=log)
    ran = {name.partition("/")[0] for name in names(run.summary)}
    assert {"fixed-best", "nbv", "nbv-greedy", "nbv-search", "il", "ppo"} <= ran
    assert log.notes[0].startswith("left out: il-ppo, dagger: no agent was trained for this recogniser: expected ")
    other = told(models="models", length=8, recogniser="mine.py:Mine(gain=2)")
    log = Log()
    run = benchmark(None, other, reporter=log)
    assert not {"fixed-best", "nbv", "il", "ppo"} & set(names(run.summary))
    assert "fixed-best-perfect-moving.json: trained for another recogniser: its sha256 was " in log.notes[0]
    assert "gain-field-perfect-moving.safetensors: trained for another recogniser: its sha256 was " in log.notes[1]
    with pytest.raises(ModelError, match="trained for another recogniser"):
        benchmark(["nbv"], other, reporter=Log())
    with pytest.raises(UsageError, match=r"trained for another recogniser.*: remove it, or choose another --out$"):
        train_gain_field(GainTrainingConfig(conditions=other, batches=1, workers=1))
    with pytest.raises(UsageError, match=r"trained for another recogniser.*: remove it, or choose another --out$"):
        train_fixed_best(FixedBestConfig(conditions=other, workers=1))


@pytest.mark.slow
def test_two_workers_roll_out_for_trainings_as_one_does(lab: Path) -> None:
    setting = load_setting(told(length=8, sensor="world.py:Blurred"))
    sequences = split_parts(setting.data).policy
    collected = CollectionTask(setting.runner, sequences, 8, trunk_pairs(setting.data, sequences), seed=0)
    demonstrated = DemonstrationTask(setting.runner, windows(setting.data, sequences, 8, 1), "oracle", None, (0,))
    for roll, task in ((run_batches, collected), (demonstrate, demonstrated)):
        one, two = (dict(roll(task, [0, 1], engine=Processes(workers))) for workers in (1, 2))  # type: ignore[operator]
        for batch in (0, 1):
            for name, values in vars(one[batch]).items():
                np.testing.assert_array_equal(values, getattr(two[batch], name))


def test_without_a_folder_nothing_was_trained_for_an_own_recogniser(lab: Path) -> None:
    log = Log()
    run = benchmark(None, told(), reporter=log)
    assert not {"fixed-best", "nbv", "il"} & set(names(run.summary))
    trained = "--data tiny.npz --sensor perfect --views moving --length 10 --recogniser mine.py:Mine --models DIR`"
    assert log.notes == [
        "left out: fixed-best: no fixed place was fitted for this recogniser: expected that of "
        f"`ehar train fixed-best {trained}",
        "left out: nbv-greedy, nbv-search, nbv: no gain field was trained for this recogniser: expected that of "
        f"`ehar train gain-field {trained}",
        f"left out: {LEARNED}: no agent was trained for this recogniser: expected those of `ehar train agent {trained}",
    ]
    with pytest.raises(ModelError, match=r"^no gain field was trained for this recogniser: expected that of "):
        benchmark(["nbv"], told(), reporter=Log())
