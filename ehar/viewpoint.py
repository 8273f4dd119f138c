"""Viewpoints (distance [m], azimuth [rad], polar angle [rad]): workspace, start grid and the 7 moves.

The polar angle is measured from straight above: 0 looks down from the top, pi/2 is level with the people.
The paper calls it elevation (Sec. 3); its Figure 6 and its V-Rotate only make sense with this reading.
"""

from dataclasses import dataclass

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray

DISTANCE, AZIMUTH, POLAR = 0, 1, 2

DISTANCE_STEP = 0.1  # [m], Sec. 3: "small translation"
ANGLE_STEP = np.radians(3.6)  # [rad], Sec. 3: "small ... rotation"
STEP = np.array([DISTANCE_STEP, ANGLE_STEP, ANGLE_STEP])

START_DISTANCE = 5.0  # [m], Sec. 5.1: the nearest start
START_CELLS = np.array([100, 100, 25])  # Sec. 5.1: |P_0| = 100 * 100 * 25 = 250,000
AZIMUTH_CELLS = 100  # a full turn

# Sec. 5.2: a = 0/1 raises/lowers the distance, 2/3 the azimuth, 4/5 the polar angle, 6 hovers. In cells.
MOVES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [0, 0, 0]])
MOVE_NAMES = ("distance+", "distance-", "azimuth+", "azimuth-", "polar+", "polar-", "hover")
HOVER = 6


@dataclass(frozen=True)
class Workspace:
    """The viewpoints that a camera may take: the closed hull of the start viewpoints (Sec. 5.1), with any azimuth.

    Args:
        distance_min: nearest distance to the centre [m].
        distance_max: farthest distance to the centre [m].
        polar_min: smallest polar angle [rad]; 0 is straight above.
        polar_max: largest polar angle [rad]; pi/2 is level with the centre.
    """

    distance_min: float = 5.0
    distance_max: float = 15.0
    polar_min: float = 0.0
    polar_max: float = float(np.pi / 2)

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
    return wrapped


def cartesian(viewpoint: FloatArray) -> FloatArray:
    """Return camera positions (..., 3) [m] in the scenario's frame, whose origin is its centre, z up."""
    distance, azimuth, polar = np.moveaxis(viewpoint, -1, 0)
    level = distance * np.sin(polar)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), distance * np.cos(polar)], axis=-1)


def to_cells(viewpoint: FloatArray) -> IntArray:
    """Return the nearest grid cells (..., 3); a cell is the number of steps from (5 m, 0, 0)."""
    cells: IntArray = np.rint((viewpoint - np.array([START_DISTANCE, 0.0, 0.0])) / STEP).astype(np.int64)
    cells[..., AZIMUTH] %= AZIMUTH_CELLS
    return cells


def from_cells(cells: IntArray) -> FloatArray:
    """Return the viewpoints (..., 3) of grid cells (..., 3), azimuths in [0, 2 pi)."""
    wrapped = np.array(cells)
    wrapped[..., AZIMUTH] %= AZIMUTH_CELLS
    viewpoint: FloatArray = np.array([START_DISTANCE, 0.0, 0.0]) + wrapped * STEP
    return viewpoint


def apply_moves(viewpoint: FloatArray, moves: IntArray, workspace: Workspace) -> FloatArray:
    """Return the viewpoints that grid moves lead to; a move out of the workspace leaves the camera where it is.

    Args:
        viewpoint: (..., 3), on the grid or within half a cell of it.
        moves: (...,) indices into `MOVES`.
        workspace: the bounds.
    """
    here = from_cells(to_cells(viewpoint))
    there = from_cells(to_cells(viewpoint) + MOVES[moves])
    return np.where(workspace.contains(there)[..., None], there, here)


def neighbours(viewpoint: FloatArray, workspace: Workspace) -> FloatArray:
    """Return where each of the 7 moves leads, (..., 7, 3), from viewpoints (..., 3)."""
    tiled = np.repeat(np.asarray(viewpoint)[..., None, :], len(MOVES), axis=-2)
    return apply_moves(tiled, np.broadcast_to(np.arange(len(MOVES)), tiled.shape[:-1]), workspace)


def sample_starts(rng: np.random.Generator, count: int) -> FloatArray:
    """Return start viewpoints (count, 3), uniform over the 250,000 of Sec. 5.1."""
    return from_cells(rng.integers(0, START_CELLS, size=(count, 3)))
