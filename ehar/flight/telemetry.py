"""The demands of flights on a vehicle: peaks, effort, the share of frames at a limit, and what they cost."""

from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.flight.costs import FlightCosts
from ehar.flight.vehicle import Vehicle

AT_LIMIT = 0.99  # share of a limit


@dataclass(frozen=True, eq=False)
class FlightTelemetry:
    """The demands of B flights since they began, in SI units; speed, acceleration and jerk are Cartesian lengths."""

    frames: int  # number of frames flown
    peak_speed: FloatArray  # (B,) [m/s]
    peak_acceleration: FloatArray  # (B,) [m/s^2]
    peak_jerk: FloatArray  # (B,) [m/s^3]
    effort: FloatArray  # (B,) [m^2/s^3], the integral of the squared acceleration
    frames_at_limit: IntArray  # (B,), in which at least 99 % of some limit is used
    tracking_error: FloatArray  # (B, frames) [m], from where the planner's states were; NaN where it gave none
    costs: FlightCosts | None = None  # nothing before the first frame

    @classmethod
    def none(cls, episodes: int) -> "FlightTelemetry":
        """Return the telemetry of `episodes` flights that have not begun."""
        zero = np.zeros(episodes)
        return cls(0, zero, zero, zero, zero, np.zeros(episodes, dtype=np.int64), np.empty((episodes, 0)))

    @property
    def share_at_limit(self) -> FloatArray:
        """The share of frames at a limit, (B,); 0 before the first."""
        share: FloatArray = self.frames_at_limit / max(self.frames, 1)
        return share

    def after(
        self,
        vehicle: Vehicle,
        shares: FloatArray,
        frame_time: float,
        tracking_error: FloatArray,
        costs: FlightCosts | None = None,
    ) -> "FlightTelemetry":
        """Return the telemetry after one more frame.

        Args:
            vehicle: the vehicle.
            shares: (B, S, 5) shares of its limits, see `limit_shares`, at equal steps, both ends included.
            frame_time: how long the frame lasted [s].
            tracking_error: (B,) [m], how far the cameras ended from the planner's states.
            costs: what the frame cost; None if nobody knows.
        """
        peaks = shares.max(axis=1)
        acceleration = shares[..., 1] * vehicle.acceleration
        step = frame_time / (acceleration.shape[1] - 1)
        return FlightTelemetry(
            frames=self.frames + 1,
            peak_speed=np.maximum(self.peak_speed, peaks[:, 0] * vehicle.speed),
            peak_acceleration=np.maximum(self.peak_acceleration, peaks[:, 1] * vehicle.acceleration),
            peak_jerk=np.maximum(self.peak_jerk, peaks[:, 2] * vehicle.jerk),
            effort=self.effort + np.trapezoid(acceleration**2, dx=step, axis=1),
            frames_at_limit=self.frames_at_limit + (peaks.max(axis=1) >= AT_LIMIT),
            tracking_error=np.column_stack([self.tracking_error, tracking_error]),
            costs=costs if self.costs is None or costs is None else self.costs.plus(costs),
        )
