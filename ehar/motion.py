"""The contract of a motion, which carries the camera, and `GridMotion`: the paper's 7 moves."""

from copy import copy
from typing import Protocol, runtime_checkable

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.localisation import CentreMotion
from ehar.obstacles.free_space import FreeSpace, needed_clearance
from ehar.obstacles.surroundings import Surroundings
from ehar.viewpoint import AZIMUTH, DISTANCE, HOVER, MOVES, POLAR, Workspace, apply_moves, neighbours


class Motion(Protocol):
    """The body that carries the camera: it takes targets and returns the viewpoints that it reaches."""

    workspace: Workspace

    def reset(self, viewpoint: FloatArray, frame_time: float) -> None:
        """Begin at rest at viewpoints (B, 3); a frame lasts `frame_time` [s]."""

    def advance(self, target: FloatArray) -> FloatArray:
        """Move for one frame towards targets (B, 3) and return the viewpoints reached, (B, 3)."""
        ...

    @property
    def velocity(self) -> FloatArray:
        """The rates of distance, azimuth and polar angle, (B, 3) [m/s], [rad/s]; 0 on the grid."""
        ...

    @property
    def acceleration(self) -> FloatArray:
        """The derivatives of `velocity`, (B, 3) [m/s^2], [rad/s^2]; 0 on the grid."""
        ...


@runtime_checkable
class KeepsClear(Protocol):
    """A motion that keeps clear of obstacles: those of ehar do."""

    def keep_clear(self, surroundings: Surroundings | None) -> None:
        """Take what stands around the episodes to come, before a reset; None is an open world."""
        ...


def keep_clear(motion: Motion, surroundings: Surroundings | None) -> None:
    """Tell a motion what stands around the episodes to come; your own motion need not know."""
    if isinstance(motion, KeepsClear):
        motion.keep_clear(surroundings)


@runtime_checkable
class FollowingMotion(Protocol):
    """A motion that can also be told how to move."""

    def follow(self, states: FloatArray) -> FloatArray:
        """Move for one frame along a path and return the viewpoints reached, (B, 3).

        Args:
            states: (B, F, 3, 3) after each of the next F frames: viewpoint, velocity, acceleration.
        """
        ...


@runtime_checkable
class ForkedMotion(Protocol):
    """A motion that can be tried before it is made: those of ehar can."""

    def forked(self, paths: int) -> Motion:
        """Return a motion of B x `paths` cameras that go on from here: those of the first one first."""
        ...


@runtime_checkable
class CarriedMotion(Protocol):
    """A motion around a centre that may move, which counts for what it demands of a vehicle."""

    centre: CentreMotion | None  # each (B, L, 3); set before the reset


def heading(targets: FloatArray) -> FloatArray:
    """Return where targets (B, 3), or paths (B, F, 3, 3), lead to in the end, (B, 3)."""
    given = np.array(targets, dtype=np.float64, ndmin=1)
    return given[:, -1, 0] if given.ndim == 4 and given.shape[1] else given


def move(motion: Motion, targets: FloatArray) -> FloatArray:
    """Move for one frame, to targets (B, 3) or along paths (B, F, 3, 3), and return the viewpoints reached, (B, 3).

    A motion that follows no paths heads for their first viewpoints.
    """
    if targets.ndim == 2:
        return motion.advance(targets)
    return motion.follow(targets) if isinstance(motion, FollowingMotion) else motion.advance(targets[:, 0, 0])


def move_towards(viewpoint: FloatArray, target: FloatArray, workspace: Workspace) -> IntArray:
    """Return the moves (...,) that lower the largest remaining axis error, counted in cells.

    Targets are first clipped to the cells of the workspace. If every error is at most half a cell, the camera hovers.
    If two errors are equal, the first axis wins: distance, azimuth, polar angle.
    """
    wanted = (workspace.clip(target) - workspace.origin) / workspace.step
    for axis in (DISTANCE, POLAR):  # a bound may lie beyond the last cell, and no move leads there
        wanted[..., axis] = np.minimum(wanted[..., axis], workspace.cells[axis] - 1)
    error = wanted - workspace.to_cells(viewpoint)
    turn = workspace.cells[AZIMUTH]
    error[..., AZIMUTH] = (error[..., AZIMUTH] + turn / 2) % turn - turn / 2
    axis = np.argmax(np.abs(error), axis=-1)
    largest = np.take_along_axis(error, axis[..., None], axis=-1)[..., 0]
    moves: IntArray = np.where(np.abs(largest) <= 0.5 + 1e-9, HOVER, 2 * axis + (largest < 0))
    return moves


