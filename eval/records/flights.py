"""The demands of flights on the vehicle, episode by episode; only the records of flights have this part."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields

import numpy as np

from ehar.arrays import FloatArray
from ehar.flight.telemetry import FlightTelemetry
from ehar.motion import Motion

DIGITS = 6  # decimals that are recorded


@dataclass(frozen=True, eq=False)
class FlightRecords:
    """The telemetry of N flights; speed, acceleration and jerk are lengths of Cartesian vectors, sampled at 1 kHz.

    Args:
        peak_speed: (N,) [m/s].
        peak_acceleration: (N,) [m/s^2].
        peak_jerk: (N,) [m/s^3].
        effort: (N,) [m^2/s^3], the integral of the squared acceleration over the episode.
        limit_share: (N,) share of frames in which at least 99 % of some limit of the vehicle is used.
    """

    peak_speed: FloatArray
    peak_acceleration: FloatArray
    peak_jerk: FloatArray
    effort: FloatArray
    limit_share: FloatArray


@dataclass(frozen=True)
class FlightSummary:
    """The demands of a planner's flights: the largest peaks, and means over episodes, of `FlightRecords`."""

    peak_speed: float
    peak_acceleration: float
    peak_jerk: float
    effort: float
    limit_share: float


KEYS = tuple(field.name for field in fields(FlightRecords))  # of a line of episodes.jsonl and of summary.json


def flights_of(motion: Motion) -> FlightRecords | None:
    """Return the records of a motion's telemetry, rounded as in the file; None for a motion without telemetry."""
    telemetry = getattr(motion, "telemetry", None)
    if not isinstance(telemetry, FlightTelemetry):
        return None
    return FlightRecords(
        peak_speed=telemetry.peak_speed.round(DIGITS),
        peak_acceleration=telemetry.peak_acceleration.round(DIGITS),
        peak_jerk=telemetry.peak_jerk.round(DIGITS),
        effort=telemetry.effort.round(DIGITS),
        limit_share=telemetry.share_at_limit.round(DIGITS),
    )


def tracking_of(motion: Motion) -> FloatArray | None:
    """Return how far the cameras were from their planner's paths in each frame, (N, L) [m]; None without paths."""
    telemetry = getattr(motion, "telemetry", None)
    if not isinstance(telemetry, FlightTelemetry) or not telemetry.frames:
        return None
    error = telemetry.tracking_error
    return None if np.isnan(error).any() else np.column_stack([np.zeros(len(error)), error])


def join_flights(pieces: Sequence[FlightRecords]) -> FlightRecords:
    """Return the records of several batches as one."""
    return FlightRecords(**{key: np.concatenate([getattr(piece, key) for piece in pieces]) for key in KEYS})


def summarise_flights(flights: FlightRecords) -> FlightSummary:
    """Return the largest of each peak, the mean effort and the share of all frames at a limit."""
    return FlightSummary(
        peak_speed=float(flights.peak_speed.max()),
        peak_acceleration=float(flights.peak_acceleration.max()),
        peak_jerk=float(flights.peak_jerk.max()),
        effort=float(flights.effort.mean()),
        limit_share=float(flights.limit_share.mean()),
    )


def flight_numbers(flight: FlightSummary | None) -> Mapping[str, float | None]:
    """Return the numbers of flights in summary.json; all are None on the ideal track."""
    return dict.fromkeys(KEYS) if flight is None else asdict(flight)
