"""Tracks by name: `ideal`, the paper's grid moves, or a vehicle that carries the camera."""

from pathlib import Path

from ehar.errors import UsageError
from ehar.flight.vehicle import VEHICLES, Vehicle, load_vehicle

IDEAL = "ideal"


def load_track(track: str) -> Vehicle | None:
    """Return the vehicle that a track names, by its name or as a .json file; None for `ideal`.

    Raises:
        UsageError: there is no such track, or its file is not that of a vehicle.
    """
    if track == IDEAL:
        return None
    if track not in VEHICLES and Path(track).suffix != ".json":
        raise UsageError(f"unknown track {track!r}; expected {IDEAL}, {', '.join(VEHICLES)}, or a vehicle file (.json)")
    vehicle = load_vehicle(track)
    if vehicle.name == IDEAL:
        raise UsageError(f"{track}: expected another name of a vehicle file, {IDEAL!r} is the grid's")
    return vehicle


def track_name(vehicle: Vehicle | None) -> str:
    """Return what reports and planners call the track of a vehicle."""
    return IDEAL if vehicle is None else vehicle.name