class GridMotion:
    """The paper's ideal camera: one of 7 moves per frame, at any frame rate (Sec. 3).

    Among obstacles it takes the shortest free way: `move_towards` as long as that leads to the target, or else a
    shortest way through free cells. A target in no free cell stands for the nearest free one. Where the centre moves,
    as it does in streams, or passers-by come near, the free cells change in every frame; then it makes the free move
    that gets nearest to the target, and without any the one that keeps clearest.
    """

    def __init__(self, *, workspace: Workspace | None = None) -> None:
        """Create the motion; `workspace` has the grid, and defaults to the paper's."""
        self.workspace = workspace or Workspace()
        self._viewpoint: FloatArray = np.empty((0, 3))
        self._surroundings: Surroundings | None = None

    def keep_clear(self, surroundings: Surroundings | None) -> None:
        """Keep clear of obstacles from the next reset on; None is an open world."""
        self._surroundings = surroundings

    def reset(self, viewpoint: FloatArray, frame_time: float) -> None:
        """Begin at viewpoints (B, 3); the frame time does not matter to the grid."""
        self._frame = 0
        self.put(viewpoint)

    def put(self, viewpoint: FloatArray) -> None:
        """Put the cameras at viewpoints (B, 3) in the present frame."""
        self._viewpoint = np.array(viewpoint)
        self._direct: BoolArray = np.zeros(len(viewpoint), dtype=bool)  # which moves to the targets of before were free
        self._target = np.full(self._viewpoint.shape, np.nan)
        none: FloatArray = np.empty((0, 3))
        self._ways = [none] * len(viewpoint)  # what is left of shortest ways to those targets

    def forked(self, paths: int) -> "GridMotion":
        """Return a motion of B x `paths` cameras that go on from here, each for itself.

        Those of the first camera come first, then those of the second.
        """
        rows = np.repeat(np.arange(len(self._viewpoint)), paths)
        fork = copy(self)
        fork._viewpoint, fork._direct, fork._target = self._viewpoint[rows], self._direct[rows], self._target[rows]
        fork._ways = [self._ways[row] for row in rows]
        fork._surroundings = None if self._surroundings is None else self._surroundings.select(rows)
        return fork

    def advance(self, target: FloatArray) -> FloatArray:
        """Make a move towards targets and return the viewpoints reached, (B, 3)."""
        self._frame += 1
        around = self._surroundings
        if around is None or not around.can_be_hit:
            moves = move_towards(self._viewpoint, target, self.workspace)
            self._viewpoint = apply_moves(self._viewpoint, moves, self.workspace)
        elif around.moved is None and not around.meets_passers:
            self._viewpoint = self._by_free_cells(target, FreeSpace.of(self.workspace, around.obstacles))
        else:
            self._viewpoint = self._by_clearance(target, around)
        return self._viewpoint

    def _by_free_cells(self, target: FloatArray, space: FreeSpace) -> FloatArray:
        """Return the next viewpoints on shortest free ways to targets (B, 3)."""
        target = space.nearest(self.workspace.clip(target))
        held = (target == self._target).all(axis=1)
        asked = ~(self._direct & held)
        self._direct[asked] = self._leads_there(self._viewpoint[asked], target[asked], space)
        self._target = target
        for row in np.flatnonzero(~self._direct & ~held):
            self._ways[row] = space.way(self._viewpoint[row], target[row], space.free.size)
        moves = move_towards(self._viewpoint, target, self.workspace)
        reached = space.after(self._viewpoint, moves)
        for row in np.flatnonzero(~self._direct):
            way, self._ways[row] = self._ways[row][:1], self._ways[row][1:]
            reached[row] = way[0] if len(way) else self._viewpoint[row]
        return reached

    def _leads_there(self, viewpoint: FloatArray, target: FloatArray, space: FreeSpace) -> BoolArray:
        """Return from which viewpoints (B, 3) `move_towards` leads to targets (B, 3) through free cells only."""
        free: BoolArray = np.ones(len(viewpoint), dtype=bool)
        moving = np.flatnonzero(free)
        here = viewpoint.copy()
        while len(moving):
            moves = move_towards(here[moving], target[moving], self.workspace)
            here[moving] = apply_moves(here[moving], moves, self.workspace)
            free[moving] = space.is_free(here[moving])
            moving = moving[(moves != HOVER) & free[moving]]
        return free

    def _by_clearance(self, target: FloatArray, around: Surroundings) -> FloatArray:
        """Return the next viewpoints towards targets (B, 3) where free cells change from frame to frame."""
        there = neighbours(self._viewpoint, self.workspace)  # (B, 7, 3)
        clearance = around.clearance(there, self._frame)
        free = clearance >= needed_clearance(there, self.workspace)
        way = self.workspace.to_cells(self.workspace.clip(target))[:, None] - self.workspace.to_cells(there)
        turn = self.workspace.cells[AZIMUTH]
        way[..., AZIMUTH] = (way[..., AZIMUTH] + turn // 2) % turn - turn // 2
        left = np.abs(way).sum(axis=-1).astype(np.float64)
        preferred = move_towards(self._viewpoint, target, self.workspace)[:, None] == np.arange(len(MOVES))
        worth = np.where(free, -left + 0.5 * preferred, clearance - left.max() - 1e3)
        return np.take_along_axis(there, worth.argmax(axis=1)[:, None, None], axis=1)[:, 0]

    @property
    def velocity(self) -> FloatArray:
        """Zeros (B, 3): the grid jumps from cell to cell."""
        return np.zeros(self._viewpoint.shape)

    @property
    def acceleration(self) -> FloatArray:
        """Zeros (B, 3), as for the velocity."""
        return np.zeros(self._viewpoint.shape)
