"""From frames at any time to the frames of a recogniser, which come at its own rate."""

import math
from dataclasses import dataclass

PAUSE = 1.0  # [s]; after a longer one everything begins anew
LATE = 0.25  # [s] that a frame may take longer than the fastest one
DRIFT = 1e-4  # [s/s] by which the sender's clock may run slower than ours
# Of a period, by which a frame may come before the point that it stands for. Of a camera that is twice as fast as the
# recogniser, frames lie half a period off: at 0.5, noise would decide which of them count. This lies in the middle
# between those of a camera that is twice and of one that is three times as fast.
EARLY = 0.42

DOUBLED, OUT_OF_ORDER, BEGAN_ANEW, LATE_FRAME = "doubled", "out of order", "began anew", "late"


@dataclass(frozen=True)
class Due:
    """What a frame means to the recogniser.

    Args:
        shares: for each of the recogniser's frames that are due, where it lies on the way from the frame before, 0, to
            this one, 1. Empty where none is due.
        notes: what was wrong with the frame: `DOUBLED` and `OUT_OF_ORDER` are not to be watched.
    """

    shares: tuple[float, ...]
    notes: tuple[str, ...] = ()

    @property
    def refused(self) -> bool:
        """Whether the frame is not to be watched."""
        return DOUBLED in self.notes or OUT_OF_ORDER in self.notes

    @property
    def anew(self) -> bool:
        """Whether what was before no longer counts."""
        return BEGAN_ANEW in self.notes


class FrameClock:
    """Says which of a recogniser's frames are due when a frame comes in.

    The recogniser's frames lie on a grid that begins at the first frame. The first frame that comes at most `EARLY` of
    a period before a point of the grid stands for it; points that it leaves out lie between it and the frame before. So
    a camera of exactly the recogniser's rate is watched frame by frame, and a faster one has frames for which nothing
    is due: of one that is twice as fast, every other. After a pause, and when the sender's clock goes back by more than
    that, the grid begins anew.

    Args:
        fps: the recogniser's frames per second.
    """

    def __init__(self, fps: float) -> None:
        """Begin before the first frame."""
        self._fps = fps
        self._first: float | None = None
        self._time = 0.0
        self._point = 0
        self._least: float | None = None  # [s], from the frame's clock to ours, of the fastest frame
        self._arrived = 0.0

    def take(self, time: float, arrived: float | None = None) -> Due:
        """Return what is due for a frame.

        Args:
            time: when the frame was taken, by the sender's clock [s].
            arrived: when it came in, by our clock [s]; None if that is not known, and nothing is late.
        """
        before = self._time
        notes: tuple[str, ...] = ()
        if self._first is not None and abs(time - before) > PAUSE:
            self._first, self._least, notes = None, None, (BEGAN_ANEW,)
        elif self._first is not None and time <= before:
            return Due((), (DOUBLED if time == before else OUT_OF_ORDER,))
        notes += self._lateness(time, arrived)
        if self._first is None:
            self._first, self._time, self._point = time, time, 0
            return Due((1.0,), notes)
        point = math.floor((time - self._first) * self._fps + EARLY)
        points = [self._first + due / self._fps for due in range(self._point + 1, point)]
        shares = tuple(min(max((due - before) / (time - before), 0.0), 1.0) for due in points)
        self._time = time
        if point <= self._point:
            return Due((), notes)
        self._point = point
        return Due((*shares, 1.0), notes)

    def _lateness(self, time: float, arrived: float | None) -> tuple[str, ...]:
        """Return the note that a frame is late, or none."""
        if arrived is None:
            return ()
        offset = arrived - time
        if self._least is not None:
            self._least += DRIFT * max(arrived - self._arrived, 0.0)
        self._arrived = arrived
        self._least = offset if self._least is None else min(self._least, offset)
        return (LATE_FRAME,) if offset - self._least > LATE else ()
