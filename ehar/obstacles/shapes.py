"""Boxes and upright cylinders: how far a point is from them, and whether they stand between a camera and a joint.

All places are in metres in the frame of an episode: its origin is people's centre in the first frame, z points up.
"""

from dataclasses import dataclass, fields, replace
from typing import Annotated, TypeVar

import numpy as np
from annotated_types import Gt

from ehar.arrays import BoolArray, FloatArray
from ehar.errors import UsageError

MARGIN = 0.3  # [m] that cameras keep from obstacles
NO_WAY = 1e-9  # [m]; takes the place of a way of no length along an axis, because we divide by it

Positive = Annotated[float, Gt(0)]
Place = tuple[float, float, float]
Coordinates = tuple[FloatArray, FloatArray, FloatArray]  # x, y and z [m], which broadcast


@dataclass(frozen=True, kw_only=True)
class Box:
    """A box that stands upright.

    Args:
        centre: its middle [m].
        size: its length along its own x, y and z axis [m].
        yaw_deg: how far it is turned about the z axis, from x towards y [deg].

    Raises:
        UsageError: a number is not finite, or a length is not above 0.
    """

    centre: Place
    size: tuple[Positive, Positive, Positive]
    yaw_deg: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check(self, (*self.centre, *self.size, self.yaw_deg), self.size)

    @property
    def reach(self) -> float:
        """The radius of a circle around it, seen from above [m]."""
        return float(np.hypot(self.size[0], self.size[1])) / 2

    def clearance(self, points: FloatArray) -> FloatArray:
        """Return how far points (..., 3) are from the box [m], (...,); inside it is negative: the way out."""
        own = self._own(coordinates(points))
        beyond = np.stack([np.abs(axis) - size / 2 for axis, size in zip(own, self.size, strict=True)])
        outside = np.sqrt((np.maximum(beyond, 0) ** 2).sum(axis=0))
        distance: FloatArray = outside + np.minimum(beyond.max(axis=0), 0)
        return distance

    def cuts(self, begin: Coordinates, end: Coordinates) -> BoolArray:
        """Return which straight ways from `begin` to `end` leave the box before they end, (...,): the slab test."""
        entered: FloatArray | float = -np.inf
        left: FloatArray | float = np.inf
        for first, last, size in zip(self._own(begin), self._own(end), self.size, strict=True):
            entered, left = _between(first, last, -size / 2, size / 2, entered, left)
        return _is_cut(entered, left)

    def _own(self, points: Coordinates) -> Coordinates:
        """Return the coordinates of points along the axes of the box, from its middle."""
        x, y, z = (axis - middle for axis, middle in zip(points, self.centre, strict=True))
        if not self.yaw_deg:
            return x, y, z
        cos, sin = np.cos(np.radians(self.yaw_deg)), np.sin(np.radians(self.yaw_deg))
        return cos * x + sin * y, cos * y - sin * x, z


@dataclass(frozen=True, kw_only=True)
class Cylinder:
    """An upright cylinder.

    Args:
        centre: its middle [m].
        radius: its radius [m].
        height: its height [m].

    Raises:
        UsageError: a number is not finite, or radius or height is not above 0.
    """

    centre: Place
    radius: Positive
    height: Positive

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check(self, (*self.centre, self.radius, self.height), (self.radius, self.height))

    @property
    def reach(self) -> float:
        """The radius of a circle around it, seen from above [m]."""
        return self.radius

    def clearance(self, points: FloatArray) -> FloatArray:
        """Return how far points (..., 3) are from the cylinder [m], (...,); inside it is negative: the way out."""
        x, y, z = (points[..., axis] - self.centre[axis] for axis in range(3))
        return cylinder_clearance(np.hypot(x, y), z, self.height / 2, self.radius)

    def cuts(self, begin: Coordinates, end: Coordinates) -> BoolArray:
        """Return which straight ways from `begin` to `end` leave the cylinder before they end, (...,)."""
        x, y, z = self.centre
        to_axis = np.array([-x, -y, 0.0])  # 64 bits: a root of a small difference needs them
        low, high = z - self.height / 2, z + self.height / 2
        return cylinder_cuts(moved(begin, to_axis), moved(end, to_axis), low, high, self.radius)


Shape = TypeVar("Shape", Box, Cylinder)


