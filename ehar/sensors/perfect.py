"""The paper's sensor: exact joints."""

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.camera import Camera, project
from ehar.sensors.sensor import Sensed, SensorNoise


class PerfectSensor:
    """Exact 2D joints, as in the paper (Sec. 3): all are seen that no obstacle hides.

    A hidden joint lies at the image centre, with confidence 0.
    """

    name = "perfect"

    def __init__(self, *, camera: Camera | None = None) -> None:
        """Create the sensor; `camera` defaults to the documented intrinsics."""
        self.camera = camera or Camera()

    def sense(
        self, positions: FloatArray, viewpoint: FloatArray, noise: SensorNoise, hidden: BoolArray | None = None
    ) -> Sensed:
        """Return the exact projection with confidence 1; the noise is not used."""
        pixels, _ = project(positions, viewpoint, self.camera)
        confidence = np.ones(pixels.shape[:-1], dtype=np.float32)
        if hidden is not None:
            pixels[hidden], confidence[hidden] = (self.camera.width / 2, self.camera.height / 2), 0.0
        return Sensed(pixels, confidence)

    def fingerprint(self) -> bytes:
        """Return what decides what it sees."""
        return repr(vars(self)).encode()
