"""Viewpoints (distance [m], azimuth [rad], polar angle [rad]): workspace, its grid of cells and the 7 moves.

The polar angle is measured from straight above: 0 looks down from the top, pi/2 is level with the people.
The paper calls it elevation (Sec. 3); its Figure 6 and its V-Rotate only make sense with this reading.
"""

import math
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray, read_only
from ehar.errors import UsageError

DISTANCE, AZIMUTH, POLAR = 0, 1, 2

# Sec. 5.2: a = 0/1 raises/lowers the distance, 2/3 the azimuth, 4/5 the polar angle, 6 hovers. In cells.
MOVES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [0, 0, 0]])
MOVE_NAMES = ("distance+", "distance-", "azimuth+", "azimuth-", "polar+", "polar-", "hover")
HOVER = 6


MOST_DISTANCE = 10_000.0  # [m]; nobody sees joints from there
MOST_CELLS = 100_000_000  # of a grid; the paper's has 262,600
EDGE = 1e-9  # share of a step by which the last cell may lie beyond a bound, because sums of steps are rounded


@dataclass(frozen=True)
class Workspace:
    """The viewpoints that a camera may take, with any azimuth, and a grid of cells in it; the default is the paper's.

    The grid begins at the least distance, azimuth 0 and the least polar angle. All its cells lie inside the bounds. A
    bound that is no whole number of steps away from the other is on the grid only if it is the lower one.

    Args:
        distance_min: nearest distance to the centre [m].
        distance_max: farthest distance to the centre [m].
        polar_min: smallest polar angle [rad]; 0 is straight above.
        polar_max: largest polar angle [rad]; pi/2 is level with the centre, and more is below it.
        distance_step: change of the distance by a move [m].
        angle_step: change of the azimuth or the polar angle by a move [rad]; a full turn is a whole number of steps.

    Raises:
        UsageError: a number is not finite, the workspace is impossible, or the grid has too many cells.
    """

    distance_min: float = 5.0  # Sec. 5.1: the paper's starts span [5, 15] m and [0, 90] degrees
    distance_max: float = 15.0
    polar_min: float = 0.0
    polar_max: float = float(np.pi / 2)
    distance_step: float = 0.1  # Sec. 3: "small translation"
    angle_step: float = float(np.radians(3.6))  # Sec. 3: "small ... rotation"

    def __str__(self) -> str:
        """Return the bounds and steps in words."""
        low, high, turn = (math.degrees(angle) for angle in (self.polar_min, self.polar_max, self.angle_step))
        return (
            f"{self.distance_min:g} to {self.distance_max:g} m, polar {low:g} to {high:g} deg, steps of "
            f"{self.distance_step:g} m and {turn:g} deg"
        )

    def __post_init__(self) -> None:
        """Check bounds and steps."""
        for part in fields(self):
            value = getattr(self, part.name)
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not number or not abs(value) < math.inf:
                raise UsageError(f"workspace: {part.name}: expected a finite number, got {value!r}")
        if not 0 < self.distance_min <= self.distance_max:
            raise UsageError(
                "workspace: expected 0 < distance_min <= distance_max, "
                f"got {self.distance_min:g} and {self.distance_max:g} m"
            )
        if self.distance_max > MOST_DISTANCE:
            raise UsageError(f"workspace: expected a distance_max of at most {MOST_DISTANCE:g} m, got more")
        low, high, step = (math.degrees(angle) for angle in (self.polar_min, self.polar_max, self.angle_step))
        if not 0 <= self.polar_min <= self.polar_max <= np.pi:
            raise UsageError(f"workspace: expected polar angles 0 <= min <= max <= 180 deg, got {low:g} and {high:g}")
        if self.distance_step <= 0:
            raise UsageError(f"workspace: expected a distance_step above 0, got {self.distance_step:g} m")
        turns = 2 * math.pi / self.angle_step if self.angle_step > 0 else 0.5
        deep = (self.distance_max - self.distance_min) / self.distance_step
        down = turns * (self.polar_max - self.polar_min) / (2 * math.pi)
        if (deep + 1) * turns * (down + 1) > MOST_CELLS:
            raise UsageError(
                f"workspace: expected a grid of at most {MOST_CELLS:,} cells, got more, by steps of "
                f"{self.distance_step:g} m and {step:g} deg"
            )
        if abs(turns - round(turns)) > 1e-6:
            raise UsageError(f"workspace: expected an angle_step that divides 360 deg, got {step:g}")

    @cached_property
    def origin(self) -> FloatArray:
        """The viewpoint of cell (0, 0, 0), (3,)."""
        return read_only(np.array([self.distance_min, 0.0, self.polar_min]))

    @cached_property
    def step(self) -> FloatArray:
        """The changes of distance, azimuth and polar angle by a move, (3,) [m], [rad], [rad]."""
        return read_only(np.array([self.distance_step, self.angle_step, self.angle_step]))

    @cached_property
    def cells(self) -> tuple[int, int, int]:
        """The number of cells along distance, azimuth and polar angle."""
        deep = (self.distance_max - self.distance_min) / self.distance_step
        down = (self.polar_max - self.polar_min) / self.angle_step
        return math.floor(deep + EDGE) + 1, round(2 * np.pi / self.angle_step), math.floor(down + EDGE) + 1

    def to_cells(self, viewpoint: FloatArray) -> IntArray:
        """Return the nearest grid cells (..., 3) of viewpoints; a cell is the number of steps from `origin`."""
        cells: IntArray = np.rint((viewpoint - self.origin) / self.step).astype(np.int64)
        cells[..., AZIMUTH] %= self.cells[AZIMUTH]
        for axis in (DISTANCE, POLAR):
            cells[..., axis] = np.clip(cells[..., axis], 0, self.cells[axis] - 1)
        return cells

    def from_cells(self, cells: IntArray) -> FloatArray:
        """Return the viewpoints (..., 3) of grid cells (..., 3), azimuths in [0, 2 pi)."""
        wrapped = np.array(cells)
        wrapped[..., AZIMUTH] %= self.cells[AZIMUTH]
        viewpoint: FloatArray = self.origin + wrapped * self.step
        return viewpoint

    def clip(self, viewpoint: FloatArray) -> FloatArray:
        """Return the nearest viewpoints in the workspace, (..., 3), with azimuths wrapped to [0, 2 pi)."""
        clipped = np.empty(viewpoint.shape)
        clipped[..., DISTANCE] = np.clip(viewpoint[..., DISTANCE], self.distance_min, self.distance_max)
        clipped[..., AZIMUTH] = wrap_azimuth(viewpoint[..., AZIMUTH])
        clipped[..., POLAR] = np.clip(viewpoint[..., POLAR], self.polar_min, self.polar_max)
        return clipped

    def contains(self, viewpoint: FloatArray, tolerance: float = 1e-9) -> BoolArray:
        """Return which viewpoints (..., 3) lie in the workspace, (...,)."""
        distance, polar = viewpoint[..., DISTANCE], viewpoint[..., POLAR]
        inside: BoolArray = (
            (distance >= self.distance_min - tolerance)
            & (distance <= self.distance_max + tolerance)
            & (polar >= self.polar_min - tolerance)
            & (polar <= self.polar_max + tolerance)
        )
        return inside


