"""The paper's sensor: exact joints."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.camera import Camera, project
from ehar.sensors.sensor import Sensed, SensorNoise


class PerfectSensor:
    """Exact 2D joints, all of them seen, as in the paper (Sec. 3)."""

    name = "perfect"

    def __init__(self, *, camera: Camera | None = None) -> None:
        """Create the sensor; `camera` defaults to the documented intrinsics."""
        self.camera = camera or Camera()

    def sense(self, positions: FloatArray, viewpoint: FloatArray, noise: SensorNoise) -> Sensed:
        """Return the exact projection with confidence 1; the noise is not used."""
        pixels, _ = project(positions, viewpoint, self.camera)
        return Sensed(pixels, np.ones(pixels.shape[:-1], dtype=np.float32))
