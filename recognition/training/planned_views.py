"""Views that planners chose: where cameras were in episodes of people whom the recogniser learns from."""

import hashlib
from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray, IntArray, in_brief


@dataclass(frozen=True, eq=False, repr=False)
class PlannedViews:
    """Where planners went in N episodes of F frames.

    Args:
        sequence: (N,) the sequence that each episode is cut from.
        first: (N,) its first frame, counted within the sequence.
        viewpoints: (N, F, 3) where the camera was in each frame: distance [m], azimuth [rad], polar angle [rad].
    """

    sequence: IntArray
    first: IntArray
    viewpoints: FloatArray

    __repr__ = in_brief

    @property
    def sha256(self) -> str:
        """The hash of all of it."""
        digest = hashlib.sha256()
        for held in (self.sequence, self.first, self.viewpoints):
            digest.update(np.ascontiguousarray(held).tobytes())
        return digest.hexdigest()

    def of(self, sequences: IntArray) -> "PlannedViews":
        """Return those of some sequences."""
        kept = np.isin(self.sequence, sequences)
        return PlannedViews(self.sequence[kept], self.first[kept], self.viewpoints[kept])

    def draw(self, rng: np.random.Generator, count: int, length: int) -> "PlannedViews":
        """Draw windows of so many frames, of any episodes; they may overlap."""
        episode = rng.integers(len(self.sequence), size=count)
        begin = rng.integers(self.viewpoints.shape[1] - length + 1, size=count)
        frames = begin[:, None] + np.arange(length)
        return PlannedViews(
            self.sequence[episode], self.first[episode] + begin, self.viewpoints[episode[:, None], frames]
        )
