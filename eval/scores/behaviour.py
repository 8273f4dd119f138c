"""The behaviour of planners: where the camera is (Fig. 6), and which moves it makes (Fig. 7a-d).

Axes: N episodes, L frames, M moves.
"""

from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.errors import DataError
from ehar.viewpoint import AZIMUTH, DISTANCE, MOVES, POLAR, Workspace, wrap_difference
from eval.records.episodes import EpisodeRecords

STAGES = ("whole episode", "first third", "second third", "last third")
LEVEL_FROM = 85.0  # polar angle [deg], Sec. 5.2: from here the paper's agent is "at a same horizontal level"
SPHERE_CELLS = 30  # on each side of the plane that shows cameras from above
ON_GRID = 1e-4  # [m] or [rad]; records are rounded to 6 decimals

BINS = (20, 20, 13)  # about so many bins of distance, azimuth and polar angle


class Axis(NamedTuple):
    """One of the three dimensions of a viewpoint, as it is drawn.

    Args:
        name: distance, azimuth or polar angle.
        unit: m or deg.
        column: its index in a viewpoint.
        edges: edges of the bins, in that unit, halfway between cells of the grid. All bins of an axis but
            the last hold the same number of cells: bins of 5 degrees would hold one or two, and it would show.
        bounds: least and greatest value that a camera may have.
    """

    name: str
    unit: str
    column: int
    edges: FloatArray
    bounds: tuple[float, float]


def axes_of(workspace: Workspace) -> tuple[Axis, Axis, Axis]:
    """Return the axes of a workspace; in the paper's, the last of 20 bins of the distance holds 6 cells."""
    turn = float(np.degrees(workspace.angle_step))
    deep = (workspace.distance_min, workspace.distance_max)
    down = (float(np.degrees(workspace.polar_min)), float(np.degrees(workspace.polar_max)))
    return (
        Axis("distance", "m", DISTANCE, _edges(workspace, DISTANCE, workspace.distance_step, deep), deep),
        Axis("azimuth", "deg", AZIMUTH, _edges(workspace, AZIMUTH, turn, (0.0, 0.0)), (0.0, 360.0)),
        Axis("polar angle", "deg", POLAR, _edges(workspace, POLAR, turn, down), down),
    )


def _edges(workspace: Workspace, axis: int, step: float, bounds: tuple[float, float]) -> FloatArray:
    """Return edges around the cells of an axis, the same number to a bin; those left over go into the last one."""
    cells = workspace.cells[axis]
    each = max(1, cells // BINS[axis])
    inner = np.arange(0, cells - each + 1, each)
    edges: FloatArray = bounds[0] + step * (np.append(inner, cells) - 0.5)
    edges[-1] = max(edges[-1], bounds[1])  # a vehicle may be beyond the last cell
    return edges


class PositionHistogram(NamedTuple):
    """The histogram of the camera's positions along one axis, over all frames.

    Args:
        axis: the axis.
        density: density of frames in each bin [1/m] or [1/deg]; its integral is 1.
        mean: mean along the axis [m] or [deg]; None for the azimuth, which is a circle.
        std: standard deviation along the axis [m] or [deg]; None for the azimuth.
    """

    axis: Axis
    density: FloatArray
    mean: float | None
    std: float | None

    @property
    def from_uniform(self) -> float:
        """The total variation distance to the uniform distribution over the bins' range, 0 to 1."""
        width = np.diff(self.axis.edges)
        return float(0.5 * np.abs(self.density * width - width / width.sum()).sum())


def position_histograms(episodes: EpisodeRecords, workspace: Workspace) -> tuple[PositionHistogram, ...]:
    """Return the histograms of distance [m], azimuth [deg] and polar angle [deg] over all frames (Fig. 6)."""
    histograms = []
    for axis in axes_of(workspace):
        values = episodes.viewpoint[..., axis.column].ravel()
        shown = np.degrees(values) if axis.unit == "deg" else values
        turns = axis.column == AZIMUTH
        if turns:
            shown = (shown - axis.edges[0]) % 360 + axis.edges[0]
        density, _ = np.histogram(shown, axis.edges, density=True)
        ends = (None, None) if turns else (float(shown.mean()), float(shown.std()))
        histograms.append(PositionHistogram(axis, density, *ends))
    return tuple(histograms)


def level_share(episodes: EpisodeRecords) -> float:
    """Return the share of frames in which the camera is about level with the people, 85 degrees or more."""
    return float((np.degrees(episodes.viewpoint[..., POLAR]) >= LEVEL_FROM).mean())


class SphereDensity(NamedTuple):
    """The density of cameras on the upper half of the sphere, seen from above in an equal-area projection.

    Cameras that are equally often in all directions give an even disc. If cameras may be below the people, the disc
    reaches as far down as they may.

    Args:
        edges: (31,) edges of the cells, the same along both axes, from minus the disc's radius to plus.
        times_even: (30, 30), rows along y: the density relative to an even disc; NaN outside the disc.
    """

    edges: FloatArray
    times_even: FloatArray


def from_above(viewpoint: FloatArray) -> FloatArray:
    """Return where viewpoints (..., 3) lie in the plane, (..., 2); azimuth 0 is +x. Cameras above lie in the unit disc.

    Lambert's azimuthal equal-area projection from straight above: a point at azimuth a and polar angle p lies at the
    distance sqrt(2) sin(p / 2) from the middle, so that the level (p = 90 degrees) is the unit circle, and equal areas
    of the plane are equal parts of the sphere.
    """
    radius = np.sqrt(2) * np.sin(viewpoint[..., POLAR] / 2)
    azimuth = viewpoint[..., AZIMUTH]
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth)], axis=-1)


