"""Loads conditions: the motion, the recogniser, the sensor and the track that they name, ready to run."""

from dataclasses import dataclass, replace

from ehar.arrays import IntArray
from ehar.conditions import Conditions
from ehar.data.motion_data import MotionData
from ehar.data.scenario import part_of
from ehar.runner import Runner
from ehar.track import load_track
from recognition.own_recogniser import resolve_recogniser


@dataclass(frozen=True, eq=False)
class Setting:
    """The setting in which planners are compared.

    Args:
        conditions: the conditions asked for, with names in place of objects, as in records.
        runner: runs planners in this setting.
        recogniser_sha256: hash of the recogniser's weights; for your own recogniser, of its file and arguments.
        form: form of the recogniser; for your own recogniser, its name in tables.
    """

    conditions: Conditions
    runner: Runner
    recogniser_sha256: str
    form: str

    @property
    def data(self) -> MotionData:
        """The motion."""
        return self.runner.data

    @property
    def sequences(self) -> IntArray:
        """The sequences of the part that was asked for."""
        return part_of(self.data, self.conditions.part)


def load_motion_of(conditions: Conditions) -> MotionData:
    """Load the motion that conditions name or hold, at their frame rate.

    Raises:
        EharError: it is unknown, missing or malformed.
    """
    from ehar.data.source import load_data  # here: it loads scipy, and `ehar --help` does not wait for that

    given = conditions.data
    if isinstance(given, MotionData):
        return given if conditions.fps is None else given.resampled(conditions.fps)
    return load_data(given, fps=conditions.fps)


def load_setting(conditions: Conditions, *, device: str = "cpu") -> Setting:
    """Load data, recogniser, sensor and track.

    Args:
        conditions: names of these four, or the objects themselves.
        device: a torch device for our recogniser.

    Raises:
        EharError: one of them is unknown, missing or malformed, or they do not fit each other.
    """
    # Imported here: they load torch, and `ehar --help` does not wait for that.
    from ehar.sensors.registry import make_sensor
    from recognition.storage import load_recogniser

    track = load_track(conditions.track)
    data = load_motion_of(conditions)
    sensor = make_sensor(conditions.sensor, data.skeleton)
    named = replace(
        conditions,
        data=data.name if isinstance(conditions.data, MotionData) else str(conditions.data),
        models=None if conditions.models is None else str(conditions.models),
        sensor=sensor.name,
        track=track.name,
    )
    if conditions.recogniser is not None:
        own = resolve_recogniser(conditions.recogniser, data)
        runner = Runner(data, own.recogniser, sensor, track)
        return Setting(replace(named, recogniser=own.spec), runner, own.sha256, own.title)
    trained = load_recogniser(conditions, data, device=device)
    return Setting(named, Runner(data, trained, sensor, track), trained.sha256, conditions.form)
