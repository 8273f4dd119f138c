"""The cells of a grid from which a camera keeps clear of obstacles, and the shortest ways between them."""

import math
from collections import OrderedDict
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray, read_only
from ehar.errors import UsageError
from ehar.obstacles.shapes import MARGIN, Obstacles
from ehar.viewpoint import AZIMUTH, Workspace, apply_moves, cartesian

if TYPE_CHECKING:
    from scipy.sparse import csr_array

BODY = np.array([[0, 0, -0.5], [0, 0, 0], [0, 0, 0.5]])  # [m], of somebody at the centre
MOST_CELLS = 10_000_000  # each takes about 100 bytes while free ones are looked for
FEW_CELLS = 64  # that are asked at once whether they see anybody
WAYS = 64  # goals whose shortest ways are remembered, a few bytes for each cell


class FreeSpace:
    """The free cells of a workspace with obstacles in it.

    A cell is free if a camera there keeps the margin, and if half a move from there does not lead to an obstacle, or
    nearer than is said. So no move from a free cell to another passes through one. Of the parts that free cells fall
    into, only the largest counts: no way leads to the others.

    Args:
        workspace: the bounds, and the grid.
        obstacles: what stands there.
        between: the clearance that moves between free cells keep too [m].

    Raises:
        UsageError: there are too many cells, none is free, or none that is free sees somebody at the centre.
    """

    def __init__(self, workspace: Workspace, obstacles: Obstacles, between: float = 0.0) -> None:
        """Find the free cells."""
        self.workspace, self.obstacles = workspace, obstacles
        if math.prod(workspace.cells) > MOST_CELLS:
            raise UsageError(
                f"obstacles: expected a grid of at most {MOST_CELLS:,} cells around them, got "
                f"{math.prod(workspace.cells):,}: larger steps have fewer"
            )
        places, needed = _cells_of(workspace, between)
        clear = obstacles.clearance(places) >= needed
        if not clear.any():
            raise UsageError(f"obstacles: expected free space for cameras, all {clear.size} cells are in or near them")
        self.free = read_only(_largest_part(clear))  # motions and planners share a space
        seeing = np.array_split(places[self.free], max(1, int(self.free.sum()) // FEW_CELLS))
        if all(obstacles.hide(some, BODY[:, None]).all() for some in seeing):  # most often the first some see
            raise UsageError("obstacles: expected a cell that sees somebody at the centre, they hide everything")
        self._ways: OrderedDict[int, IntArray] = OrderedDict()

    @staticmethod
    @lru_cache(maxsize=4)
    def of(workspace: Workspace, obstacles: Obstacles, between: float = 0.0) -> "FreeSpace":
        """Return the free space of a workspace with obstacles; it is found once."""
        return FreeSpace(workspace, obstacles, between)

    def is_free(self, viewpoint: FloatArray) -> BoolArray:
        """Return whether the cells that viewpoints (..., 3) lie in are free, (...,)."""
        free: BoolArray = self.free[tuple(np.moveaxis(self.workspace.to_cells(viewpoint), -1, 0))]
        return free

    def after(self, viewpoint: FloatArray, moves: IntArray) -> FloatArray:
        """Return where moves (...,) lead from viewpoints (..., 3); one that leads to no free cell has no effect."""
        there = apply_moves(viewpoint, moves, self.workspace)
        return np.where(self.is_free(there)[..., None], there, viewpoint)

    def nearest(self, viewpoint: FloatArray) -> FloatArray:
        """Return viewpoints (..., 3) in free cells as they are, and of others the nearest free cell."""
        cells = self.workspace.to_cells(viewpoint)
        found = self._nearest_cells[tuple(np.moveaxis(cells, -1, 0))]
        return np.where(self.is_free(viewpoint)[..., None], viewpoint, self.workspace.from_cells(found))

    def centre(self, viewpoint: FloatArray) -> FloatArray:
        """Return the middle of the free cell that is nearest to viewpoints (..., 3)."""
        return self.workspace.from_cells(self.workspace.to_cells(self.nearest(viewpoint)))

    def way(self, viewpoint: FloatArray, goal: FloatArray, most: int) -> FloatArray:
        """Return the cells of the shortest way from a viewpoint (3,) to a goal (3,), the first `most`, (N, 3).

        N is 0 if the camera is there, or no way leads there.
        """
        here, there = (self._number(one) for one in (viewpoint, goal))
        after, cells = self._ways_to(there), list[int]()
        while here != there and len(cells) < most:
            here = int(after[here])
            if here < 0:
                return np.empty((0, 3))
            cells.append(here)
        numbers = np.array(np.unravel_index(np.array(cells, dtype=np.int64), self.free.shape)).T
        return self.workspace.from_cells(numbers)

    def ways(self, viewpoint: FloatArray, goals: FloatArray) -> FloatArray:
        """Return the cells of the shortest ways from a viewpoint (3,) to goals (G, 3), (G, N, 3), from the first on.

        They begin with the viewpoint's own cell. N is the longest; shorter ones stay at their goal. A goal that no way
        leads to is not left for.
        """
        numbers = np.ravel_multi_index(tuple(self.workspace.to_cells(goals).T), self.free.shape)
        before, here = self._ways_to(self._number(viewpoint)), self._number(viewpoint)
        back = [np.where((before[numbers] < 0) & (numbers != here), here, numbers)]
        while (back[-1] != here).any():
            back.append(np.where(back[-1] == here, here, before[back[-1]]))
        cells = np.stack(back[::-1], axis=1)  # shorter ways wait here at first: they come to the front
        waits = (cells == here).sum(axis=1) - 1
        order = np.minimum(np.arange(cells.shape[1]) + waits[:, None], cells.shape[1] - 1)
        forward = np.take_along_axis(cells, order, axis=1)
        found = np.stack(np.unravel_index(forward, self.free.shape), axis=-1)
        return self.workspace.from_cells(found)

    def _number(self, viewpoint: FloatArray) -> int:
        return int(np.ravel_multi_index(tuple(self.workspace.to_cells(viewpoint)), self.free.shape))

    def _ways_to(self, goal: int) -> IntArray:
        """Return for each cell the next one on its shortest way to a goal; below 0 if there is none."""
        from scipy.sparse.csgraph import breadth_first_order  # imported here: too slow for `ehar --help`

        if goal not in self._ways:
            _, after = breadth_first_order(self._graph, goal)
            self._ways[goal] = read_only(after)
            if len(self._ways) > WAYS:
                self._ways.popitem(last=False)
        self._ways.move_to_end(goal)
        return self._ways[goal]

    @cached_property
    def _graph(self) -> "csr_array":
        """The moves between free cells."""
        from scipy.sparse import coo_array  # imported here: too slow for `ehar --help`

        number = np.arange(self.free.size, dtype=np.int32).reshape(self.free.shape)
        begins, ends = [], []
        for axis in range(3):
            after = np.roll(number, -1, axis=axis)
            free = self.free & np.roll(self.free, -1, axis=axis)
            if axis != AZIMUTH:
                np.moveaxis(free, axis, 0)[-1] = False  # the last cell has no neighbour
            begins += [number[free], after[free]]
            ends += [after[free], number[free]]
        begin, end = np.concatenate(begins), np.concatenate(ends)
        return coo_array((np.ones(len(begin)), (begin, end)), shape=(self.free.size,) * 2).tocsr()

    @cached_property
    def _nearest_cells(self) -> IntArray:
        """The nearest free cell of each, (*cells, 3), if all steps were as long as at the middle distance and level."""
        from scipy.ndimage import distance_transform_edt  # imported here: too slow for `ehar --help`

        space, turn = self.workspace, self.free.shape[AZIMUTH]
        middle = (space.distance_min + space.distance_max) / 2
        half = turn // 2 + 1
        wrapped = np.pad(self.free, ((0, 0), (half, half), (0, 0)), mode="wrap")
        sampling = (space.distance_step, middle * space.angle_step, middle * space.angle_step)
        found = distance_transform_edt(~wrapped, sampling, return_distances=False, return_indices=True)
        cells: IntArray = np.moveaxis(found[:, :, half : half + turn], 0, -1).astype(np.int32)
        cells[..., AZIMUTH] = (cells[..., AZIMUTH] - half) % turn
        return read_only(cells)


@lru_cache(maxsize=1)  # in a stream, free cells of the same workspace are looked for again and again
def _cells_of(workspace: Workspace, between: float) -> tuple[FloatArray, FloatArray]:
    """Return where all cells are, (*cells, 3) [m], and the clearance [m] that each needs, (*cells)."""
    cells = np.stack(np.meshgrid(*map(np.arange, workspace.cells), indexing="ij"), axis=-1)
    viewpoints = workspace.from_cells(cells)
    places = read_only(cartesian(viewpoints).astype(np.float32))
    return places, read_only(needed_clearance(viewpoints, workspace, between))


def needed_clearance(viewpoint: FloatArray, workspace: Workspace, between: float = 0.0) -> FloatArray:
    """Return the clearance [m] that viewpoints (..., 3) need so that moves between two lead through no obstacle.

    Of a straight way of length s, one end is within s / 2 of the place of the way that is nearest to a point. So if
    both ends are n away from that point, all of the way is at least sqrt(n^2 - (s / 2)^2) away: that is `between`.
    """
    step = np.maximum(viewpoint[..., 0] * workspace.angle_step, workspace.distance_step)
    needed: FloatArray = np.maximum(MARGIN, np.hypot(between, step / 2))
    return needed


def _largest_part(clear: BoolArray) -> BoolArray:
    """Return the largest part of cells that moves connect; the last azimuth is beside the first."""
    from scipy.ndimage import label  # imported here: too slow for `ehar --help`
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    parts, count = label(clear)
    beside = clear[:, 0] & clear[:, -1]
    first, last = parts[:, 0][beside], parts[:, -1][beside]
    joined = coo_array((np.ones(len(first)), (first, last)), shape=(count + 1,) * 2)
    _, part = connected_components(joined, directed=False)
    sizes = np.bincount(part[parts[clear]], minlength=count + 1)
    largest: BoolArray = clear & (part[parts] == sizes.argmax())
    return largest
