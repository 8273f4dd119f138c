"""What `ehar/Grid-v0` and `ehar/Flight-v0` make for Gymnasium: the task on motion data, with a trained recogniser."""

from pathlib import Path

from ehar.data.scenario import Scenarios, part_of, windows
from ehar.data.source import load_data
from ehar.envs.environment import FlightEnv, FlightVectorEnv, GridEnv, GridVectorEnv
from ehar.flight.vehicle import load_vehicle
from ehar.recogniser import Recogniser
from ehar.sensors.registry import make_sensor
from ehar.sensors.sensor import Sensor
from recognition.storage import load_recogniser


def grid_env(
    *,
    data: str | Path = "duo",
    fps: float | None = None,
    sensor: str = "perfect",
    views: str = "moving",
    models: str | Path | None = None,
    part: str = "policy",
    length: int = 60,
) -> GridEnv:
    """Return one environment.

    Args:
        data: a built-in name or the path of an .npz.
        fps: the frame rate to resample to [1/s]; None keeps the data's own.
        sensor: `perfect` or `estimator`.
        views: how the recogniser was trained, `paper` or `moving`.
        models: a folder of trained weights; None takes those that come with the package.
        part: which scenarios: `recogniser`, `policy`, `validation` or `test`.
        length: L, frames in an episode.

    Raises:
        EharError: anything of it is unknown, missing or malformed.
    """
    scenarios, recogniser, made_sensor = _load(data, fps, sensor, views, models, part, length)
    return GridEnv(scenarios=scenarios, recogniser=recogniser, sensor=made_sensor)


def grid_vector_env(
    num_envs: int = 1,
    *,
    data: str | Path = "duo",
    fps: float | None = None,
    sensor: str = "perfect",
    views: str = "moving",
    models: str | Path | None = None,
    part: str = "policy",
    length: int = 60,
) -> GridVectorEnv:
    """Return `num_envs` environments in lockstep; the other arguments are those of `grid_env`."""
    scenarios, recogniser, made_sensor = _load(data, fps, sensor, views, models, part, length)
    return GridVectorEnv(num_envs=num_envs, scenarios=scenarios, recogniser=recogniser, sensor=made_sensor)


def flight_env(
    *,
    vehicle: str | Path = "px4-auto",
    data: str | Path = "duo",
    fps: float | None = None,
    sensor: str = "perfect",
    views: str = "moving",
    models: str | Path | None = None,
    part: str = "policy",
    length: int = 60,
) -> FlightEnv:
    """Return one environment in flight.

    Args:
        vehicle: a named vehicle or the path of a vehicle file.
        data: a built-in name or the path of an .npz.
        fps: the frame rate to resample to [1/s]; None keeps the data's own.
        sensor: `perfect` or `estimator`.
        views: how the recogniser was trained, `paper` or `moving`.
        models: a folder of trained weights; None takes those that come with the package.
        part: which scenarios: `recogniser`, `policy`, `validation` or `test`.
        length: L, frames in an episode.

    Raises:
        EharError: anything of it is unknown, missing or malformed.
    """
    carrier = load_vehicle(vehicle)
    scenarios, recogniser, made_sensor = _load(data, fps, sensor, views, models, part, length)
    return FlightEnv(scenarios=scenarios, recogniser=recogniser, sensor=made_sensor, vehicle=carrier)


def flight_vector_env(
    num_envs: int = 1,
    *,
    vehicle: str | Path = "px4-auto",
    data: str | Path = "duo",
    fps: float | None = None,
    sensor: str = "perfect",
    views: str = "moving",
    models: str | Path | None = None,
    part: str = "policy",
    length: int = 60,
) -> FlightVectorEnv:
    """Return `num_envs` environments in flight, in lockstep; the other arguments are those of `flight_env`."""
    carrier = load_vehicle(vehicle)
    scenarios, recogniser, made_sensor = _load(data, fps, sensor, views, models, part, length)
    return FlightVectorEnv(
        num_envs=num_envs, scenarios=scenarios, recogniser=recogniser, sensor=made_sensor, vehicle=carrier
    )


def _load(
    data: str | Path, fps: float | None, sensor: str, views: str, models: str | Path | None, part: str, length: int
) -> tuple[Scenarios, Recogniser, Sensor]:
    motion = load_data(data, fps=fps)
    scenarios = windows(motion, part_of(motion, part), length, 1)
    directory = None if models is None else Path(models)
    recogniser = load_recogniser(directory, motion, sensor=sensor, views=views)
    return scenarios, recogniser, make_sensor(sensor, motion.skeleton)
