"""The contract of a sensor: what a pose estimator makes of an image."""

from typing import NamedTuple, Protocol

import numpy as np

from ehar.arrays import FloatArray
from ehar.camera import Camera


class Sensed(NamedTuple):
    """2D joints of one frame, of every person."""

    joints_2d: FloatArray  # (..., P, J, 2) [px], finite everywhere
    confidence: FloatArray  # (..., P, J) in [0, 1]; 0 where the joint is missing


class SensorNoise(NamedTuple):
    """The random draws behind a sensor's errors, made before an episode.

    Drawn for every frame whatever the camera does, so planners that are compared meet the same luck, and an
    oracle that imagines a viewpoint sees exactly what it would get there.
    """

    localisation: FloatArray  # (..., P, J, 2) standard normal
    dropout: FloatArray  # (..., P, J) uniform in [0, 1)
    swap: FloatArray  # (..., P) uniform in [0, 1)

    def frame(self, frame: int) -> "SensorNoise":
        """Return the draws of one frame, (B, ...), from draws (B, T, ...)."""
        return SensorNoise(*(draws[:, frame] for draws in self))

    def forked(self) -> "SensorNoise":
        """Return the draws (B, ...) as (B, 1, ...), to be shared by the forks of an episode."""
        return SensorNoise(*(draws[:, None] for draws in self))


def draw_noise(rng: np.random.Generator, leading: tuple[int, ...], persons: int, joints: int) -> SensorNoise:
    """Draw the noise of `leading` (for example (B, T)) frames."""
    return SensorNoise(
        localisation=rng.standard_normal((*leading, persons, joints, 2), dtype=np.float32),
        dropout=rng.random((*leading, persons, joints), dtype=np.float32),
        swap=rng.random((*leading, persons), dtype=np.float32),
    )


class Sensor(Protocol):
    """Turns joints in space into joints in an image."""

    name: str
    camera: Camera

    def sense(self, positions: FloatArray, viewpoint: FloatArray, noise: SensorNoise) -> Sensed:
        """Return what is sensed of joints (..., P, J, 3) [m] from viewpoints (..., 3); leading axes broadcast."""
        ...
