"""What `ehar/Grid-v0` and `ehar/Flight-v0` make for Gymnasium: the task on motion data, with a trained recogniser."""

from pathlib import Path

from ehar.data.scenario import part_of, windows
from ehar.data.source import load_data
from ehar.envs.controls import FlightControls, GridControls
from ehar.envs.environment import EpisodeEnv, EpisodeVectorEnv
from ehar.envs.task import Episodes
from ehar.flight.vehicle import load_vehicle
from ehar.sensors.registry import make_sensor
from recognition.storage import load_recogniser


def make_env(
    *,
    vehicle: str | Path | None = None,
    data: str | Path = "duo",
    fps: float | None = None,
    sensor: str = "perfect",
    views: str = "moving",
    models: str | Path | None = None,
    part: str = "policy",
    length: int = 60,
) -> EpisodeEnv:
    """Return one environment.

    Args:
        vehicle: a named vehicle or the path of a vehicle file; None is the paper's grid.
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
    return EpisodeEnv(_load(vehicle, data, fps, sensor, views, models, part, length))


def make_vector_env(
    num_envs: int = 1,
    *,
    vehicle: str | Path | None = None,
    data: str | Path = "duo",
    fps: float | None = None,
    sensor: str = "perfect",
    views: str = "moving",
    models: str | Path | None = None,
    part: str = "policy",
    length: int = 60,
) -> EpisodeVectorEnv:
    """Return `num_envs` environments in lockstep; the other arguments are those of `make_env`."""
    return EpisodeVectorEnv(num_envs, _load(vehicle, data, fps, sensor, views, models, part, length))


def _load(
    vehicle: str | Path | None,
    data: str | Path,
    fps: float | None,
    sensor: str,
    views: str,
    models: str | Path | None,
    part: str,
    length: int,
) -> Episodes:
    controls = GridControls() if vehicle is None else FlightControls(vehicle=load_vehicle(vehicle))
    motion = load_data(data, fps=fps)
    scenarios = windows(motion, part_of(motion, part), length, 1)
    directory = None if models is None else Path(models)
    recogniser = load_recogniser(directory, motion, sensor=sensor, views=views)
    made_sensor = make_sensor(sensor, motion.skeleton)
    return Episodes(scenarios=scenarios, recogniser=recogniser, sensor=made_sensor, controls=controls)
