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
        distance: (N,) [m] flown in the world's frame; None, as the next two, in a run from before it was recorded.
        energy: (N,) [J]; None for a vehicle without a body.
        noise: (N,) equivalent A-weighted sound level at the centre of the people [dB]; None for a vehicle without a
            body.
    """

    peak_speed: FloatArray
    peak_acceleration: FloatArray
    peak_jerk: FloatArray
    effort: FloatArray
    limit_share: FloatArray
    distance: FloatArray | None = None
    energy: FloatArray | None = None
    noise: FloatArray | None = None


@dataclass(frozen=True)
class FlightSummary:
    """The demands of a planner's flights: the largest peaks, and means over episodes, of `FlightRecords`.

    The mean of levels is that of sound energy.
    """

    peak_speed: float
    peak_acceleration: float
    peak_jerk: float
    effort: float
    limit_share: float
    distance: float | None = None
    energy: float | None = None
    noise: float | None = None


COSTS = ("distance", "energy", "noise")  # what a flight may lack
# Of a line of episodes.jsonl and of summary.json, in each flight.
KEYS = tuple(field.name for field in fields(FlightRecords) if field.name not in COSTS)


def flights_of(motion: Motion) -> FlightRecords | None:
    """Return the records of a motion's telemetry, rounded as in the file; None for a motion without telemetry."""
    telemetry = getattr(motion, "telemetry", None)
    if not isinstance(telemetry, FlightTelemetry):
        return None
    costs = telemetry.costs
    known = {key: None if costs is None else getattr(costs, key) for key in COSTS}
    return FlightRecords(
        peak_speed=telemetry.peak_speed.round(DIGITS),
        peak_acceleration=telemetry.peak_acceleration.round(DIGITS),
        peak_jerk=telemetry.peak_jerk.round(DIGITS),
        effort=telemetry.effort.round(DIGITS),
        limit_share=telemetry.share_at_limit.round(DIGITS),
        **{key: None if values is None else values.round(DIGITS) for key, values in known.items()},
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
    held = (*KEYS, *(key for key in COSTS if all(getattr(piece, key) is not None for piece in pieces)))
    return FlightRecords(**{key: np.concatenate([getattr(piece, key) for piece in pieces]) for key in held})


def summarise_flights(flights: FlightRecords) -> FlightSummary:
    """Return the largest of each peak, the mean effort and costs, and the share of all frames at a limit."""
    distance, energy, noise = flights.distance, flights.energy, flights.noise
    return FlightSummary(
        peak_speed=float(flights.peak_speed.max()),
        peak_acceleration=float(flights.peak_acceleration.max()),
        peak_jerk=float(flights.peak_jerk.max()),
        effort=float(flights.effort.mean()),
        limit_share=float(flights.limit_share.mean()),
        distance=None if distance is None else float(distance.mean()),
        energy=None if energy is None else float(energy.mean()),
        noise=None if noise is None else float(10 * np.log10((10 ** (noise / 10)).mean())),
    )


def flight_numbers(flight: FlightSummary | None) -> Mapping[str, float | None]:
    """Return the numbers of flights in summary.json; on the ideal track all are None, without costs."""
    if flight is None:
        return dict.fromkeys(KEYS)
    return {key: value for key, value in asdict(flight).items() if key in KEYS or value is not None}


def held_flight(flight: FlightRecords) -> dict[str, FloatArray]:
    """Return what is known of N flights, by key, (N,) each."""
    return {key: value for key, value in vars(flight).items() if value is not None}
