"""The conformance kit of sensors finds what is wrong, and nothing where nothing is."""

import sys
import threading
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.conditions import Conditions
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.sensor import Sensed, Sensor, SensorNoise
from eval import check_sensor
from eval.conformance.checks import Conformance
from tests.helpers.fakes import tiny_data

CONDITIONS = Conditions(data=tiny_data(persons=2))


def checked(sensor: Sensor | str) -> Conformance:
    return check_sensor(sensor, CONDITIONS)


class Mine(PerfectSensor):
    """Does as the perfect one does; those below break one thing each."""

    name = "mine"

    def sense(self, positions: FloatArray, viewpoint: FloatArray, noise: SensorNoise) -> Sensed:
        return self.changed(super().sense(positions, viewpoint, noise), noise)

    def changed(self, seen: Sensed, noise: SensorNoise) -> Sensed:
        return seen


class Squeezed(Mine):
    def changed(self, seen: Sensed, noise: SensorNoise) -> Sensed:
        return Sensed(seen.joints_2d.squeeze(0) if len(seen.joints_2d) == 1 else seen.joints_2d, seen.confidence)


class Sure(Mine):
    def changed(self, seen: Sensed, noise: SensorNoise) -> Sensed:
        return seen._replace(confidence=2 * seen.confidence)


class Random(Mine):
    def __init__(self) -> None:
        super().__init__()
        self.rng = np.random.default_rng(0)

    def changed(self, seen: Sensed, noise: SensorNoise) -> Sensed:
        return seen._replace(joints_2d=seen.joints_2d + self.rng.standard_normal(seen.joints_2d.shape))


class Centred(Mine):
    def changed(self, seen: Sensed, noise: SensorNoise) -> Sensed:
        return seen._replace(joints_2d=seen.joints_2d - seen.joints_2d.mean(axis=0))


class Smoothed(Mine):
    """Looks ahead where it is shown a clip."""

    def changed(self, seen: Sensed, noise: SensorNoise) -> Sensed:
        if seen.joints_2d.ndim < 5:
            return seen
        return seen._replace(joints_2d=seen.joints_2d + seen.joints_2d.mean(axis=1, keepdims=True))


class Tape(Mine):
    """Looks ahead where it is shown a frame: it reads the clip that the frame is from."""

    def sense(self, positions: FloatArray, viewpoint: FloatArray, noise: SensorNoise) -> Sensed:
        seen = super().sense(positions, viewpoint, noise)
        frame = sys._getframe()
        while frame is not None and not hasattr(frame.f_locals.get("shown"), "positions"):
            frame = frame.f_back
        clip = None if frame is None or frame.f_back is None else frame.f_back.f_locals.get("shown")
        if clip is None or clip.positions.ndim != 5 or seen.joints_2d.ndim != 4:
            return seen
        ahead = 100 * clip.positions[:, -1, ..., :2].astype(seen.joints_2d.dtype)
        return seen._replace(joints_2d=seen.joints_2d + ahead)


class Forkless(Mine):
    def changed(self, seen: Sensed, noise: SensorNoise) -> Sensed:
        if noise.swap.shape[:-1] != seen.confidence.shape[:-2]:
            raise ValueError("shapes")
        return seen


class Scribbling(Mine):
    def sense(self, positions: FloatArray, viewpoint: FloatArray, noise: SensorNoise) -> Sensed:
        seen = super().sense(positions, viewpoint, noise)
        noise.swap[...] = 0
        return seen


class Locked(Mine):
    def __init__(self) -> None:
        super().__init__()
        self.lock = threading.Lock()


def failed(found: Conformance) -> list[str]:
    return [check.name for check in found.failed]


@pytest.mark.parametrize("sensor", [Mine(), "perfect", "estimator"])
def test_nothing_is_wrong(sensor: Any) -> None:
    found = checked(sensor)
    assert found.passed, str(found)
    assert len(found.checks) == 10
    assert all(check.passed for check in found.checks)


@pytest.mark.parametrize(
    ("sensor", "names"),
    [
        (Squeezed(), ["senses a batch of 1", "rows alone, and in another order, are sensed the same"]),
        (Locked(), ["can be sent to a worker process"]),
        (Scribbling(), ["leaves what it is shown as it is"]),
        (Forkless(), ["leading axes broadcast: 3 viewpoints of one frame"]),
    ],
)
def test_one_thing_is_wrong(sensor: Sensor, names: list[str]) -> None:
    assert failed(checked(sensor)) == names


def test_a_confidence_above_1_is_found() -> None:
    found = checked(Sure())
    assert failed(found) == [found.checks[0].name]
    assert "expected confidence from 0 to 1, got" in found.checks[0].got


def test_a_generator_of_its_own_is_found() -> None:
    assert "does the same twice with the same noise" in failed(checked(Random()))


def test_a_mean_over_rows_is_found() -> None:
    assert "rows alone, and in another order, are sensed the same" in failed(checked(Centred()))


def test_a_look_ahead_is_found() -> None:
    found = failed(checked(Smoothed()))
    assert {"a clip (B, T, ...) at once is sensed as its frames are", "the past does not see the future"} <= {*found}


def test_a_look_ahead_frame_by_frame_is_found() -> None:
    found = {check.name: check.got for check in checked(Tape()).failed}
    assert found["the past does not see the future"].endswith("with another future")


def test_what_does_not_run_is_not_checked_further() -> None:
    class Nothing(Mine):
        def sense(self, positions: FloatArray, viewpoint: FloatArray, noise: SensorNoise) -> Any:
            return None

    found = checked(Nothing())
    assert [check.passed for check in found.checks] == [False, None]
    assert "expected Sensed(joints_2d, confidence), got NoneType" in found.checks[0].got
