"""Senses with any sensor, and checks the result: a user's own sensor may break its contract."""

from typing import Any

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.errors import EpisodeError
from ehar.plugins.blame import blamed
from ehar.sensors.sensor import Sensed, Sensor, SensorNoise


def sense(
    sensor: Sensor,
    positions: FloatArray,
    viewpoint: FloatArray,
    noise: SensorNoise,
    frame: str = "",
    hidden: BoolArray | None = None,
) -> Sensed:
    """Sense joints (..., P, J, 3) [m] from viewpoints (..., 3), and check the result.

    Args:
        sensor: the sensor.
        positions: joints, as in `Sensor.sense`.
        viewpoint: viewpoints, as in `Sensor.sense`.
        noise: random draws, as in `Sensor.sense`.
        frame: name of the frame in errors: "frame 3".
        hidden: joints that are hidden, as in `Sensor.sense`.

    Raises:
        EpisodeError: the sensor raised an error, or its arrays have other shapes or are not finite.
    """
    where = f"sensor {type(sensor).__name__}" + (f", {frame}" if frame else "")
    with blamed(sensor, where):
        told = () if hidden is None else (hidden,)  # a sensor of your own need not know of obstacles elsewhere
        sensed: Any = sensor.sense(positions, viewpoint, noise, *told)
    if not isinstance(sensed, tuple) or len(sensed) != 2:
        raise EpisodeError(f"{where}: expected Sensed(joints_2d, confidence), got {type(sensed).__name__}")
    leading = np.broadcast_shapes(positions.shape[:-3], viewpoint.shape[:-1])
    joints = (*leading, *positions.shape[-3:-1])
    for name, array, expected in zip(Sensed._fields, sensed, ((*joints, 2), joints), strict=True):
        if not isinstance(array, np.ndarray) or array.dtype.kind != "f":
            got = f"an array of {array.dtype}" if isinstance(array, np.ndarray) else type(array).__name__
            raise EpisodeError(f"{where}: {name}: expected an array of floats, got {got}")
        if array.shape != expected or not np.isfinite(array).all():
            got = str(array.shape) if array.shape != expected else "NaN or infinity"
            raise EpisodeError(f"{where}: expected finite {name} of shape {expected}, got {got}")
    return sensed if isinstance(sensed, Sensed) else Sensed(*sensed)
