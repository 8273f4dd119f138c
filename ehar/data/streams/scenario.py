"""Scenarios of streams: windows in which one activity follows another, with a label for every frame."""

from dataclasses import dataclass, field

import numpy as np

from ehar.arrays import FloatArray, IntArray, in_brief
from ehar.data.streams.data import NO_ACTIVITY, StreamData
from ehar.data.streams.following import Localisation
from ehar.data.window import Windows


@dataclass(frozen=True, eq=False, repr=False)
class StreamScenarios(Windows):
    """N windows of L frames of streams.

    Args:
        data: the streams that windows are cut from.
        length: L, frames.
        sequence: (N,) the stream of each window.
        first: (N,) the first frame of each window, counted within its stream.
        localisation: how well it is known where people are.
    """

    data: StreamData
    localisation: Localisation = field(default_factory=Localisation)

    __repr__ = in_brief

    @property
    def labels(self) -> IntArray:
        """The class of each frame, (N, L); K, the class after all of the data's, is no activity."""
        labels = self.data.labels[self._frames(np.arange(len(self)))]
        return np.where(labels == NO_ACTIVITY, len(self.data.class_names), labels)

    def centres(self, indices: IntArray) -> FloatArray:
        """Return where people are thought to be, in each frame of some scenarios, (n, L, 3) [m] in the data's frame."""
        centres: FloatArray = self.data.followed(self.localisation)[self._frames(indices)]
        return centres

    def positions(self, indices: IntArray) -> FloatArray:
        """Return joints (n, L, P, J, 3) float32 [m] relative to the centre, which follows people.

        The centre of a frame rests on that frame and those before it, never on later ones. Missing frames are NaN: what
        the data have there lies between the frames around the gap, and would tell where people are behind it.
        """
        frames = self._frames(indices)
        centred = (self.data.positions[frames] - self.centres(indices)[:, :, None, None]).astype(np.float32)
        centred[self.data.missing[frames]] = np.nan
        return centred
