"""Tracks: how cameras move. `ideal` is the paper's grid; else a vehicle carries the camera."""

from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path

from ehar.errors import UsageError
from ehar.flight.vehicle import VEHICLES, Vehicle, load_vehicle
from ehar.motion import GridMotion, Motion

IDEAL = "ideal"


@dataclass(frozen=True)
class Track:
    """How cameras move.

    Args:
        name: what reports and planners call it.
        vehicle: what carries the camera; None where none does.
        own: a motion of your own.
    """

    name: str = IDEAL
    vehicle: Vehicle | None = None
    own: Motion | None = None

    def new_motion(self) -> Motion:
        """Return a new body that moves on the grid, or flies as the vehicle does."""
        if self.own is not None:
            return deepcopy(self.own)
        if self.vehicle is None:
            return GridMotion()
        from ehar.flight.motion import FlightMotion  # here, as it brings Ruckig, which `ehar --help` does not wait for

        return FlightMotion(vehicle=self.vehicle)


def load_track(track: str | Path | Vehicle | Motion) -> Track:
    """Return the track of a name or a vehicle file (.json), or of a vehicle.

    Raises:
        UsageError: there is no such track, or its file is not that of a vehicle.
    """
    if track == IDEAL:
        return Track()
    if isinstance(track, Vehicle):
        return Track(track.name, track)
    if not isinstance(track, str | Path):
        return Track(type(track).__name__, own=track)
    if track not in VEHICLES and Path(track).suffix != ".json":
        raise UsageError(
            f"unknown track {str(track)!r}; expected {IDEAL}, {', '.join(VEHICLES)}, or a vehicle file (.json)"
        )
    vehicle = load_vehicle(track)
    if vehicle.name == IDEAL:
        raise UsageError(f"{track}: expected another name of a vehicle file, {IDEAL!r} is the grid's")
    return Track(vehicle.name, vehicle)
