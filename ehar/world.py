"""Worlds: where a camera may be and begins, its moves and lens, what is in the way, and how people are localised."""

import math
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Gt, Le

from ehar.arrays import FloatArray
from ehar.camera import MOST_FOCAL_LENGTH, MOST_PIXELS, Camera
from ehar.errors import UsageError
from ehar.files import read_json
from ehar.localisation import USUAL_LOCALISATION, Localisation
from ehar.obstacles.free_space import FreeSpace
from ehar.obstacles.passers import FLOOR, PASSER_RADIUS
from ehar.obstacles.shapes import MARGIN, Box, Cylinder, Obstacles
from ehar.viewpoint import MOST_DISTANCE, Workspace

SAME = 1e-9  # share of a number by which two worlds may differ and be the same: degrees become radians

PASSER_ROOM = PASSER_RADIUS + MARGIN  # [m], between the ways of passers-by and the nearest cameras
LEAST_REACH = 2.0  # [m]; with less room passers-by would walk through people
LATER = ("obstacles", "passers_by", "passers_reach", "localisation", "identity")  # what older files do not have
OPTIONAL = (  # keys of files that have a usual value
    *(*LATER, "walls", "boxes", "cylinders", "yaw_deg"),
    *("noise", "delay", "agility"),
)

MOST_PASSERS = 100  # more people would hide everything, all the time

Metres = Annotated[float, Gt(0), Le(MOST_DISTANCE)]
Pixels = Annotated[int, Ge(1), Le(MOST_PIXELS)]
Count = Annotated[int, Ge(1)]
Identity = Literal["known", "tracked"]


