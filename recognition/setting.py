"""Loads conditions: the motion, the recogniser, the sensor and the track that they name, ready to run."""

from dataclasses import dataclass, field, replace

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
        conditions: the conditions, with names in place of objects, as in records.
        runner: runs planners in this setting.
        recogniser_sha256: hash of the recogniser's weights; for your own recogniser, of its file and arguments.
        form: form of the recogniser; for your own, its name in tables.
        sensor_sha256: hash of the file and arguments of your own sensor; None for a sensor of ehar.
    """

    conditions: Conditions
    runner: Runner = field(repr=False)
    recogniser_sha256: str
    form: str
    sensor_sha256: str | None = None

    @property
    def track_sha256(self) -> str | None:
        """The hash of the file and arguments of your own motion; None for a track of ehar."""
        return self.runner.track.sha256

    @property
    def data(self) -> MotionData:
        """The motion."""
        return self.runner.data

    @property
    def sequences(self) -> IntArray:
        """The sequences of the part that the conditions name."""
        return part_of(self.data, self.conditions.part)


def load_motion_of(conditions: Conditions) -> MotionData:
    """Load the motion that conditions name or hold, at their frame rate.

    Raises:
        EharError: the motion is unknown, missing or malformed.
    """
    from ehar.data.source import load_data  # imported here: too slow for `ehar --help`

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
    # Imported here: they bring torch, too slow for `ehar --help`.
    from ehar.sensors.registry import load_sensor
    from recognition.storage import load_recogniser

    track = load_track(conditions.track)
    data = load_motion_of(conditions)
    loaded = load_sensor(conditions.sensor, data)
    named = replace(
        conditions,
        data=data.name if isinstance(conditions.data, MotionData) else str(conditions.data),
        models=None if conditions.models is None else str(conditions.models),
        sensor=loaded.named,
        track=track.named,
    )
    if conditions.recogniser is not None:
        own = resolve_recogniser(conditions.recogniser, data)
        runner = Runner(data, own.made, loaded.sensor, track)
        return Setting(replace(named, recogniser=own.spec), runner, own.sha256, own.title, loaded.sha256)
    trained = load_recogniser(conditions, data, device=device)
    runner = Runner(data, trained, loaded.sensor, track)
    return Setting(named, runner, trained.sha256, conditions.form, loaded.sha256)