@dataclass(frozen=True, kw_only=True)
class Obstacles:
    """What stands in a world.

    Args:
        walls: the room's inside as a box: cameras stay in it. Walls hide nobody, as people are inside too.
        boxes: boxes.
        cylinders: upright cylinders.
    """

    walls: Box | None = None
    boxes: tuple[Box, ...] = ()
    cylinders: tuple[Cylinder, ...] = ()

    def __bool__(self) -> bool:
        """Whether there is any."""
        return bool(self.walls or self.boxes or self.cylinders)

    def relative_to(self, centre: FloatArray) -> "Obstacles":
        """Return the obstacles as they are relative to a centre (3,) [m] that is not where it was at first."""
        east, north, up = (float(part) for part in centre)

        def shifted(shape: Shape) -> Shape:
            x, y, z = shape.centre
            return replace(shape, centre=(x - east, y - north, z - up))

        walls = None if self.walls is None else shifted(self.walls)
        return Obstacles(
            walls=walls, boxes=tuple(map(shifted, self.boxes)), cylinders=tuple(map(shifted, self.cylinders))
        )

    def clearance(self, points: FloatArray) -> FloatArray:
        """Return how far points (..., 3) are from the nearest obstacle [m], (...,); inside one it is negative."""
        nearest = np.full(points.shape[:-1], np.inf)
        for shape in self.shapes:
            nearest = np.minimum(nearest, shape.clearance(points))
        return nearest if self.walls is None else np.minimum(nearest, -self.walls.clearance(points))

    def hide(self, cameras: FloatArray, joints: FloatArray) -> BoolArray:
        """Return which joints (..., P, J, 3) are hidden from cameras (..., 3), (..., P, J); leading axes broadcast.

        An obstacle does not hide what is inside it: recorded people walk through furniture.
        """
        begin, end = cameras[..., None, None, :].astype(np.float32), joints.astype(np.float32, copy=False)
        hidden = np.zeros(np.broadcast_shapes(begin.shape, end.shape)[:-1], dtype=bool)
        for shape in self.shapes:
            hidden |= shape.cuts(coordinates(begin), coordinates(end))
        return hidden

    @property
    def shapes(self) -> tuple[Box | Cylinder, ...]:
        """What stands within the walls."""
        return (*self.boxes, *self.cylinders)

    @property
    def numbers(self) -> tuple[float, ...]:
        """All numbers, with how many shapes of each kind there are."""
        shapes = (*(() if self.walls is None else (self.walls,)), *self.shapes)
        return (
            *(self.walls is not None, len(self.boxes), len(self.cylinders)),
            *(float(number) for shape in shapes for number in _numbers(shape)),
        )

    def __str__(self) -> str:
        """Return what there is in words."""
        boxes, cylinders = len(self.boxes), len(self.cylinders)
        parts = ["walls"] * (self.walls is not None)
        parts += [f"{boxes} box{'es' * (boxes > 1)}"] * (boxes > 0)
        parts += [f"{cylinders} cylinder{'s' * (cylinders > 1)}"] * (cylinders > 0)
        return ", ".join(parts)


def coordinates(points: FloatArray) -> Coordinates:
    """Return the coordinates of points (..., 3), each (...,)."""
    return points[..., 0], points[..., 1], points[..., 2]


def moved(points: Coordinates, by: FloatArray) -> Coordinates:
    """Return the coordinates of points that are moved by (3, ...) [m]."""
    return points[0] + by[0], points[1] + by[1], points[2] + by[2]


def cylinder_clearance(aside: FloatArray, above: FloatArray, half: float, radius: float) -> FloatArray:
    """Return how far points are from an upright cylinder [m], (...,); inside it is negative.

    Args:
        aside: (...,) how far they are from its axis [m].
        above: (...,) how far they are above its middle [m].
        half: half of its height [m].
        radius: its radius [m].
    """
    beyond = np.stack([aside - radius, np.abs(above) - half])
    outside = np.sqrt((np.maximum(beyond, 0) ** 2).sum(axis=0))
    distance: FloatArray = outside + np.minimum(beyond.max(axis=0), 0)
    return distance


