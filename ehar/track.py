"""Tracks: how cameras move. `ideal` is the paper's grid; else a vehicle carries the camera, or a motion of your own."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ehar.errors import UsageError
from ehar.flight.vehicle import VEHICLES, Vehicle, load_vehicle
from ehar.motion import GridMotion, Motion
from ehar.plugins.class_spec import FORMS, parse_spec
from ehar.viewpoint import Workspace

IDEAL = "ideal"


@dataclass(frozen=True)
class Track:
    """How cameras move.

    Args:
        name: what planners call it.
        vehicle: what carries the camera, as planners are told; None where none does.
        own: makes a new motion of your own.
        spec: of your own: how it was named; of an object, its name.
        sha256: of your own: of its file and arguments.
    """

    name: str = IDEAL
    vehicle: Vehicle | None = None
    own: Callable[[], Motion] | None = None
    spec: str | None = None
    sha256: str | None = None

    @property
    def named(self) -> str:
        """What records call it."""
        return self.name if self.spec is None else self.spec

    def new_motion(self) -> Motion:
        """Return a new body that moves on the grid, flies as the vehicle does, or is your own.

        Raises:
            UsageError: your own cannot be made.
        """
        if self.own is not None:
            return self.own()
        if self.vehicle is None:
            return GridMotion()
        from ehar.flight.motion import FlightMotion  # here, as it brings Ruckig, which `ehar --help` does not wait for

        return FlightMotion(vehicle=self.vehicle)


def load_track(track: str | Path | Vehicle | Motion) -> Track:
    """Return the track that is meant.

    Args:
        track: a name, a vehicle file (.json), a vehicle; or your own motion, `path/to/file.py:Class` or
            `package.module:Class`, with or without `(argument=value, ...)`, which is made anew for each batch of
            episodes, or an object, which is copied for each.

    Raises:
        UsageError: there is no such track, its file is not that of a vehicle, or your own is no motion.
    """
    if isinstance(track, Vehicle):
        return Track(track.name, track)
    if not isinstance(track, str | Path):
        return _own(track)
    if track == IDEAL:
        return Track()
    if track not in VEHICLES and Path(track).suffix != ".json":
        spec = parse_spec(track) if isinstance(track, str) else None
        if spec is not None and spec.place:
            return _own(track)
        known = ", ".join((IDEAL, *VEHICLES))
        raise UsageError(f"unknown track {str(track)!r}; expected {known}, or a vehicle file (.json), or {FORMS}")
    vehicle = load_vehicle(track)
    if vehicle.name == IDEAL:
        raise UsageError(f"{track}: expected another name of a vehicle file, {IDEAL!r} is the grid's")
    return Track(vehicle.name, vehicle)


def _own(track: object) -> Track:
    """Return the track of your own motion."""
    from ehar.plugins.own_class import Contract, bring  # here, as `ehar --help` does not wait for cloudpickle

    contract = Contract("motion", Motion, ("reset", "advance"), ("workspace", "velocity", "acceleration"))
    own = bring(track, contract, {})
    workspace, name = own.made.workspace, getattr(own.made, "name", type(own.made).__name__)
    if not isinstance(workspace, Workspace):
        raise UsageError(f"{own.what}: workspace: expected an ehar.viewpoint.Workspace, got {type(workspace).__name__}")
    if not isinstance(name, str) or not name.strip() or not name.isprintable():
        raise UsageError(f"{own.what}: name: expected a line of text, got {name!r}")
    if name in (IDEAL, *VEHICLES):
        raise UsageError(f"{own.what}: name: expected another than {name!r}, which is a track of ehar")
    own.make()  # so that what cannot be copied is said before anything runs
    vehicle = getattr(own.made, "vehicle", None)
    spec = own.spec if isinstance(track, str) else name
    return Track(name, vehicle if isinstance(vehicle, Vehicle) else None, own.make, spec, own.sha256)
