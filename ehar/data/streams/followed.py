"""Where people of streams are thought to be, and the centre that follows them: computed when first asked for."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.streams.data import StreamData
from ehar.localisation import CentreLimits, CentreMotion, Localisation, smoothed


def thought_to_be(data: StreamData, localisation: Localisation, streams: IntArray | None = None) -> FloatArray:
    """Return where people are thought to be in each frame, (total_frames, 3) [m]; it is computed once.

    Args:
        data: the streams.
        localisation: how well it is known where people are.
        streams: those that are asked for, None for all; of others it may be NaN.
    """
    return _estimates(data, localisation).of(streams)[0]


def following_centre(
    data: StreamData, localisation: Localisation, limits: CentreLimits, streams: IntArray | None = None
) -> CentreMotion:
    """Return the centre that goes after where people are thought to be and keeps limits; it is computed once.

    The arguments are those of `thought_to_be`, and the limits of the centre's motion.
    """
    return CentreMotion(*_centres(data, localisation, limits).of(streams))


class _StreamByStream:
    """Vectors of all frames, of which each stream's are computed when they are first asked for.

    Args:
        data: the streams.
        parts: kinds of vectors, such as positions and velocities.
        compute: returns those of the stream of a number, whose frames are a slice of all, (T, 3) each.
    """

    def __init__(self, data: StreamData, parts: int, compute: Callable[[int, slice], tuple[FloatArray, ...]]) -> None:
        self._offsets, self._compute = data.offsets, compute
        self._known = np.zeros(len(data.lengths), dtype=bool)
        self._vectors = tuple(np.full((len(data.positions), 3), np.nan) for _ in range(parts))
        self._shown = tuple(whole.view() for whole in self._vectors)
        for view in self._shown:
            view.flags.writeable = False

    def of(self, streams: IntArray | None) -> tuple[FloatArray, ...]:
        """Return the vectors, each (total_frames, 3), to read; those of streams that nobody asked for yet are NaN."""
        asked = np.arange(len(self._known)) if streams is None else np.unique(streams)
        for stream in asked[~self._known[asked]].tolist():
            frames = slice(self._offsets[stream], self._offsets[stream + 1])
            for whole, part in zip(self._vectors, self._compute(stream, frames), strict=True):
                whole[frames] = part
            self._known[stream] = True
        return self._shown


@lru_cache(maxsize=4)
def _estimates(data: StreamData, localisation: Localisation) -> _StreamByStream:
    """Return where people are thought to be, and how they are thought to move."""

    def compute(stream: int, frames: slice) -> tuple[FloatArray, ...]:
        middles = data.positions[frames].mean(axis=(1, 2), dtype=np.float64)
        return localisation.estimated(middles, data.fps, stream, data.missing[frames])

    return _StreamByStream(data, 2, compute)


@lru_cache(maxsize=4)
def _centres(data: StreamData, localisation: Localisation, limits: CentreLimits) -> _StreamByStream:
    """Return the parts of the motion of the centre that goes after that."""

    def compute(stream: int, frames: slice) -> tuple[FloatArray, ...]:
        wanted, velocity = (part[frames] for part in _estimates(data, localisation).of(np.array([stream])))
        return smoothed(wanted, velocity, 1 / data.fps, limits)

    return _StreamByStream(data, len(CentreMotion._fields), compute)
