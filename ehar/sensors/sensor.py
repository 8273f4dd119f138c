"""The contract of a sensor, which turns joints in space into the output of a pose estimator."""

from typing import NamedTuple, Protocol

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.camera import Camera


class Sensed(NamedTuple):
    """The 2D joints of every person in a frame."""

    joints_2d: FloatArray  # (..., P, J, 2) [px], finite everywhere
    confidence: FloatArray  # (..., P, J) in [0, 1]; 0 where the joint is missing


class SensorNoise(NamedTuple):
    """The random draws behind a sensor's errors, made before an episode.

    They are drawn for every frame, whatever the camera does. So compared planners have the same luck, and an oracle
    that imagines a viewpoint sees the very joints that it would get there.
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

    def sense(
        self, positions: FloatArray, viewpoint: FloatArray, noise: SensorNoise, hidden: BoolArray | None = None
    ) -> Sensed:
        """Sense joints (..., P, J, 3) [m] from viewpoints (..., 3); leading axes broadcast.

        Args:
            positions: the joints.
            viewpoint: the viewpoints.
            noise: the random draws.
            hidden: (..., P, J) joints that an obstacle or a passer-by hides; None means none. In a world without any
                it is not given.
        """
        ...