def sphere_density(viewpoint: FloatArray, workspace: Workspace) -> SphereDensity:
    """Return the density over all viewpoints (..., 3), at any distance."""
    rim = max(1.0, float(np.sqrt(2) * np.sin(workspace.polar_max / 2)))
    points = np.clip(from_above(viewpoint).reshape(-1, 2), -rim, rim)
    edges = np.linspace(-rim, rim, SPHERE_CELLS + 1)
    counts, _, _ = np.histogram2d(points[:, 1], points[:, 0], bins=(edges, edges))
    even = (2 / SPHERE_CELLS) ** 2 / np.pi * len(points)  # frames of a cell in an even disc
    nearest = np.clip(0.0, edges[:-1], edges[1:])  # the point of each cell that is nearest to the middle
    outside = np.hypot(nearest[:, None], nearest) >= rim
    return SphereDensity(edges, np.where(outside & (counts == 0), np.nan, counts / even))


def recover_moves(episodes: EpisodeRecords, workspace: Workspace) -> IntArray:
    """Return the moves between consecutive frames, (N, L - 1) indices into `ehar.viewpoint.MOVES`.

    These are the moves that the camera made: an action that would have led out of the workspace counts as hovering.

    Raises:
        DataError: a camera flew, is off the grid, or did not make exactly one move in a frame.
    """
    if episodes.flight is not None:
        raise DataError("moves: expected a run on the ideal track, got flights, which have no moves")
    viewpoint = episodes.viewpoint
    cells = workspace.to_cells(viewpoint)
    error = viewpoint - workspace.from_cells(cells)
    error[..., AZIMUTH] = wrap_difference(error[..., AZIMUTH])
    on_grid: BoolArray = np.abs(error).max(axis=-1) <= ON_GRID
    _check(on_grid, episodes, "a camera on the grid")
    change = np.diff(cells, axis=1)
    turn = workspace.cells[AZIMUTH]
    change[..., AZIMUTH] = (change[..., AZIMUTH] + turn // 2) % turn - turn // 2
    matches = (change[..., None, :] == MOVES).all(axis=-1)
    _check(matches.any(axis=-1), episodes, "one of the 7 moves to the next frame")
    moves: IntArray = matches.argmax(axis=-1)
    return moves


def _check(right: BoolArray, episodes: EpisodeRecords, expected: str) -> None:
    """Raise a DataError that names the first episode and frame where `right` (N, T) is False."""
    if not right.all():
        episode, frame = (int(index) for index in np.argwhere(~right)[0])
        raise DataError(
            f"moves: episode {episodes.sequence[episode]!r} from frame {episodes.first[episode]}, frame {frame}: "
            f"expected {expected}, got viewpoints {episodes.viewpoint[episode, frame : frame + 2].tolist()}"
        )


def move_shares(moves: IntArray) -> FloatArray:
    """Return how often each move is made, (4, 7): in the whole episode and in its three equal stages (Fig. 7a-d).

    Args:
        moves: (N, M) from `recover_moves`. 60 frames have 59 moves, in stages of 20, 20 and 19.

    Raises:
        DataError: there are too few moves for three stages.
    """
    steps = moves.shape[1]
    if steps < 3:
        raise DataError(f"moves: expected episodes of at least 4 frames, for three stages, got {steps + 1}")
    stage = 3 * np.arange(steps) // steps
    made = (moves[..., None] == np.arange(len(MOVES))).mean(axis=0)  # (M, 7)
    return np.stack([made.mean(axis=0), *(made[stage == part].mean(axis=0) for part in range(3))])