@dataclass(frozen=True)
class World:
    """The world that cameras move in; weights are trained for one world.

    Args:
        name: name of the world in reports.
        workspace: bounds of distance and polar angle, and the steps of the grid.
        camera: intrinsics of all cameras.
        start_cells: number of cells along distance, azimuth and polar angle that episodes begin in, counted from the
            first; None takes all cells of the workspace.
        obstacles: what stands there. It hides people, and cameras keep clear of it.
        passers_by: number of people who walk past those that are watched, and hide them.
        passers_reach: how far from those that are watched they walk [m]; None is never to where cameras may be.
            Cameras keep clear of those whom they may meet.
        localisation: how well, and how soon, it is known where people are in streams; of no meaning in clips.
        identity: whether it is known whose joints are whose. "tracked": a track of those that are watched takes a
            passer-by for somebody whom they hide, see `Passers.taken_for`; of no meaning where nobody walks past.

    Raises:
        UsageError: there are no such start cells, or passers-by are too many, have no room between people and
            cameras, or walk less than 2 m or more than 10 km away.
    """

    name: str
    workspace: Workspace
    camera: Camera
    start_cells: tuple[int, int, int] | None = None
    obstacles: Obstacles = field(default_factory=Obstacles)
    passers_by: int = 0
    passers_reach: float | None = None
    localisation: Localisation = USUAL_LOCALISATION
    identity: Identity = "known"

    def __post_init__(self) -> None:
        """Check that the start cells are cells, and that there is room for passers-by."""
        cells = self.workspace.cells
        starts = cells if self.start_cells is None else self.start_cells
        if len(starts) != 3 or not all(1 <= start <= most for start, most in zip(starts, cells, strict=True)):
            raise UsageError(
                f"world {self.name}: start_cells: expected 3 numbers from 1 to {', '.join(map(str, cells))}, "
                f"the cells along distance, azimuth and polar angle, got {list(starts)}"
            )
        if self.passers_reach is not None and not LEAST_REACH <= self.passers_reach <= MOST_DISTANCE:
            raise UsageError(
                f"world {self.name}: passers_reach: expected {LEAST_REACH:g} to {MOST_DISTANCE:g} m, "
                f"got {self.passers_reach:g}"
            )
        if self.passers_by > MOST_PASSERS:
            raise UsageError(f"world {self.name}: passers_by: expected at most {MOST_PASSERS}, got more")
        if self.passers_by < 0 or (self.passers_by and not self.has_passing_room):
            raise UsageError(
                f"world {self.name}: passers_by: expected at least 0, and 0 unless distance_min is at least "
                f"{LEAST_REACH + PASSER_ROOM:g} m, as they pass between people and cameras; got {self.passers_by} and "
                f"{self.workspace.distance_min:g} m"
            )

    @property
    def has_passing_room(self) -> bool:
        """Whether there is room for passers-by between people and cameras."""
        return self.workspace.distance_min >= LEAST_REACH + PASSER_ROOM

    @property
    def passing_reach(self) -> float:
        """How far passers-by get from people [m]."""
        usual = self.workspace.distance_min - PASSER_ROOM  # never to where cameras may be
        return usual if self.passers_reach is None else self.passers_reach

    @property
    def meets_passers(self) -> bool:
        """Whether passers-by walk to where cameras may be."""
        return self.passers_by > 0 and self.passing_reach > self.workspace.distance_min - PASSER_ROOM

    @property
    def can_be_hit(self) -> bool:
        """Whether there is anything that a camera can come too near to."""
        return bool(self.obstacles) or self.meets_passers

    @property
    def is_open(self) -> bool:
        """Whether there is nothing but people in it."""
        return not self.obstacles and not self.passers_by

    @property
    def opened(self) -> "World":
        """The same world with nothing but people in it."""
        return replace(self, obstacles=Obstacles(), passers_by=0, passers_reach=None, identity="known")

    @property
    def free_space(self) -> FreeSpace | None:
        """The cells that keep clear of obstacles; None if there are none, and all cells do.

        Raises:
            UsageError: no cell is free, or obstacles hide everything, or the grid has too many cells.
        """
        if not self.obstacles:
            return None
        try:
            return FreeSpace.of(self.workspace, self.obstacles)
        except UsageError as error:
            raise UsageError(f"world {self.name}: {error}") from error

    def sample_starts(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Return start viewpoints (count, 3), uniform over the start cells that are free.

        Raises:
            UsageError: none is free.
        """
        cells = np.array(self.start_cells or self.workspace.cells)
        space = self.free_space
        if space is None:
            return self.workspace.from_cells(rng.integers(0, cells, size=(count, 3)))
        free = np.argwhere(space.free[tuple(map(slice, cells))])
        if not len(free):
            raise UsageError(
                f"world {self.name}: start_cells: expected a free one, obstacles are in or near all of them"
            )
        return self.workspace.from_cells(free[rng.integers(len(free), size=count)])

    def agrees_with(self, other: "World") -> bool:
        """Return whether two worlds are the same, whatever their names."""
        one, two = _numbers(self), _numbers(other)
        return len(one) == len(two) and bool(np.allclose(one, two, rtol=SAME, atol=SAME))

    def to_json(self) -> dict[str, Any]:
        """Return the world for files; without what older ones do not have, where it is usual."""
        left = ("obstacles", "passers_by") if self.is_open else ()
        held = {name: value for name, value in asdict(self).items() if name not in left}
        if self.localisation == USUAL_LOCALISATION:
            del held["localisation"]
        if self.passers_reach is None:
            del held["passers_reach"]
        if self.identity == "known":
            del held["identity"]
        return held

    def __str__(self) -> str:
        """Return the world on one line."""
        starts = " x ".join(map(str, self.start_cells or self.workspace.cells))
        inside = f", {self.obstacles}" if self.obstacles else ""
        inside += f", {self.passers_by} passers-by" if self.passers_by else ""
        inside += f" up to {self.passing_reach:g} m away" if self.meets_passers else ""
        inside += ", some taken for those that are watched" if self.identity == "tracked" else ""
        inside += "" if self.localisation == USUAL_LOCALISATION else f", people localised with {self.localisation}"
        return f"{self.name} ({self.workspace}, {starts} starts, {self.camera}{inside})"


def _numbers(world: World) -> list[float]:
    """Return all numbers of a world."""
    parts = [getattr(part, field.name) for part in (world.workspace, world.camera) for field in fields(part)]
    starts = world.start_cells or world.workspace.cells
    parts += [
        *starts,
        world.passers_by,
        world.passing_reach if world.passers_by else 0,
        world.identity == "tracked",
        *world.localisation.numbers,
        *world.obstacles.numbers,
    ]
    return [float(value) for value in parts]


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

# A gym around the paper's people: a wall 9 m away on two sides and 7 m on the others, two pillars, and a table.
ROOM = replace(
    PAPER,
    name="room",
    obstacles=Obstacles(
        walls=Box(centre=(0.0, 0.0, FLOOR + 3.25), size=(18.0, 14.0, 6.5)),
        boxes=(Box(centre=(1.5, 0.4, FLOOR + 0.375), size=(0.8, 1.8, 0.75), yaw_deg=15.0),),
        cylinders=(
            Cylinder(centre=(-1.9, 1.3, FLOOR + 3.25), radius=0.4, height=6.5),
            Cylinder(centre=(0.5, -2.2, FLOOR + 3.25), radius=0.4, height=6.5),
        ),
    ),
)
CROWD = replace(PAPER, name="crowd", passers_by=4)

WORLDS = {world.name: world for world in (PAPER, INDOOR, ROOM, CROWD)}


def by_name(world: World) -> str | World:
    """Return the name of a world of ehar, and any other world as it is."""
    return world.name if world == WORLDS.get(world.name) else world


@dataclass(frozen=True, kw_only=True)
class CameraFile:
    """The camera of a world file, as in `Camera`."""

    width: Pixels
    height: Pixels
    focal_length: Annotated[float, Gt(0), Le(MOST_FOCAL_LENGTH)]


@dataclass(frozen=True, kw_only=True)
class WorldFile:
    """The content of a world file: as in `World` and `Workspace`, but angles are in degrees."""

    distance_min: Metres
    distance_max: Metres
    polar_min_deg: Annotated[float, Ge(0)]
    polar_max_deg: Annotated[float, Ge(0)]
    distance_step: Metres
    angle_step_deg: Annotated[float, Gt(0)]
    camera: CameraFile
    start_cells: tuple[Count, Count, Count] | None = None
    obstacles: Obstacles = field(default_factory=Obstacles)
    passers_by: Annotated[int, Ge(0), Le(MOST_PASSERS)] = 0
    passers_reach: Annotated[float, Ge(LEAST_REACH), Le(MOST_DISTANCE)] | None = None
    localisation: Localisation = USUAL_LOCALISATION
    identity: Identity = "known"

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
        camera = Camera(**vars(self.camera))
        around = self.obstacles, self.passers_by, self.passers_reach, self.localisation, self.identity
        return World(name, workspace, camera, self.start_cells, *around)


def load_world(world: str | Path | World) -> World:
    """Return the world that a name or an object means, or read a world file.

    A world file is a JSON object, whose keys are the fields of `WorldFile`; `start_cells`, `obstacles`, `passers_by`,
    `passers_reach`, `localisation` and `identity` may be left out. The name of the file, without `.json`, is the name
    of the world.

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
    held = read_json(path, WorldFile, "a world file", optional=("start_cells", *OPTIONAL), wrong=UsageError)
    try:
        made = held.world(path.stem)
        _ = made.free_space
        return made
    except UsageError as error:
        raise UsageError(f"{path}: {error}") from error
