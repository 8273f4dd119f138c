"""Scenarios of streams: windows in which one activity follows another, with a label for every frame."""

from dataclasses import dataclass, field

import numpy as np

from ehar.arrays import FloatArray, IntArray, in_brief
from ehar.data.streams.data import NO_ACTIVITY, StreamData
from ehar.data.streams.followed import following_centre, thought_to_be
from ehar.data.window import Windows
from ehar.localisation import CentreLimits, CentreMotion, Localisation


@dataclass(frozen=True, eq=False, repr=False)
class StreamScenarios(Windows):
    """N windows of L frames of streams.

    Args:
        data: the streams that windows are cut from.
        length: L, frames.
        sequence: (N,) the stream of each window.
        first: (N,) the first frame of each window, counted within its stream.
        localisation: how well it is known where people are.
        limits: the limits of the centre's motion, if a vehicle follows it; None if cameras follow at once.
    """

    data: StreamData
    localisation: Localisation = field(default_factory=Localisation)
    limits: CentreLimits | None = None

    __repr__ = in_brief

    @property
    def labels(self) -> IntArray:
        """The class of each frame, (N, L); K, the class after all of the data's, is no activity."""
        labels = self.data.labels[self._frames(np.arange(len(self)))]
        return np.where(labels == NO_ACTIVITY, len(self.data.class_names), labels)

    def centres(self, indices: IntArray) -> FloatArray:
        """Return where the centre is, in each frame of some scenarios, (n, L, 3) [m] in the data's frame."""
        motion = self.centre_motion(indices)
        return self._people(indices) if motion is None else motion.position

    def gaze(self, indices: IntArray) -> FloatArray | None:
        """Return where cameras look, from the centre that their vehicle follows, (n, L, 3) [m]; None: at the centre.

        A vehicle cannot follow people at once, but its gimbal can turn to where they are known to be.
        """
        motion = self.centre_motion(indices)
        return None if motion is None else self._people(indices) - motion.position

    def _people(self, indices: IntArray) -> FloatArray:
        """Return where people are known to be in each frame, (n, L, 3) [m] in the data's frame."""
        return thought_to_be(self.data, self.localisation, self.sequence[indices])[self._frames(indices)]

    def centre_motion(self, indices: IntArray) -> CentreMotion | None:
        """Return the motion of the centre that a vehicle follows, each (n, L, 3); None if no vehicle does."""
        if self.limits is None:
            return None
        motion = following_centre(self.data, self.localisation, self.limits, self.sequence[indices])
        return CentreMotion(*(part[self._frames(indices)] for part in motion))

    def positions(self, indices: IntArray) -> FloatArray:
        """Return joints (n, L, P, J, 3) float32 [m] relative to where people are known to be, where cameras look.

        What is known in a frame rests on that frame and those before it, never on later ones. Missing frames are NaN:
        what the data have there lies between the frames around the gap, and would tell where people are behind it.
        """
        frames = self._frames(indices)
        centred = (self.data.positions[frames] - self._people(indices)[:, :, None, None]).astype(np.float32)
        centred[self.data.missing[frames]] = np.nan
        return centred
