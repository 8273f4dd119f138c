"""Conditions, loaded: by name or as objects they give the same, and what is wrong ends in one line."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.conditions import Conditions
from ehar.data.motion_file import load_motion
from ehar.data.scenario import PARTS, part_of
from ehar.errors import DataError, EharError, ModelError, UsageError
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion
from ehar.sensors.estimator import EstimatorSensor
from ehar.sensors.perfect import PerfectSensor
from ehar.world import PAPER
from eval.records.config import run_config
from recognition.own_recogniser import resolve_recogniser
from recognition.setting import ELSEWHERE, OTHER_SENSOR, Setting, load_motion_of, load_setting
from recognition.streaming import StreamingRecogniser
from tests.helpers.fakes import CLASS_NAMES, SKELETON, FakeRecogniser, tiny_data
from tests.helpers.own_recogniser import OWN
from tests.helpers.random_networks import save_random_world
from tests.helpers.settings import tiny_conditions
from tests.helpers.streams import raising_streams
from tests.helpers.tiny_benchmarks import HashedRecogniser

LENGTH = 8


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("setting")
    save_random_world(folder, LENGTH)
    return folder


def load(folder: Path, **told: Any) -> Setting:
    return load_setting(tiny_conditions(folder, length=LENGTH, **told))


def refusal(error: type[EharError], folder: Path, **told: Any) -> str:
    with pytest.raises(error) as caught:
        load(folder, **told)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_what_names_mean(folder: Path) -> None:
    setting = load(folder, track="px4-auto", part="policy")
    runner = setting.runner
    assert isinstance(runner.recogniser, StreamingRecogniser)
    assert isinstance(runner.sensor, PerfectSensor)
    assert runner.track.vehicle == VEHICLES["px4-auto"]
    assert setting.data is runner.data
    assert setting.data.sha256 == load_motion(folder / "tiny.npz").sha256
    assert setting.form == "causal"
    assert setting.recogniser_sha256 == runner.recogniser.sha256
    assert setting.conditions == tiny_conditions(folder, length=LENGTH, track="px4-auto", part="policy")


def test_the_estimator_is_on_the_recogniser_s_device(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("recognition.setting.check_device", lambda device: None)
    monkeypatch.setattr("recognition.storage.load_recogniser", lambda *_, device: HashedRecogniser())
    for device, expected in (("cpu", None), ("cuda:1", "cuda:1")):
        conditions = tiny_conditions(folder, length=LENGTH, sensor="estimator")
        sensor = load_setting(conditions, device=device).runner.sensor
        assert isinstance(sensor, EstimatorSensor)
        assert sensor.device == expected


def test_a_recogniser_of_other_data_is_told_of(folder: Path, tmp_path: Path) -> None:
    # The people of another fold's test part are among those that this recogniser learned from.
    copied = tmp_path / "models"
    shutil.copytree(folder / "models", copied)
    sha256 = load_motion(folder / "tiny.npz").sha256
    for written, elsewhere in ((sha256, False), ("f" * 64, True)):
        for file in copied.glob("*.json"):
            held = json.loads(file.read_text())
            held["training"]["run"]["data_sha256"] = written
            file.write_text(json.dumps(held))
        setting = load(folder, models=copied)
        assert setting.trained_elsewhere == elsewhere
        assert (ELSEWHERE in setting.notes) == (ELSEWHERE in run_config(setting).warnings) == elsewhere
        assert run_config(setting).to_json().get("trained_elsewhere", False) == elsewhere
    assert not load(folder).trained_elsewhere  # its files do not say what it learned from


def test_a_recogniser_of_another_version_of_your_own_sensor_is_told_of(folder: Path, tmp_path: Path) -> None:
    sensor = tmp_path / "mine.py"
    sensor.write_text("from ehar.sensors import PerfectSensor\nclass Mine(PerfectSensor):\n    name = 'mine'\n")
    copied = tmp_path / "models"
    shutil.copytree(folder / "models", copied)
    for file in copied.glob("*"):
        file.rename(file.with_name(file.name.replace("-perfect-", "-Mine-")))
    told = {"models": copied, "sensor": f"{sensor}:Mine"}
    (file,) = copied.glob("causal-*.json")
    held = json.loads(file.read_text())
    held["training"]["run"]["sensor_sha256"] = load(folder, **told).sensor_sha256
    file.write_text(json.dumps(held))
    for changed in (False, True):
        setting = load(folder, **told)
        assert setting.sensor_changed == changed
        assert (OTHER_SENSOR in setting.notes) == (OTHER_SENSOR in run_config(setting).warnings) == changed
        assert run_config(setting).to_json().get("sensor_changed", False) == changed
        sensor.write_text(sensor.read_text() + "\n    def fingerprint(self):\n        return b'another one'\n")


def test_objects_give_what_their_names_do_and_are_recorded_by_name(folder: Path) -> None:
    named = load(folder)
    given = load(folder, data=load_motion(folder / "tiny.npz"), sensor=PerfectSensor(), track=GridMotion())
    assert given.data.sha256 == named.data.sha256
    assert given.recogniser_sha256 == named.recogniser_sha256
    told = given.conditions
    assert (told.data, told.sensor, told.track) == ("tiny", "perfect", "GridMotion")
    assert load(folder, track=VEHICLES["px4-max"]).conditions.track == "px4-max"
    kinds = Conditions.named_types()
    assert all(isinstance(getattr(told, name), str) for name, kind in kinds.items() if kind is str)


@pytest.mark.parametrize("kind", [str, Path])
def test_paths_are_text_or_paths(folder: Path, kind: type) -> None:
    setting = load(folder, data=kind(folder / "tiny.npz"), models=kind(folder / "models"))
    assert setting.conditions.data == str(folder / "tiny.npz")
    assert setting.conditions.models == str(folder / "models")
    assert isinstance(setting.conditions.models, str)


@pytest.mark.parametrize("part", PARTS)
def test_the_sequences_are_those_of_the_part(folder: Path, part: str) -> None:
    setting = load(folder, part=part)
    assert len(setting.sequences) > 0
    np.testing.assert_array_equal(setting.sequences, part_of(setting.data, part))


@pytest.mark.parametrize("given", ["object", "file"])
def test_motion_is_resampled_whether_named_or_given(folder: Path, given: str) -> None:
    data: Any = folder / "tiny.npz" if given == "file" else load_motion(folder / "tiny.npz")
    assert load_motion_of(Conditions(data=data)).fps == 25
    half = load_motion_of(Conditions(data=data, fps=12.5))
    assert half.fps == 12.5
    np.testing.assert_array_equal(half.positions, load_motion(folder / "tiny.npz").resampled(12.5).positions)
    for wrong in (0.0, -1.0, float("nan")):
        with pytest.raises(UsageError, match="fps: "):
            load_motion_of(Conditions(data=data, fps=wrong))


def test_a_recogniser_of_a_user_s_own_knows_no_activity_in_streams(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(OWN)
    streams = raising_streams()
    made = resolve_recogniser(f"{path}:Mine(gain=2)", streams, PAPER).made
    assert tuple(made.class_names) == streams.recognised_names
    with pytest.raises(ModelError, match="class_names: expected those of"):
        resolve_recogniser(FakeRecogniser(), streams, PAPER)


def test_a_recogniser_of_a_user_s_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(OWN)
    named = f"{path}:Mine(gain=2)"
    data = tiny_data(sequences=24)
    setting = load_setting(Conditions(data=data, recogniser=named))
    expected = resolve_recogniser(named, data, PAPER)
    assert (setting.form, setting.recogniser_sha256) == ("Mine(gain=2)", expected.sha256)
    assert setting.conditions.recogniser == named
    assert setting.runner.recogniser.class_names == CLASS_NAMES
    own = FakeRecogniser()
    given = load_setting(Conditions(data=data, recogniser=own))  # type: ignore[arg-type]
    assert given.runner.recogniser is own
    assert given.form == "FakeRecogniser"
    assert given.conditions.recogniser == "tests.helpers.fakes.FakeRecogniser"


def test_a_sensor_s_weights_are_another_recogniser(folder: Path) -> None:
    for sensor in ("estimator", EstimatorSensor(skeleton=SKELETON)):
        assert "causal-estimator-moving" in refusal(ModelError, folder, sensor=sensor)


def test_what_is_unknown_or_missing(folder: Path, tmp_path: Path) -> None:
    assert refusal(UsageError, folder, track="kite").startswith("unknown track 'kite'; expected ideal, px4-auto, ")
    assert refusal(UsageError, folder, sensor="radar").startswith("unknown sensor 'radar'; expected one of: perfect, ")
    assert refusal(UsageError, folder, data="trio").startswith("unknown data 'trio'")
    assert "absent.npz" in refusal(DataError, folder, data=tmp_path / "absent.npz")
    assert "no such file" in refusal(ModelError, folder, models=tmp_path)
    assert "no weights are shipped for 'tiny'" in refusal(ModelError, folder, models=None)
    assert refusal(UsageError, folder, recogniser="mine").startswith("unknown recogniser 'mine'; expected path/to/")
    other = replace(tiny_data(sequences=24), class_names=("nod", "left", "wave"))
    assert "class_names do not fit tiny" in refusal(ModelError, folder, data=other)
    assert "class_names: expected those of tiny" in refusal(ModelError, folder, data=other, recogniser=FakeRecogniser())


def test_a_track_that_is_none_is_said_before_data_are_loaded(folder: Path) -> None:
    assert "unknown track" in refusal(UsageError, folder, track="kite", data="absent.npz", models=None)
