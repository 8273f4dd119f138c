"""A camera that is kept on a way that was recorded, whatever it is told, and remembers where it was told otherwise."""

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.motion import GridMotion, Motion
from ehar.plugins.blame import blamed
from ehar.viewpoint import AZIMUTH, wrap_difference
from eval.records.episodes import DIGITS

VIEWPOINT = 1e-3  # [m], [rad]: what leads less far from the way is on it; a hundredth of a move of the grid


class FollowedWay:
    """A motion on a recorded way: it moves as told, and is brought back to the way where that leads elsewhere.

    Args:
        motion: of the track. Of a flight, or a motion of your own, only the viewpoint is brought back, as records do
            not hold velocities, or whatever else a body remembers.
        way: (B, L, 3) recorded viewpoints.
    """

    def __init__(self, motion: Motion, way: FloatArray) -> None:
        """Follow from the first frame."""
        self.workspace = motion.workspace
        self.elsewhere: BoolArray = np.zeros(way.shape[:2], dtype=bool)  # where it was told to leave the way
        self._motion = motion
        self._way = way
        self._frame = 0
        self._frame_time = 0.0

    def reset(self, viewpoint: FloatArray, frame_time: float) -> None:
        """Begin at viewpoints (B, 3)."""
        self._frame_time = frame_time
        with blamed(self._motion, f"motion {type(self._motion).__name__}, reset"):
            self._motion.reset(viewpoint, frame_time)

    def advance(self, target: FloatArray) -> FloatArray:
        """Move for one frame, and return where the way leads; all digits of where it got to, where these are recorded.

        What leads less far from the way than counts as elsewhere is brought back too: a millimetre is seen.
        """
        self._frame += 1
        with blamed(self._motion, f"motion {type(self._motion).__name__}, frame {self._frame - 1}"):
            reached = np.array(self._motion.advance(target), dtype=np.float64)
        recorded = self._way[:, self._frame]
        if reached.shape != recorded.shape:
            return reached  # the rollout says what is wrong with it
        off = reached - recorded
        off[:, AZIMUTH] = wrap_difference(off[:, AZIMUTH])
        farthest = np.abs(off).max(axis=1, keepdims=True)
        self.elsewhere[:, self._frame] = farthest[:, 0] > VIEWPOINT
        viewpoint: FloatArray = np.where(farthest > 10**-DIGITS, recorded, reached)
        if type(self._motion) is GridMotion:
            self._motion.reset(viewpoint, self._frame_time)
        return viewpoint

    @property
    def velocity(self) -> FloatArray:
        """That of the motion, (B, 3)."""
        return self._motion.velocity

    @property
    def acceleration(self) -> FloatArray:
        """That of the motion, (B, 3)."""
        return self._motion.acceleration
