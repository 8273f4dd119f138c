"""The conditions of a run: data, sensor, recogniser, track, episodes and seed."""

import hashlib
import re
from dataclasses import dataclass, fields
from pathlib import Path
from shlex import quote
from typing import Any, Literal, get_args, get_type_hints

from ehar.data.motion_data import MotionData
from ehar.data.scenario import PARTS, TEST, USUAL_LENGTH
from ehar.data.streams.data import StreamData
from ehar.errors import UsageError
from ehar.flight.vehicle import Vehicle
from ehar.motion import Motion
from ehar.onsets import ONSETS, Onset
from ehar.plugins.class_spec import arguments_text, parse_spec
from ehar.recogniser import Recogniser
from ehar.sensors.sensor import Sensor
from ehar.track import IDEAL
from ehar.world import PAPER, World, by_name

Form = Literal["causal", "ctrgcn"]
FORMS: tuple[Form, ...] = get_args(Form)
USUAL_SENSOR = "usual"
MOST_STARTS, MOST_FRAMES, MOST_SEED = 10**6, 10**6, 2**63 - 1  # what is more is a slip, or no int64
REGIMES = ("moving", "paper", "recorded")  # views that a recogniser is trained on


@dataclass(frozen=True, kw_only=True, repr=False)
class Conditions:
    """The conditions of a run; every part of the run receives all of them.

    In place of a name, a field may hold your own object. The usual sensor is perfect; of the built-in streams it is the
    estimator, for which their weights ship. It is told by its own name once the conditions are made.

    Args:
        data: duo, solo, duo-stream, solo-stream, or a prepared .npz.
        models: folder of weights.
        sensor: perfect (exact joints), estimator (noise, occlusion, dropout, swaps), or your own: file.py:Class.
        track: ideal (grid moves), px4-auto, px4-max, tracking-drone, ground-robot, a vehicle file, or your own:
            file.py:Class.
        starts: start viewpoints of each scenario.
        length: frames of an episode; None means 60, of streams as many as 30 s have.
        fps: frame rate to resample to [Hz].
        seed: seed of start viewpoints, noise and random planners.
        part: part of the data: test, validation, policy or recogniser.
        views: cameras the recogniser was trained on: moving, paper, or recorded (the real ones).
        form: causal (streams) or ctrgcn (as published, on each prefix).
        recogniser: your own: file.py:Class.
        world: paper, indoor, room, crowd, or a world file (.json).
        onset: unknown; or known: in streams the recogniser is told when an activity begins, and forgets what was.

    Raises:
        UsageError: a word is unknown, or a number is too small.
    """

    data: str | Path | MotionData | StreamData = "duo"
    models: str | Path | None = None
    sensor: str | Sensor = USUAL_SENSOR
    track: str | Path | Vehicle | Motion = IDEAL
    starts: int = 1
    length: int | None = None
    fps: float | None = None
    seed: int = 0
    part: str = TEST
    views: str = "moving"
    form: Form = "causal"
    recogniser: str | Recogniser | None = None
    world: str | Path | World = PAPER.name
    onset: Onset = "unknown"

    def __post_init__(self) -> None:
        """Check words and numbers, and take the usual sensor."""
        if self.sensor == USUAL_SENSOR:
            object.__setattr__(self, "sensor", self._usual_sensor)
        for name, known in (("part", PARTS), ("views", REGIMES), ("form", FORMS), ("onset", ONSETS)):
            value = getattr(self, name)
            if value not in known:
                raise UsageError(f"unknown {name} {value!r}; expected one of: {', '.join(known)}")
        for name, least, most in (("starts", 1, MOST_STARTS), ("length", 1, MOST_FRAMES), ("seed", 0, MOST_SEED)):
            value = getattr(self, name)
            if name == "length" and value is None:
                continue
            if not isinstance(value, int) or isinstance(value, bool) or value < least:
                raise UsageError(f"{name}: expected a whole number of at least {least}, got {value!r}")
            if value > most:
                raise UsageError(f"{name}: expected a whole number of at most {most}, got {value}")
        if self.recogniser is not None and self.form != "causal":
            raise UsageError(f"form: expected none beside your own recogniser, got {self.form}")

    def __repr__(self) -> str:
        """Return the data, and the fields that differ from their defaults."""
        told = {part.name: getattr(self, part.name) for part in fields(self)} | {"world": self.world_name}
        usual = {part.name: part.default for part in fields(self)} | {"sensor": self._usual_sensor}
        shown = (f"{name}={value!r}" for name, value in told.items() if name == "data" or value != usual[name])
        return f"Conditions({', '.join(shown)})"

    @staticmethod
    def named_types() -> dict[str, Any]:
        """Return the type of each field in flags and files, which hold names in place of objects."""
        types = {}
        for name, kind in get_type_hints(Conditions).items():
            choices = get_args(kind)
            optional = type(None) in choices
            types[name] = (str | None if optional else str) if str in choices else kind
        return types

    @property
    def _usual_sensor(self) -> str:
        """The sensor that is taken if none is named."""
        from ehar.data.any_source import BUILT_IN_STREAMS  # imported here: too slow for `ehar --help`

        return "estimator" if isinstance(self.data, str) and self.data in BUILT_IN_STREAMS else "perfect"

    @property
    def frames(self) -> int:
        """L, the frames of an episode. `load_setting` tells the length of those of streams, whose rate it knows."""
        return USUAL_LENGTH if self.length is None else self.length

    @property
    def in_streams(self) -> bool:
        """Whether the data are streams; nothing of them is read."""
        from ehar.data.any_source import is_stream_source  # imported here: too slow for `ehar --help`

        if isinstance(self.data, MotionData | StreamData):
            return isinstance(self.data, StreamData)
        return is_stream_source(self.data)

    @property
    def world_name(self) -> str:
        """The name or the file of the world; for an object that is not ours, its name as a file that can be written."""
        named = by_name(self.world) if isinstance(self.world, World) else self.world
        return f"{named.name}.json" if isinstance(named, World) else str(named)

    @property
    def sensor_name(self) -> str:
        """The name of the sensor in names of weight files; for your own, its class and a hash of its arguments."""
        spec = parse_spec(self.sensor) if isinstance(self.sensor, str) else None
        if spec is None or not spec.place:
            return re.sub(r"[^\w.+-]", "-", self.sensor if isinstance(self.sensor, str) else self.sensor.name)
        arguments = arguments_text(dict(sorted(spec.arguments.items())))
        return spec.name + (f"-{hashlib.sha256(arguments.encode()).hexdigest()[:8]}" if arguments else "")

    @property
    def seen(self) -> str:
        """Sensor and views that a recogniser is trained on, as in names of weight files: perfect-moving."""
        return f"{self.sensor_name}-{self.views}"

    @property
    def flown_suffix(self) -> str:
        """The vehicle at the end of names of weight files: -px4-auto; empty on the grid."""
        if self.track == IDEAL:
            return ""
        named = str(self.track) if isinstance(self.track, str | Path) else ""
        name = named or getattr(self.track, "name", type(self.track).__name__)
        return "-" + re.sub(r"[^\w.+-]", "-", Path(name).stem if name.endswith(".json") else name)

    @property
    def data_option(self) -> str:
        """The data as an option of a command; for an object, the option names a file `X.npz` that has to be written."""
        from ehar.data.any_source import BUILT_IN_STREAMS  # imported here: too slow for `ehar --help`
        from ehar.data.source import BUILT_IN

        text = "" if isinstance(self.data, MotionData | StreamData) else str(self.data)
        known = text in BUILT_IN or text in BUILT_IN_STREAMS or Path(text).is_file()
        return f"--data {quote(text)}" if known else "--data X.npz"

    @property
    def options(self) -> str:
        """The conditions of a training as options of its command; errors suggest these."""
        sensor = self.sensor if isinstance(self.sensor, str) else self.sensor.name
        parts = [self.data_option, f"--sensor {quote(sensor)} --views {self.views}"]
        parts += [f"--world {quote(self.world_name)}"] if self.world_name != PAPER.name else []
        parts += [f"--form {self.form}"] if self.form != Conditions.form else []
        usual = None if self.in_streams else USUAL_LENGTH
        parts += [f"--length {self.length}"] if self.length not in (None, usual) else []
        parts += [f"--fps {self.fps:g}"] if self.fps is not None else []
        parts += [f"--recogniser {quote(_named(self.recogniser))}"] if self.recogniser is not None else []
        return " ".join(parts)

    @property
    def models_option(self) -> str:
        """The folder of weights as an option of a command."""
        return f"--models {'DIR' if self.models is None else quote(str(self.models))}"

    @property
    def directory(self) -> Path | None:
        """The folder of weights; None means those that ship with ehar."""
        return None if self.models is None else Path(self.models)


def _named(brought: object) -> str:
    """Return the text that named your own recogniser; for an object, its class."""
    return brought if isinstance(brought, str) else f"{type(brought).__module__}.{type(brought).__qualname__}"
