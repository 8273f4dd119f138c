"""Tracks: how cameras move. `ideal` is the paper's grid; a vehicle or your own motion can carry the camera instead."""

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
        name: name of the track for planners.
        vehicle: the vehicle that carries the camera; planners are told about it. None if there is none.
        own: makes a new object of your own motion.
        spec: for your own motion, the text that named it; for an object, its name.
        sha256: for your own motion, the hash of its file and arguments.
    """

    name: str = IDEAL
    vehicle: Vehicle | None = None
    own: Callable[[], Motion] | None = None
    spec: str | None = None
    sha256: str | None = None

    @property
    def named(self) -> str:
        """Its name in records."""
        return self.name if self.spec is None else self.spec

    def new_motion(self, workspace: Workspace, *, moving_centre: bool = False) -> Motion:
        """Return a new motion: on the grid, in flight, or your own.

        Args:
            workspace: where the camera may be; your own motion brings its own.
            moving_centre: whether the vehicle also follows people.

        Raises:
            UsageError: your own motion cannot be made.
        """
        if self.own is not None:
            return self.own()
        if self.vehicle is None:
            return GridMotion(workspace=workspace)
        from ehar.flight.motion import FlightMotion  # imported here: too slow for `ehar --help`

        return FlightMotion(vehicle=self.vehicle, workspace=workspace, moving_centre=moving_centre)


def load_track(track: str | Path | Vehicle | Motion, workspace: Workspace | None = None) -> Track:
    """Return the track that a name or an object means.

    Your own motion is made again for each batch of episodes; an object is copied for each. A constructor with an
    argument called `workspace` is handed that of the world.

    Args:
        track: a name, a vehicle file (.json), a vehicle, or your own motion: an object, or `path/to/file.py:Class` or
            `package.module:Class`, with or without `(argument=value, ...)`.
        workspace: the workspace of the world; None means the paper's.

    Raises:
        UsageError: there is no such track, the file is no vehicle file, or your own class is no motion.
    """
    if isinstance(track, Vehicle):
        return Track(track.name, track)
    if not isinstance(track, str | Path):
        return _own(track, workspace or Workspace())
    if track == IDEAL:
        return Track()
    if track not in VEHICLES and Path(track).suffix != ".json":
        spec = parse_spec(track) if isinstance(track, str) else None
        if spec is not None and spec.place:
            return _own(track, workspace or Workspace())
        known = ", ".join((IDEAL, *VEHICLES))
        raise UsageError(f"unknown track {str(track)!r}; expected {known}, or a vehicle file (.json), or {FORMS}")
    vehicle = load_vehicle(track)
    if vehicle.name == IDEAL:
        raise UsageError(f"{track}: expected another name of a vehicle file, {IDEAL!r} is the grid's")
    return Track(vehicle.name, vehicle)


def _own(track: object, space: Workspace) -> Track:
    """Return the track of your own motion."""
    from ehar.plugins.own_class import Contract, bring  # imported here: too slow for `ehar --help`

    contract = Contract("motion", Motion, ("reset", "advance"), ("workspace", "velocity", "acceleration"))
    own = bring(track, contract, {"workspace": space})
    workspace, name = own.made.workspace, getattr(own.made, "name", type(own.made).__name__)
    if not isinstance(workspace, Workspace):
        raise UsageError(f"{own.what}: workspace: expected an ehar.viewpoint.Workspace, got {type(workspace).__name__}")
    if not isinstance(name, str) or not name.strip() or not name.isprintable():
        raise UsageError(f"{own.what}: name: expected a line of text, got {name!r}")
    if name in (IDEAL, *VEHICLES):
        raise UsageError(f"{own.what}: name: expected another than {name!r}, which is a track of ehar")
    own.make()  # so that an object that cannot be copied is refused before the run
    vehicle = getattr(own.made, "vehicle", None)
    spec = own.spec if isinstance(track, str) else name
    return Track(name, vehicle if isinstance(vehicle, Vehicle) else None, own.make, spec, own.sha256)