def wrap_azimuth(azimuth: FloatArray) -> FloatArray:
    """Return angles [rad] wrapped to [0, 2 pi)."""
    wrapped: FloatArray = np.mod(azimuth, 2 * np.pi)
    return np.where(wrapped >= 2 * np.pi, 0.0, wrapped)


def wrap_difference(angle: FloatArray) -> FloatArray:
    """Return angle differences [rad] wrapped to [-pi, pi)."""
    wrapped: FloatArray = np.mod(angle + np.pi, 2 * np.pi) - np.pi
    return np.where(wrapped >= np.pi, -np.pi, wrapped)


def cartesian(viewpoint: FloatArray) -> FloatArray:
    """Return camera positions (..., 3) [m] in the scenario's frame, whose origin is its centre, z up."""
    distance, azimuth, polar = np.moveaxis(viewpoint, -1, 0)
    level = distance * np.sin(polar)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), distance * np.cos(polar)], axis=-1)


def spherical(position: FloatArray) -> FloatArray:
    """Return the viewpoints (..., 3) of camera positions (..., 3) [m] around the centre: what `cartesian` undoes.

    At the centre itself the azimuth is 0, and the polar angle a right one.
    """
    distance = np.linalg.norm(position, axis=-1)
    azimuth = wrap_azimuth(np.arctan2(position[..., 1], position[..., 0]))
    polar = np.arccos(position[..., 2] / np.maximum(distance, np.finfo(np.float64).tiny))
    return np.stack([distance, azimuth, polar], axis=-1)


def away_from(viewpoint: FloatArray, gaze: FloatArray) -> FloatArray:
    """Return viewpoints (..., 3) with cameras' distance from what they look at, `gaze` (..., 3) from the centre [m]."""
    away = viewpoint.copy()
    away[..., DISTANCE] = np.linalg.norm(cartesian(viewpoint) - gaze, axis=-1)
    return away


def turned(vectors: FloatArray, begin: FloatArray, end: FloatArray) -> FloatArray:
    """Return vectors (..., P, J, 3) turned as the directions `begin` (..., 3) are on the shortest way to `end`.

    Rodrigues' formula; no direction is opposite to its end.
    """
    one, other = (way / np.linalg.norm(way, axis=-1, keepdims=True) for way in (begin, end))
    axis = np.cross(one, other)[..., None, None, :]
    share = 1 / (1 + (one * other).sum(axis=-1))[..., None, None, None]
    across = np.cross(axis, vectors)
    result: FloatArray = vectors + across + share * np.cross(axis, across)
    return result


def apply_moves(viewpoint: FloatArray, moves: IntArray, workspace: Workspace) -> FloatArray:
    """Return the viewpoints that grid moves lead to: middles of cells; a move out of the workspace stays in its cell.

    Args:
        viewpoint: (..., 3), on the grid or within half a cell of it.
        moves: (...,) indices into `MOVES`.
        workspace: the bounds.
    """
    cells = workspace.to_cells(viewpoint)
    there = cells + MOVES[moves]
    last = np.array(workspace.cells) - 1
    inside = ((there >= 0) & (there <= last) | (np.arange(3) == AZIMUTH)).all(axis=-1)
    return workspace.from_cells(np.where(inside[..., None], there, cells))


def neighbours(viewpoint: FloatArray, workspace: Workspace) -> FloatArray:
    """Return where each of the 7 moves leads, (..., 7, 3), from viewpoints (..., 3)."""
    tiled = np.repeat(np.asarray(viewpoint)[..., None, :], len(MOVES), axis=-2)
    return apply_moves(tiled, np.broadcast_to(np.arange(len(MOVES)), tiled.shape[:-1]), workspace)
