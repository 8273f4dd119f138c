"""The contract of a motion, which carries the camera, and `GridMotion`: the paper's 7 moves."""

from typing import Protocol, runtime_checkable

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.streams.following import CentreMotion
from ehar.viewpoint import AZIMUTH, DISTANCE, HOVER, POLAR, Workspace, apply_moves


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
class FollowingMotion(Protocol):
    """A motion that can also be told how to move."""

    def follow(self, states: FloatArray) -> FloatArray:
        """Move for one frame along a path and return the viewpoints reached, (B, 3).

        Args:
            states: (B, F, 3, 3) after each of the next F frames: viewpoint, velocity, acceleration.
        """
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
    """The paper's ideal camera: one of 7 moves per frame, at any frame rate (Sec. 3)."""

    def __init__(self, *, workspace: Workspace | None = None) -> None:
        """Create the motion; `workspace` has the grid, and defaults to the paper's."""
        self.workspace = workspace or Workspace()
        self._viewpoint: FloatArray = np.empty((0, 3))

    def reset(self, viewpoint: FloatArray, frame_time: float) -> None:
        """Begin at viewpoints (B, 3); the frame time does not matter to the grid."""
        self._viewpoint = np.array(viewpoint)

    def advance(self, target: FloatArray) -> FloatArray:
        """Make the move that `move_towards` picks and return the viewpoints reached, (B, 3)."""
        moves = move_towards(self._viewpoint, target, self.workspace)
        self._viewpoint = apply_moves(self._viewpoint, moves, self.workspace)
        return self._viewpoint

    @property
    def velocity(self) -> FloatArray:
        """Zeros (B, 3): the grid jumps from cell to cell."""
        return np.zeros(self._viewpoint.shape)

    @property
    def acceleration(self) -> FloatArray:
        """Zeros (B, 3), as for the velocity."""
        return np.zeros(self._viewpoint.shape)
