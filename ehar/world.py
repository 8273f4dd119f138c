"""Worlds: where a camera may be, how it moves on the grid, where episodes begin, and its lens; two named, and files."""

import math
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from ehar.arrays import FloatArray
from ehar.camera import Camera
from ehar.errors import UsageError
from ehar.files import read_json
from ehar.viewpoint import Workspace

SAME = 1e-9  # share of a number by which two worlds may differ and be the same: degrees become radians

Positive = Annotated[float, Gt(0)]
Count = Annotated[int, Ge(1)]


@dataclass(frozen=True)
class World:
    """The world that cameras move in; weights are trained for one world.

    Args:
        name: name of the world in reports.
        workspace: bounds of distance and polar angle, and the steps of the grid.
        camera: intrinsics of all cameras.
        start_cells: number of cells along distance, azimuth and polar angle that episodes begin in, counted from the
            first; None takes all cells of the workspace.

    Raises:
        UsageError: there are no such start cells.
    """

    name: str
    workspace: Workspace
    camera: Camera
    start_cells: tuple[int, int, int] | None = None

    def __post_init__(self) -> None:
        """Check that the start cells are cells."""
        cells = self.workspace.cells
        starts = cells if self.start_cells is None else self.start_cells
        if len(starts) != 3 or not all(1 <= start <= most for start, most in zip(starts, cells, strict=True)):
            raise UsageError(
                f"world {self.name}: start_cells: expected 3 numbers from 1 to {', '.join(map(str, cells))}, "
                f"the cells along distance, azimuth and polar angle, got {list(starts)}"
            )

    def sample_starts(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Return start viewpoints (count, 3), uniform over the start cells."""
        cells = np.array(self.start_cells or self.workspace.cells)
        return self.workspace.from_cells(rng.integers(0, cells, size=(count, 3)))

    def agrees_with(self, other: "World") -> bool:
        """Return whether two worlds are the same, whatever their names."""
        return bool(np.allclose(_numbers(self), _numbers(other), rtol=SAME, atol=SAME))

    def __str__(self) -> str:
        """Return the world on one line."""
        space = self.workspace
        low, high, turn = (math.degrees(angle) for angle in (space.polar_min, space.polar_max, space.angle_step))
        starts = " x ".join(map(str, self.start_cells or space.cells))
        return (
            f"{self.name} ({space.distance_min:g} to {space.distance_max:g} m, polar {low:g} to {high:g} deg, "
            f"steps of {space.distance_step:g} m and {turn:g} deg, {starts} starts, {self.camera})"
        )


def _numbers(world: World) -> list[float]:
    """Return all numbers of a world."""
    parts = [getattr(part, field.name) for part in (world.workspace, world.camera) for field in fields(part)]
    return [float(value) for value in (*parts, *(world.start_cells or world.workspace.cells))]


# Sec. 5.1: |P_0| = 100 * 100 * 25 = 250,000. The paper's ranges are half open for starts.
PAPER = World("paper", Workspace(), Camera(), (100, 100, 25))

# A robot in a room: as far as a room is deep, from a mast's height to a little below the people's middle, with the lens
# of a depth camera (Kinect: 640 x 480 px, 525 px). Steps are a hundredth of the range of distances and of a full turn,
# as the paper's are. So an ideal camera gets as far in this workspace in an episode as the paper's does in its own.
INDOOR = World(
    "indoor",
    Workspace(
        distance_min=1.5,
        distance_max=4.0,
        polar_min=math.radians(40),
        polar_max=math.radians(95),
        distance_step=0.025,
        angle_step=math.radians(3.6),
    ),
    Camera(width=640, height=480, focal_length=525.0),
)

WORLDS = {world.name: world for world in (PAPER, INDOOR)}


def by_name(world: World) -> str | World:
    """Return the name of a world of ehar, and any other world as it is."""
    return world.name if world == WORLDS.get(world.name) else world


@dataclass(frozen=True, kw_only=True)
class CameraFile:
    """The camera of a world file, as in `Camera`."""

    width: Count
    height: Count
    focal_length: Positive


@dataclass(frozen=True, kw_only=True)
class WorldFile:
    """The content of a world file: as in `World` and `Workspace`, but angles are in degrees."""

    distance_min: Positive
    distance_max: Positive
    polar_min_deg: Annotated[float, Ge(0)]
    polar_max_deg: Annotated[float, Ge(0)]
    distance_step: Positive
    angle_step_deg: Positive
    camera: CameraFile
    start_cells: tuple[Count, Count, Count] | None = None

    def world(self, name: str) -> World:
        """Return the world under a name."""
        workspace = Workspace(
            distance_min=self.distance_min,
            distance_max=self.distance_max,
            polar_min=math.radians(self.polar_min_deg),
            polar_max=math.radians(self.polar_max_deg),
            distance_step=self.distance_step,
            angle_step=math.radians(self.angle_step_deg),
        )
        return World(name, workspace, Camera(**vars(self.camera)), self.start_cells)


def load_world(world: str | Path | World) -> World:
    """Return the world that a name or an object means, or read a world file.

    A world file is a JSON object, whose keys are the fields of `WorldFile`; `start_cells` may be left out. The name of
    the file, without `.json`, is the name of the world.

    Raises:
        UsageError: there is no such world or file; or a key is missing or unknown, or a value is impossible.
    """
    if isinstance(world, World):
        return world
    if isinstance(world, str) and world in WORLDS:
        return WORLDS[world]
    path = Path(world)
    if path.suffix != ".json":
        raise UsageError(f"unknown world {str(world)!r}; expected one of: {', '.join(WORLDS)}, or a .json file")
    if path.stem in WORLDS:
        raise UsageError(f"{path}: expected another name of a world file, {path.stem!r} is a world of ehar")
    held = read_json(path, WorldFile, "a world file", optional=("start_cells",), wrong=UsageError)
    try:
        return held.world(path.stem)
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error
