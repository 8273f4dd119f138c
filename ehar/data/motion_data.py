"""A labelled motion data set in memory: the content of an .npz of the schema."""

from dataclasses import dataclass, replace

from ehar.arrays import BoolArray, IntArray
from ehar.data.recordings import Recordings


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class MotionData(Recordings):
    """Labelled sequences, each of which shows one activity.

    Args:
        labels: (sequences,) indices into `class_names`.
        views: (sequences,) ints, the camera that recorded each sequence, in whose frame its joints are: x to its right,
            y away from it, z up; None if joints are in the room's frame.
        recorded_ms: (sequences,) ints, when each recording began [ms]; None if the order is not known.
        missing: (total_frames,) bool, true where the tracker lost a joint or a person, and positions are interpolated;
            None if it lost none.
        notes: what a reader left out or had to assume. They are told when data is prepared, and are not in its file.
    """

    labels: IntArray
    views: IntArray | None = None
    recorded_ms: IntArray | None = None
    missing: BoolArray | None = None
    notes: tuple[str, ...] = ()

    @property
    def _activities(self) -> tuple[IntArray, ...]:
        return (self.labels,)

    def resampled(self, fps: float) -> "MotionData":
        """Return the data at another frame rate: linear interpolation in time, each sequence by itself.

        There is no filter against aliasing, because a camera has none: motion above half the new rate is not removed.

        Raises:
            UsageError: the rate is not above 0, or above `MOST_RATE`.
        """
        if fps == self.fps:
            return self
        positions, offsets = self._at_rate(fps)
        missing = None if self.missing is None else self._missing_at_rate(self.missing, fps, offsets)
        return replace(self, positions=positions, offsets=offsets, fps=float(fps), missing=missing)
