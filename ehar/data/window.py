"""Windows of recordings: the frames that an episode shows."""

from dataclasses import dataclass

import numpy as np

from ehar.arrays import IntArray, in_brief
from ehar.data.recordings import Recordings


@dataclass(frozen=True, eq=False, repr=False)
class Windows:
    """N windows of L frames, of trimmed sequences or of streams.

    Args:
        data: the data that windows are cut from.
        length: L, frames.
        sequence: (N,) the sequence of each window.
        first: (N,) the first frame of each window, counted within its sequence.
    """

    data: Recordings
    length: int
    sequence: IntArray
    first: IntArray

    __repr__ = in_brief

    def __len__(self) -> int:
        """The number of scenarios, N."""
        return len(self.sequence)

    def _begin(self, indices: IntArray) -> IntArray:
        """Return the first frame (n,) of scenarios, counted over all of the data."""
        begin: IntArray = self.data.offsets[self.sequence[indices]] + self.first[indices]
        return begin

    def _frames(self, indices: IntArray) -> IntArray:
        """Return the frames (n, L) of scenarios, counted over all of the data."""
        return self._begin(indices)[:, None] + np.arange(self.length)