def cylinder_cuts(
    begin: Coordinates,
    end: Coordinates,
    low: FloatArray | float,
    high: FloatArray | float,
    radius: float,
) -> BoolArray:
    """Return which straight ways leave an upright cylinder about the z axis before they end, (...,).

    A way is inside the circle between the roots of a quadratic, and between bottom and top as in the slab test.

    Args:
        begin: where the ways begin [m].
        end: where they end [m].
        low: height of the bottom [m].
        high: height of the top [m].
        radius: of the cylinder [m].
    """
    x, y, _ = begin
    way_x, way_y = end[0] - x, end[1] - y
    square = np.maximum(way_x**2 + way_y**2, NO_WAY**2)
    nearest = -(x * way_x + y * way_y) / square  # the share of the way that comes nearest to the axis
    half = nearest**2 - (x**2 + y**2 - radius**2) / square
    root = np.sqrt(np.maximum(half, 0))
    never = half <= 0
    entered, left = np.where(never, np.inf, nearest - root), np.where(never, -np.inf, nearest + root)
    return _is_cut(*_between(begin[2], end[2], low, high, entered, left))


def passes_by(begin: FloatArray, end: FloatArray, place: FloatArray, reach: FloatArray | float) -> BoolArray:
    """Return which straight ways, (..., 3) to (..., 3), come nearer to a place (..., 2) than `reach`, seen from above.

    Args:
        begin: where the ways begin [m].
        end: where they end [m].
        place: the places [m].
        reach: (...,) how near [m].
    """
    x, y = begin[..., 0] - place[..., 0], begin[..., 1] - place[..., 1]
    way_x, way_y = end[..., 0] - begin[..., 0], end[..., 1] - begin[..., 1]
    nearest = np.clip(-(x * way_x + y * way_y) / np.maximum(way_x**2 + way_y**2, NO_WAY**2), 0, 1)
    near: BoolArray = (x + nearest * way_x) ** 2 + (y + nearest * way_y) ** 2 < reach**2
    return near


def passes_through(
    begin: FloatArray, end: FloatArray, first: FloatArray, last: FloatArray, radius: FloatArray
) -> BoolArray:
    """Return which straight ways, (..., 3) to (..., 3), pass through a capsule, (...,).

    A way does if its least distance to the capsule's axis is below the radius. The nearest points of two segments:
    Ericson, Real-Time Collision Detection, Sec. 5.1.9.

    Args:
        begin: where the ways begin [m].
        end: where they end [m].
        first: one end of the capsule's axis [m].
        last: the other end [m].
        radius: of the capsule [m].
    """
    way, axis, between = end - begin, last - first, begin - first
    of_way, of_axis = np.maximum(_dot(way, way), NO_WAY**2), np.maximum(_dot(axis, axis), NO_WAY**2)
    both, along_way, along_axis = _dot(way, axis), _dot(way, between), _dot(axis, between)
    apart = np.maximum(of_way * of_axis - both**2, NO_WAY)  # parallel ones are equally near everywhere
    gone = np.clip((both * along_axis - along_way * of_axis) / apart, 0, 1)
    at = np.clip((both * gone + along_axis) / of_axis, 0, 1)
    gone = np.clip((both * at - along_way) / of_way, 0, 1)
    away = between + gone[..., None] * way - at[..., None] * axis
    through: BoolArray = _dot(away, away) < radius**2
    return through


def _dot(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the scalar product along the last axis."""
    product: FloatArray = np.einsum("...i,...i->...", one, other)
    return product


def _between(
    first: FloatArray,
    last: FloatArray,
    low: FloatArray | float,
    high: FloatArray | float,
    entered: FloatArray | float,
    left: FloatArray | float,
) -> tuple[FloatArray, FloatArray]:
    """Return the shares of ways at which they enter and leave a slab, and what they entered and left before."""
    way = last - first
    way = np.where(np.abs(way) < NO_WAY, NO_WAY, way)
    one, other = (low - first) / way, (high - first) / way
    return np.maximum(entered, np.minimum(one, other)), np.minimum(left, np.maximum(one, other))


def _is_cut(entered: FloatArray | float, left: FloatArray | float) -> BoolArray:
    return np.asarray((entered < left) & (left > 0) & (left < 1))


def _numbers(shape: Box | Cylinder) -> tuple[float, ...]:
    """Return all numbers of a shape."""
    held = (getattr(shape, part.name) for part in fields(shape))
    return tuple(number for value in held for number in (value if isinstance(value, tuple) else (value,)))


def _check(shape: Box | Cylinder, numbers: tuple[float, ...], lengths: tuple[float, ...]) -> None:
    """Raise a UsageError unless numbers are finite and lengths above 0."""
    if not (np.isfinite(numbers).all() and min(lengths) > 0):
        raise UsageError(f"obstacle: expected finite numbers, and lengths above 0, got {shape}")
