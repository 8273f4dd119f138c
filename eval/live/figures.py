"""How long the loop takes, kept in a histogram: an hour needs no more memory than a minute."""

from dataclasses import dataclass

import numpy as np

BIN = 1e-4  # [s]
LONGEST = 2.0  # [s]; what takes longer counts as this


class Latencies:
    """Times from a frame that came in to the setpoint that went out."""

    def __init__(self) -> None:
        """Begin with none."""
        self._counts = np.zeros(round(LONGEST / BIN) + 1, dtype=np.int64)

    def add(self, seconds: float) -> None:
        """Count a time [s]."""
        self._counts[min(int(max(seconds, 0.0) / BIN), len(self._counts) - 1)] += 1

    def percentile(self, percent: float) -> float:
        """Return the time that so many percent do not exceed [s], to a tenth of a millisecond; 0 if there are none."""
        total = self._counts.sum()
        if not total:
            return 0.0
        reached = np.cumsum(self._counts) >= percent / 100 * total
        return float((reached.argmax() + 1) * BIN)


@dataclass(frozen=True, kw_only=True)
class LoopFigures:
    """What a loop did.

    Args:
        lines: lines that came in.
        setpoints: setpoints that went out.
        longest_gap: longest time without a new setpoint, since the first [s].
        latencies: times from a frame that came in to the first setpoint after it was decided on.
        counts: how often what was said.
    """

    lines: int
    setpoints: int
    longest_gap: float
    latencies: Latencies
    counts: dict[str, int]

    def __str__(self) -> str:
        """Return the figures on one line."""
        told = ", ".join(f"{name} {count}" for name, count in sorted(self.counts.items()))
        p50, p95 = (1000 * self.latencies.percentile(percent) for percent in (50, 95))
        return (
            f"{self.lines} lines in, {self.setpoints} setpoints out, at most {1000 * self.longest_gap:.0f} ms apart; "
            f"from a frame to its setpoint {p50:.1f} ms in the median, {p95:.1f} ms in 95 % ({told})"
        )
