"""Loads conditions: the motion, the recogniser, the sensor and the track that they name, ready to run."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from ehar.arrays import IntArray
from ehar.conditions import Conditions
from ehar.data.motion_data import MotionData
from ehar.data.recordings import Recordings
from ehar.data.scenario import part_of
from ehar.data.streams.data import StreamData
from ehar.errors import ModelError, UsageError
from ehar.localisation import Localisation
from ehar.runner import Runner
from ehar.track import load_track
from ehar.world import World, by_name, load_world
from recognition.devices import check_device
from recognition.own_recogniser import resolve_recogniser

EPISODE = 30.0  # [s], the usual length of an episode of a stream
ELSEWHERE = (
    "the recogniser was trained on other data, so people who are watched may be among those that it learned from"
)
OTHER_SENSOR = "the recogniser was trained with another version of your own sensor: its file has changed since"


@dataclass(frozen=True, eq=False)
class Setting:
    """The setting in which planners are compared.

    Args:
        conditions: the conditions, with names in place of objects, as in records; a world that is not ehar's stays.
        runner: runs planners in this setting.
        recogniser_sha256: hash of the recogniser's weights; for your own recogniser, of its file and arguments.
        form: form of the recogniser; for your own, its name in tables.
        sensor_sha256: hash of the file and arguments of your own sensor; None for a sensor of ehar.
        trained_length: number of frames of the clips that the recogniser was trained on; None for your own.
        device: torch device of our recogniser.
        trained_open: whether the world has something in the way, and the training of our recogniser had nothing.
        trained_localisation: the localisation that our recogniser was trained with; None for your own, and in clips.
        trained_elsewhere: whether our recogniser was trained on other data, or on another version or fold of them.
        sensor_changed: whether our recogniser was trained with another version of your own sensor.
    """

    conditions: Conditions
    runner: Runner = field(repr=False)
    recogniser_sha256: str
    form: str
    sensor_sha256: str | None = None
    trained_length: int | None = None
    device: str = "cpu"
    trained_open: bool = False
    trained_localisation: Localisation | None = field(default=None, repr=False)
    trained_elsewhere: bool = field(default=False, repr=False)
    sensor_changed: bool = field(default=False, repr=False)

    @property
    def world(self) -> World:
        """The world."""
        return self.runner.world

    @property
    def length_note(self) -> str | None:
        """The line that says that the recogniser was trained at another length; None if it was not."""
        return length_note(self.conditions.frames, {"recogniser": self.trained_length})

    @property
    def notes(self) -> tuple[str, ...]:
        """The lines that say how the recogniser was trained otherwise."""
        localised = localisation_note(self.world.localisation, {"recogniser": self.trained_localisation})
        told = {ELSEWHERE: self.trained_elsewhere, OTHER_SENSOR: self.sensor_changed}
        return (*filter(None, (self.length_note, localised)), *(line for line, holds in told.items() if holds))

    @property
    def track_sha256(self) -> str | None:
        """The hash of the file and arguments of your own motion; None for a track of ehar."""
        return self.runner.track.sha256

    @property
    def recordings(self) -> MotionData | StreamData:
        """The motion, trimmed or in streams."""
        data = self.runner.data
        assert isinstance(data, MotionData | StreamData)
        return data

    @property
    def data(self) -> MotionData:
        """The motion.

        Raises:
            UsageError: it is in streams, so whoever asks cannot do with it.
        """
        data = self.recordings
        if isinstance(data, StreamData):
            raise UsageError(f"{data.name}: expected trimmed sequences, got streams")
        return data

    @property
    def sequences(self) -> IntArray:
        """The sequences of the part that the conditions name."""
        return part_of(self.recordings, self.conditions.part)


def length_note(length: int, trained: Mapping[str, int | None]) -> str | None:
    """Return a line that names the weights that were trained at another length; None if there are none.

    Args:
        length: number of frames of an episode now.
        trained: number of frames of an episode in the training of each weights, by name; None if it is not known.
    """
    other = [f"{name} at {frames}" for name, frames in trained.items() if frames not in (None, length)]
    if not other:
        return None
    return f"episodes have {length} frames, but weights were trained at another length: {', '.join(other)}"


def localisation_note(localisation: Localisation, trained: Mapping[str, Localisation | None]) -> str | None:
    """Return a line that names the weights that were trained with another localisation; None if there are none.

    Args:
        localisation: how well it is known where people are now.
        trained: the same in the training of each weights, by name; None if it has no meaning there.
    """
    others: dict[Localisation, list[str]] = {}
    for name, told in trained.items():
        if told is not None and told != localisation:
            others.setdefault(told, []).append(name)
    if not others:
        return None
    found = "; ".join(f"{', '.join(names)} with {told}" for told, names in others.items())
    return f"people are localised with {localisation}, but weights were trained with another localisation: {found}"


def with_length(conditions: Conditions, data: Recordings, seconds: float) -> Conditions:
    """Return conditions that tell a length: in streams, whose frame rate they then tell too, so many seconds."""
    if not isinstance(data, StreamData):
        return replace(conditions, length=conditions.frames)
    length = round(seconds * data.fps) if conditions.length is None else conditions.length
    return replace(conditions, fps=data.fps, length=length)


def load_motion_of(conditions: Conditions) -> MotionData:
    """Load the motion that conditions name or hold, at their frame rate.

    Raises:
        EharError: the motion is unknown, missing or malformed.
    """
    from ehar.data.source import load_data  # imported here: too slow for `ehar --help`

    given = conditions.data
    if isinstance(given, StreamData):
        raise UsageError(f"{given.name}: expected trimmed sequences, got streams")
    if isinstance(given, MotionData):
        return given if conditions.fps is None else given.resampled(conditions.fps)
    return load_data(given, fps=conditions.fps)


def load_recordings_of(conditions: Conditions) -> MotionData | StreamData:
    """Load the trimmed sequences or the streams that conditions name or hold, at their frame rate.

    Raises:
        EharError: the motion is unknown, missing or malformed.
    """
    from ehar.data.any_source import load_recordings  # imported here: too slow for `ehar --help`

    given = conditions.data
    if isinstance(given, MotionData | StreamData):
        return given if conditions.fps is None else given.resampled(conditions.fps)
    return load_recordings(given, fps=conditions.fps)


def load_setting(conditions: Conditions, *, device: str = "cpu") -> Setting:
    """Load data, recogniser, sensor, track and world.

    Args:
        conditions: names of these five, or the objects themselves.
        device: a torch device for our recogniser and our sensor.

    Raises:
        EharError: one of them is unknown, missing or malformed, or they do not fit each other.
    """
    # Imported here: they bring torch, too slow for `ehar --help`.
    from ehar.sensors.registry import load_sensor
    from recognition.storage import load_recogniser

    check_device(device)
    if conditions.recogniser is not None and device != "cpu":
        raise UsageError(f"--device {device}: expected none beside your own recogniser, which decides it itself")
    world = load_world(conditions.world)
    track = load_track(conditions.track, world.workspace)
    data = load_recordings_of(conditions)
    told, conditions = conditions, with_length(conditions, data, EPISODE)
    if conditions.onset == "known" and not isinstance(data, StreamData):
        raise UsageError(
            f"onset: expected unknown for {data.name}, whose episodes begin with their activity, got known"
        )
    loaded = load_sensor(conditions.sensor, data, world, device=None if device == "cpu" else device)
    named = replace(
        conditions,
        data=data.name if isinstance(conditions.data, MotionData | StreamData) else str(conditions.data),
        models=None if conditions.models is None else str(conditions.models),
        sensor=loaded.named,
        track=track.named,
        world=by_name(world),
    )
    if conditions.recogniser is not None:
        own = resolve_recogniser(conditions.recogniser, data, world)
        runner = Runner(data, own.made, loaded.sensor, track, world, conditions.onset)
        return Setting(replace(named, recogniser=own.spec), runner, own.sha256, own.title, loaded.sha256)
    trained = load_recogniser(told, data, device=device)  # whose errors suggest what was told
    runner = Runner(data, trained, loaded.sensor, track, world, conditions.onset)
    length = None if trained.spec.fading else trained.spec.length  # what fades is not meant for one length
    opened = not world.is_open and trained.spec.world.is_open and not trained.in_the_way
    localisation = trained.spec.world.localisation if isinstance(data, StreamData) else None
    return Setting(
        conditions=named,
        runner=runner,
        recogniser_sha256=trained.sha256,
        form=conditions.form,
        sensor_sha256=loaded.sha256,
        trained_length=length,
        device=device,
        trained_open=opened,
        trained_localisation=localisation,
        trained_elsewhere=trained.data_sha256 not in (None, data.sha256),
        sensor_changed=loaded.sha256 is not None and trained.sensor_sha256 not in (None, loaded.sha256),
    )


def refuse_told_onsets(conditions: Conditions) -> None:
    """Raise a UsageError if onsets are known: nothing is trained so, and no weights say so."""
    if conditions.onset != "unknown":
        raise UsageError(f"onset: expected unknown in a training, got {conditions.onset}")


def refuse_loss(path: Path, setting: Setting, load: Callable[[Conditions, Recordings, str], object]) -> None:
    """Raise a UsageError where what was trained for another recogniser would be lost to what is for your own.

    Args:
        path: the file that would be written.
        setting: the setting of the training.
        load: loads such a file from a folder, and raises a ModelError if it is another recogniser's.
    """
    if setting.conditions.recogniser is None or not path.is_file():
        return
    try:
        load(replace(setting.conditions, models=path.parent), setting.recordings, setting.recogniser_sha256)
    except ModelError as error:
        raise UsageError(f"{error}: remove it, or choose another --out") from error
