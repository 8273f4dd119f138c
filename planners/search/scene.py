"""What stands and walks around a plan, as smooth formulas: how much of people is seen, and what is too near."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ehar.arrays import FloatArray
from ehar.flight.centre import walked
from ehar.flight.clearance import ASTRAY, PLANNED
from ehar.obstacles.passers import FLOOR, PASSER_RADIUS, PASSER_TOP
from ehar.obstacles.shapes import MARGIN, Box, Obstacles
from planners.value.line_of_sight import ACROSS, HEIGHTS

WALKING = 3  # numbers of how fast the centre walks
BOX = 8  # numbers of a box: its middle, half of its size, the cosine and the sine of its turn
ROUND = 7  # of an upright cylinder: x, y, radius, bottom, top, and how fast it walks along x and y
HALF_WIDTH = 1.5 * float(ACROSS[-1])  # [m]; each of the three points across a person stands for a third of it
MIDDLE, HALF_HEIGHT = float(HEIGHTS.mean()), 0.75 * float(np.ptp(HEIGHTS))  # [m], in the same way
SOFTENED = 0.2  # rounds the corners of a share that grows from 0 to 1; the square is 1 where it is full
BEYOND = 0.2  # [m] over which an obstacle comes between a camera and people
ROUNDED = 0.1  # [m], of distances
SMALL = 1e-2  # [m], of lengths that we divide by
WEIGHT = 30.0  # of the squared intrusion [1/m^2] into what is kept clear of, at each node, in units of the stake


class SceneSize(NamedTuple):
    """How much there is of everything; a problem is written down for one size."""

    people: int
    walls: int  # 0 or 1
    boxes: int
    cylinders: int
    passers: int
    met: bool = False  # whether cameras may meet passers-by, and keep clear of them

    @property
    def numbers(self) -> int:
        """The number of numbers of a scene."""
        return WALKING + 3 * self.people + BOX * (self.walls + self.boxes) + ROUND * (self.cylinders + self.passers)


@dataclass(frozen=True, eq=False)
class Scene:
    """What stands and walks around people at the beginning of a plan, relative to their centre.

    Args:
        size: how much there is.
        numbers: (`size.numbers`,) where it is [m], and how fast the centre and passers-by walk [m/s].
    """

    size: SceneSize
    numbers: FloatArray

    @staticmethod
    def of(
        people: FloatArray,
        obstacles: Obstacles,
        passers: FloatArray | None,
        walking: FloatArray | None = None,
        *,
        met: bool = False,
    ) -> "Scene":
        """Return a scene.

        Args:
            people: (P, 3) where those who are watched are thought to be, the mean of their joints [m].
            obstacles: what stands there, relative to the present centre.
            passers: (W, 4) place [m] and velocity [m/s] of passers-by; None if there are none.
            walking: (3,) the velocity of the centre [m/s]; None if it stays.
            met: whether cameras may meet passers-by.
        """
        walls = () if obstacles.walls is None else (obstacles.walls,)
        strangers = np.empty((0, 4)) if passers is None else passers
        numbers = [*(np.zeros(WALKING) if walking is None else walking), *people.ravel()]
        for box in (*walls, *obstacles.boxes):
            numbers += _numbers(box)
        for cylinder in obstacles.cylinders:
            (x, y, z), half = cylinder.centre, cylinder.height / 2
            numbers += [x, y, cylinder.radius, z - half, z + half, 0.0, 0.0]
        for x, y, east, north in strangers:
            numbers += [x, y, PASSER_RADIUS, FLOOR, PASSER_TOP, east, north]
        size = SceneSize(len(people), len(walls), len(obstacles.boxes), len(obstacles.cylinders), len(strangers), met)
        return Scene(size, np.array(numbers))


def _numbers(box: Box) -> list[float]:
    turn = np.radians(box.yaw_deg)
    return [*box.centre, *(size / 2 for size in box.size), float(np.cos(turn)), float(np.sin(turn))]


class SceneSymbols:
    """The formulas of scenes of one size, over the symbols of their numbers."""

    def __init__(self, size: SceneSize) -> None:
        """Name the numbers."""
        self.numbers = ca.SX.sym("scene", size.numbers)
        boxes, rounds = size.walls + size.boxes, size.cylinders + size.passers
        lengths = [WALKING] + [3] * size.people + [BOX] * boxes + [ROUND] * rounds
        self._walking, *parts = ca.vertsplit(self.numbers, np.concatenate([[0], np.cumsum(lengths)]).tolist())
        boxes, rounds = size.people + size.walls, size.people + size.walls + size.boxes
        self._people, self._walls = parts[: size.people], parts[size.people : boxes]
        self._boxes = parts[boxes:rounds]
        self._standing, self._passing = parts[rounds : rounds + size.cylinders], parts[rounds + size.cylinders :]
        self._met = self._passing if size.met else []

    def seen(self, camera: Any, ahead: Any) -> Any:
        """Return about the share of people that is seen, 0 to 1: `planners.value.line_of_sight.seen_share`, smoothed.

        Args:
            camera: its place (3,) [m].
            ahead: how far ahead it is there [s]; until then passers-by walk straight on, and people for a while.
        """
        total: Any = 0
        way_on = self._way_on(ahead)
        for person in self._people:
            share: Any = 1
            way = _sight(camera, person)
            there, then = camera + way_on, person + way_on  # where what stands has not moved
            for box in self._boxes:
                share *= 1 - _hidden_by_box(there, then, way, box)
            for cylinder in self._standing:
                share *= 1 - _hidden_by_cylinder(there, then, way, cylinder, ahead)
            for passer in self._passing:
                share *= 1 - _hidden_by_cylinder(camera, person, way, passer, ahead)
            total += share
        return total / len(self._people)

    def intrusion(self, camera: Any, keep: float, ahead: Any) -> Any:
        """Return the sum of squares of how far a camera (3,) is within `keep` [m] of what it can hit; see `seen`."""
        total: Any = 0
        beside, camera = camera, camera + self._way_on(ahead)  # ways of passers-by are as seen from the centre
        for walls in self._walls:
            for axis, half in zip(_own(camera, walls), ca.vertsplit(walls[3:6]), strict=True):
                total += _above_0(_length(axis) - half + keep) ** 2
        shapes = [
            [_length(axis) - half for axis, half in zip(_own(camera, box), ca.vertsplit(box[3:6]), strict=True)]
            for box in self._boxes
        ]
        for cylinder in self._standing:
            shapes.append(_off_cylinder(camera, cylinder, 0))
        for passer in self._met:
            shapes.append([off - ASTRAY for off in _off_cylinder(beside, passer, ahead)])
        for first, *others in shapes:
            distance = first
            for other in others:
                distance = _larger(distance, other) - ROUNDED / 2  # never more than it is
            total += _above_0(keep - distance) ** 2
        return total

    def _way_on(self, ahead: Any) -> Any:
        """Return how far the centre will have walked on, (3,) [m]."""
        return self._walking * walked(ahead, ca.exp)


def kept_clear(*, flown: bool) -> float:
    """Return the distance [m] that plans keep from obstacles: on the grid, motions find the free cells themselves."""
    return PLANNED if flown else MARGIN


def _off_cylinder(camera: Any, cylinder: Any, ahead: Any) -> list[Any]:
    """Return how far a camera is from the side of an upright cylinder that moves, and from its ends [m]."""
    x, y, radius, low, high, east, north = ca.vertsplit(cylinder)
    upwards = _length(camera[2] - (low + high) / 2) - (high - low) / 2
    return [_length(camera[0] - x - ahead * east, camera[1] - y - ahead * north) - radius, upwards]


def _hidden_by_cylinder(camera: Any, person: Any, way: tuple[Any, Any, Any], cylinder: Any, ahead: Any) -> Any:
    x, y, radius, low, high, east, north = ca.vertsplit(cylinder)
    offset = (x + ahead * east - person[0], y + ahead * north - person[1])
    return _hidden(camera, person, way, offset, radius, low, high)


def _hidden_by_box(camera: Any, person: Any, way: tuple[Any, Any, Any], box: Any) -> Any:
    """Return the share that a box hides: as wide as its corners are apart, as seen from there."""
    x, y, z, half_x, half_y, half_z, cos, sin = ca.vertsplit(box)
    east, north, _ = way
    across = half_x * _length(east * sin - north * cos) + half_y * _length(east * cos + north * sin)
    return _hidden(camera, person, way, (x - person[0], y - person[1]), across, z - half_z, z + half_z)


def _sight(camera: Any, person: Any) -> tuple[Any, Any, Any]:
    """Return the level direction from a person to the camera, and how far it is [m]."""
    east, north = camera[0] - person[0], camera[1] - person[1]
    far = _length(east, north)
    return east / far, north / far, far


def _hidden(
    camera: Any, person: Any, way: tuple[Any, Any, Any], offset: tuple[Any, Any], half: Any, low: Any, high: Any
) -> Any:
    """Return the share of a person, an upright strip that faces the camera, that something upright hides.

    Args:
        camera: (3,) [m].
        person: (3,) [m].
        way: a result of `_sight`.
        offset: from the person to it, along x and y [m].
        half: half of its width as seen from the camera [m].
        low: height of its bottom [m].
        high: height of its top [m].
    """
    east, north, far = way
    along, aside = east * offset[0] + north * offset[1], east * offset[1] - north * offset[0]
    share = along / far  # of the way to the camera
    left = _length(1 - share)  # its shadow on the plane in which the person stands is 1 / left times as large
    wide = _covered((aside + half) / left / HALF_WIDTH) - _covered((aside - half) / left / HALF_WIDTH)
    top, bottom = ((height - camera[2] * share) / left - person[2] - MIDDLE for height in (high, low))
    tall = _covered(top / HALF_HEIGHT) - _covered(bottom / HALF_HEIGHT)
    return wide * tall * _positive(along) * _positive(far - along)


def _own(camera: Any, box: Any) -> tuple[Any, Any, Any]:
    """Return a camera's place along the axes of a box, from its middle [m]."""
    x, y, z = camera[0] - box[0], camera[1] - box[1], camera[2] - box[2]
    cos, sin = box[6], box[7]
    return cos * x + sin * y, cos * y - sin * x, z


def _covered(edge: Any) -> Any:
    """Return the share of [-1, 1] below an edge, with rounded corners."""
    return 0.5 + (ca.sqrt((edge + 1) ** 2 + SOFTENED) - ca.sqrt((edge - 1) ** 2 + SOFTENED)) / 4


def _positive(length: Any) -> Any:
    """Return 1 where a length is positive, 0 where it is negative, and what is between in between."""
    return 0.5 + length / ca.sqrt(length**2 + BEYOND**2) / 2


def _above_0(length: Any) -> Any:
    """Return a length where it is positive, else 0, with a rounded corner."""
    return (length + ca.sqrt(length**2 + ROUNDED**2)) / 2


def _larger(one: Any, other: Any) -> Any:
    """Return the larger of two lengths, or at most `ROUNDED` / 2 more."""
    return (one + other + ca.sqrt((one - other) ** 2 + ROUNDED**2)) / 2


def _length(*parts: Any) -> Any:
    return ca.sqrt(sum(part**2 for part in parts) + SMALL**2)
