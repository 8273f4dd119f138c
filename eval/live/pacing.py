"""When the next setpoint is due: at once when there is a decision, and on time when there is none."""

AHEAD = 0.5  # frames that setpoints may lie before our clock, so that a decision need not wait
BEHIND = 0.5  # frames that a decision may take before a setpoint goes out without it
GIVEN_UP = 3.0  # frames; setpoints that are later still are not made up for, as they would come in a burst


class Pacer:
    """Keeps the setpoints' time near our clock.

    A setpoint is due as soon as a frame has been decided on. If none comes, it is due half a frame late. So a camera of
    the recogniser's rate gets a setpoint for each of its frames, and nothing waits for a camera that is slow.

    Args:
        frame_time: time from one setpoint to the next [s].
    """

    def __init__(self, frame_time: float) -> None:
        """Begin; the first setpoint is due at once."""
        self._frame_time = frame_time
        self._at: float | None = None  # the time of the last setpoint, by our clock

    def wait(self, now: float) -> float:
        """Return how long nothing is due without a decision [s]."""
        if self._at is None:
            return 0.0
        return max(self._at + (1 + BEHIND) * self._frame_time - now, 0.0)

    def due(self, now: float, *, decided: bool) -> bool:
        """Return whether a setpoint is due at a time [s]; if so, it counts as made."""
        if self._at is None:
            self._at = now
            return True
        if now < self._at + ((-AHEAD if decided else 1 + BEHIND) * self._frame_time):
            return False
        self._at += self._frame_time
        if decided or now - self._at > GIVEN_UP * self._frame_time:
            self._at = max(self._at, now)  # so the next frame has a whole frame's time, and half of one, to be decided
        return True
