"""A motion that keeps the camera on a recorded way, and remembers where the planner wanted to leave it."""

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.localisation import CentreMotion
from ehar.motion import CarriedMotion, FollowingMotion, GridMotion, Motion, keep_clear, move
from ehar.obstacles.surroundings import Surroundings
from ehar.plugins.blame import blamed
from ehar.viewpoint import AZIMUTH, wrap_difference
from eval.records.episodes import DIGITS

VIEWPOINT = 1e-3  # [m], [rad]: a smaller distance counts as on the way; a hundredth of a move of the grid


class FollowedWay:
    """A motion on a recorded way: it moves as told, and is brought back to the way if it leaves it.

    Args:
        motion: motion of the track. In a flight, or with your own motion, only the viewpoint is brought back, because
            records hold no velocities and nothing else that a body remembers.
        way: (B, L, 3) recorded viewpoints.
        nudges: (B, L, 3) [m], [rad], how far the camera is beside the way; where it is not 0, it is exactly there.
    """

    def __init__(self, motion: Motion, way: FloatArray, nudges: FloatArray) -> None:
        """Follow from the first frame."""
        self.workspace = motion.workspace
        self.elsewhere: BoolArray = np.zeros(way.shape[:2], dtype=bool)  # frames in which it was told to leave the way
        self._motion = motion
        self._way = way
        self._nudges = nudges
        self._frame = 0
        if isinstance(motion, FollowingMotion):
            self.follow = self.advance

    def keep_clear(self, surroundings: Surroundings | None) -> None:
        """Tell the motion what stands around the episodes."""
        keep_clear(self._motion, surroundings)

    @property
    def centre(self) -> CentreMotion | None:
        """The motion of the centre that the motion follows; None if it follows none."""
        return self._motion.centre if isinstance(self._motion, CarriedMotion) else None

    @centre.setter
    def centre(self, centre: CentreMotion | None) -> None:
        if isinstance(self._motion, CarriedMotion):
            self._motion.centre = centre

    def reset(self, viewpoint: FloatArray, frame_time: float) -> None:
        """Begin at viewpoints (B, 3)."""
        with blamed(self._motion, f"motion {type(self._motion).__name__}, reset"):
            self._motion.reset(viewpoint, frame_time)

    def advance(self, target: FloatArray) -> FloatArray:
        """Move for one frame, and return the recorded viewpoint; the reached one, if both agree in all recorded digits.

        The camera is also brought back from a distance below `VIEWPOINT`, because a millimetre changes what it sees.
        """
        self._frame += 1
        with blamed(self._motion, f"motion {type(self._motion).__name__}, frame {self._frame - 1}"):
            reached = np.array(move(self._motion, target), dtype=np.float64)
        recorded = self._way[:, self._frame]
        if reached.shape != recorded.shape:
            return reached  # the rollout raises an error for it
        off = reached - recorded
        off[:, AZIMUTH] = wrap_difference(off[:, AZIMUTH])
        farthest = np.abs(off).max(axis=1, keepdims=True)
        self.elsewhere[:, self._frame] = farthest[:, 0] > VIEWPOINT
        nudge = self._nudges[:, self._frame]
        told = (farthest > 10**-DIGITS) | nudge.any(axis=1, keepdims=True)
        viewpoint: FloatArray = np.where(told, recorded + nudge, reached)
        if type(self._motion) is GridMotion:
            self._motion.put(viewpoint)
        return viewpoint

    @property
    def velocity(self) -> FloatArray:
        """The velocity of the motion, (B, 3)."""
        return self._motion.velocity

    @property
    def acceleration(self) -> FloatArray:
        """The acceleration of the motion, (B, 3)."""
        return self._motion.acceleration
