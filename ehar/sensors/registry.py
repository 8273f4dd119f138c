"""The sensors: those of ehar by name, and a user's own."""

import inspect
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ehar.camera import Camera
from ehar.data.recordings import Recordings
from ehar.errors import UsageError
from ehar.plugins.class_spec import FORMS, parse_spec
from ehar.plugins.own_class import HANDED, Contract, bring
from ehar.sensors.estimator import EstimatorSensor
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.sensor import Sensor
from ehar.world import PAPER, World

SENSORS: dict[str, Callable[[Recordings, Camera], Sensor]] = {
    "perfect": lambda data, camera: PerfectSensor(camera=camera),
    "estimator": lambda data, camera: EstimatorSensor(skeleton=data.skeleton, camera=camera),
}
CONTRACT = Contract("sensor", Sensor, ("sense",), ("name", "camera"))


@dataclass(frozen=True, eq=False)
class LoadedSensor:
    """A sensor, with its name and hash for records.

    Args:
        sensor: the sensor.
        named: the text that named it; for an object, its `name`.
        sha256: hash of the file and arguments of your own sensor; None for a sensor of ehar by name.
    """

    sensor: Sensor
    named: str
    sha256: str | None = None


def make_sensor(sensor: str | Sensor, data: Recordings, world: World = PAPER) -> Sensor:
    """Return the sensor that a name or an object means; arguments and errors are as in `load_sensor`."""
    return load_sensor(sensor, data, world).sensor


def load_sensor(sensor: str | Sensor, data: Recordings, world: World, *, device: str | None = None) -> LoadedSensor:
    """Return the sensor that a name or an object means, with its name and hash for records.

    A constructor with arguments called `class_names`, `skeleton`, `persons` or `fps` is handed those of the data, one
    with an argument called `camera` the world's.

    Args:
        sensor: one of `SENSORS`; `path/to/file.py:Class` or `package.module:Class`, with or without
            `(argument=value, ...)`; or an object.
        data: the data whose joints it will see.
        world: the world whose camera it has.
        device: a torch device on which the estimator computes; None means NumPy, as it does for all other sensors.

    Raises:
        UsageError: the name is unknown, or your own class cannot be made, is no sensor, has another camera, or cannot
            be told what obstacles hide, in a world that has some.
    """
    if isinstance(sensor, str):
        if sensor in SENSORS:
            made = SENSORS[sensor](data, world.camera)
            if isinstance(made, EstimatorSensor):
                made.device = device
            return LoadedSensor(made, sensor)
        spec = parse_spec(sensor)
        if spec is None or not spec.place:
            raise UsageError(f"unknown sensor {sensor!r}; expected one of: {', '.join(SENSORS)}, or {FORMS}")
    own = bring(sensor, CONTRACT, {name: getattr(data, name) for name in HANDED} | {"camera": world.camera})
    name: Any = own.made.name
    if not _is_name(name):
        raise UsageError(f"{own.what}: name: expected words of letters, digits, '.', '+', '-' and '_', got {name!r}")
    if not isinstance(own.made.camera, Camera):
        raise UsageError(f"{own.what}: camera: expected an ehar.camera.Camera, got {type(own.made.camera).__name__}")
    if own.made.camera != world.camera:  # the recogniser reads pixels as the world's camera takes them
        raise UsageError(
            f"{own.what}: camera: expected that of the world {world.name}, {world.camera}, got {own.made.camera}; "
            "a constructor with an argument `camera` is handed it, or a world file can name another"
        )
    if not world.is_open and "hidden" not in inspect.signature(own.made.sense).parameters:
        raise UsageError(
            f"{own.what}: sense: expected an argument `hidden`, the joints that are hidden in the world {world.name}"
        )
    return LoadedSensor(own.made, own.spec if isinstance(sensor, str) else name, own.sha256)


def _is_name(name: Any) -> bool:
    """Return whether a name is allowed: words that can be part of a file name, and no name of a class in a file."""
    return isinstance(name, str) and re.fullmatch(r"[\w.+-]+( [\w.+-]+)*", name) is not None
