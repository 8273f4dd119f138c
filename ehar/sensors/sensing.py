"""Senses with any sensor, and checks the result: a user's own sensor may break its contract."""

from typing import Any

import numpy as np

from ehar.arrays import BoolArray, FloatArray, kind_of
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

    Where joints are NaN, the data are missing. No sensor is asked about such frames: nobody is detected in them, so all
    joints lie at the image centre, with confidence 0.

    Args:
        sensor: the sensor.
        positions: joints, as in `Sensor.sense`; NaN in missing frames.
        viewpoint: viewpoints, as in `Sensor.sense`.
        noise: random draws, as in `Sensor.sense`.
        frame: name of the frame in errors: "frame 3".
        hidden: joints that are hidden, as in `Sensor.sense`.

    Raises:
        EpisodeError: the sensor raised an error, or its arrays have other shapes or are not finite.
    """
    known = np.isfinite(positions).all(axis=(-3, -2, -1))
    if known.all():
        return _sensed(sensor, positions, viewpoint, noise, frame, hidden)
    leading = np.broadcast_shapes(positions.shape[:-3], viewpoint.shape[:-1], noise.swap.shape[:-1])
    known = np.broadcast_to(known, leading)
    joints_2d = np.empty((*leading, *positions.shape[-3:-1], 2), dtype=np.float32)
    joints_2d[...] = (sensor.camera.width / 2, sensor.camera.height / 2)
    confidence = np.zeros(joints_2d.shape[:-1], dtype=np.float32)
    if known.any():
        arrays = zip((positions, viewpoint, *noise), (3, 1, 3, 2, 1), strict=True)  # and how many axes are their own
        chosen = [np.broadcast_to(array, (*leading, *array.shape[array.ndim - own :]))[known] for array, own in arrays]
        cut = None if hidden is None else np.broadcast_to(hidden, confidence.shape)[known]
        seen = _sensed(sensor, chosen[0], chosen[1], SensorNoise(*chosen[2:]), frame, cut)
        joints_2d[known], confidence[known] = seen
    return Sensed(joints_2d, confidence)


def _sensed(
    sensor: Sensor,
    positions: FloatArray,
    viewpoint: FloatArray,
    noise: SensorNoise,
    frame: str,
    hidden: BoolArray | None,
) -> Sensed:
    """Sense joints that are all known, and check the result; see `sense`."""
    where = f"sensor {type(sensor).__name__}" + (f", {frame}" if frame else "")
    with blamed(sensor, where):
        told = {} if hidden is None else {"hidden": hidden}  # a sensor of your own need not know of obstacles elsewhere
        sensed: Any = sensor.sense(positions, viewpoint, noise, **told)
    if not isinstance(sensed, tuple) or len(sensed) != 2:
        raise EpisodeError(f"{where}: expected Sensed(joints_2d, confidence), got {type(sensed).__name__}")
    leading = np.broadcast_shapes(positions.shape[:-3], viewpoint.shape[:-1])
    joints = (*leading, *positions.shape[-3:-1])
    for name, array, expected in zip(Sensed._fields, sensed, ((*joints, 2), joints), strict=True):
        if not isinstance(array, np.ndarray) or array.dtype.kind != "f":
            raise EpisodeError(f"{where}: {name}: expected an array of floats, got {kind_of(array)}")
        if array.shape != expected or not np.isfinite(array).all():
            got = str(array.shape) if array.shape != expected else "NaN or infinity"
            raise EpisodeError(f"{where}: expected finite {name} of shape {expected}, got {got}")
    confidence = sensed[1]
    if confidence.size and not 0 <= confidence.min() <= confidence.max() <= 1:
        got = f"{confidence.min():.4g} to {confidence.max():.4g}"
        raise EpisodeError(f"{where}: expected confidence from 0 to 1, got {got}")
    return sensed if isinstance(sensed, Sensed) else Sensed(*sensed)
