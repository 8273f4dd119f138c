"""Keeps flights clear of obstacles: whether a flight does, and where to fly first if the straight way does not."""

from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.flight.centre import walked
from ehar.flight.profile import JerkProfile
from ehar.obstacles.free_space import FreeSpace
from ehar.obstacles.shapes import MARGIN, Obstacles
from ehar.viewpoint import AZIMUTH, cartesian, wrap_difference

PLANNED = MARGIN + 0.05  # [m] that plans keep, so that the margin also holds between samples
FINEST = 0.06  # [m], the longest way between two samples of a flight
COARSEST = 8  # samples of a flight in the first pass
WAY_SAMPLES = np.linspace(0, 1, 33)  # of a straight way
CORNERS = 24  # places on a way around obstacles that may be flown to first
LONGEST = 400  # cells of such a way


class Around(NamedTuple):
    """What stands around cameras now, and how their people carry them along.

    Attributes:
        obstacles: what stands there.
        moved: (B, 3) how far people's centre, around which cameras fly, is from the obstacles' origin [m].
        walking: (B, 3) the velocity of that centre [m/s]; people are expected to walk on for a while.
    """

    obstacles: Obstacles
    moved: FloatArray
    walking: FloatArray

    def select(self, rows: IntArray) -> "Around":
        """Return that of some of the cameras."""
        return Around(self.obstacles, self.moved[rows], self.walking[rows])

    def clearance(self, cameras: FloatArray, times: FloatArray) -> FloatArray:
        """Return how clear cameras are if people stay, and if they walk on: (W, B, S) [m]; W is 1 if nobody walks.

        Args:
            cameras: (B, S, 3) relative to people's centre [m].
            times: (B, S) when they are there, from now on [s].
        """
        walks = np.arange(1.0 + self.walking.any())[:, None, None, None]
        on = walks * walked(times, np.exp)[..., None] * self.walking[:, None]
        return self.obstacles.clearance(cameras + self.moved[:, None] + on)


def keeps_clear(profile: JerkProfile, around: Around, speed: float) -> BoolArray:
    """Return which flights keep clear of obstacles until they are at rest, (B,).

    A camera gets no farther between two samples than its speed allows. So a flight with large clearance needs few
    samples, and only those that come near are sampled more finely. A flight that begins nearer to an obstacle than
    plans keep may not get nearer. That is so if people stay. If they walk on for a while, it may not get nearer than
    plans keep either, or than walking on brings a camera that stays.

    Args:
        profile: B flights.
        around: what stands around them.
        speed: the highest that a camera reaches, with people's [m/s].
    """
    keeps: BoolArray = np.ones(len(profile.duration), dtype=bool)
    undecided, samples = np.flatnonzero(keeps), COARSEST
    while len(undecided):
        part, here = profile.select(undecided), around.select(undecided)
        times = part.duration[:, None] * np.linspace(0, 1, samples + 1)
        cameras = cartesian(part.at(times).viewpoint)
        begun = here.clearance(cameras[:, :1], np.full((1, 1), np.inf))
        spare = (here.clearance(cameras, times) - np.minimum(PLANNED, begun - 1e-6)).min(axis=(0, 2))
        keeps[undecided[spare < 0]] = False
        farthest = speed * part.duration / samples
        open_still = (spare >= 0) & (spare - farthest / 2 < 0)
        undecided, samples = undecided[open_still & (farthest > FINEST)], 4 * samples
    return keeps


def first_towards(here: FloatArray, target: FloatArray, space: FreeSpace) -> FloatArray:
    """Return where cameras fly first to get to their targets, (B, 3): there, or as far as a free way is in sight.

    Args:
        here: (B, 3) viewpoints.
        target: (B, 3) viewpoints; one too near to an obstacle stands for the nearest free cell.
        space: the free space.
    """
    near = space.obstacles.clearance(cartesian(target)) < PLANNED
    goals = np.where(near[:, None], space.nearest(target), target)
    for row in np.flatnonzero(~_in_sight(here, goals, space.obstacles)):
        way = space.way(space.nearest(here[row]), goals[row], LONGEST)
        corners = way[np.unique(np.linspace(0, len(way) - 1, CORNERS).astype(np.int64))] if len(way) else way
        seen = np.flatnonzero(_in_sight(np.broadcast_to(here[row], corners.shape), corners, space.obstacles))
        goals[row] = corners[seen[-1]] if len(seen) else (corners[0] if len(corners) else here[row])
    return goals


def _in_sight(here: FloatArray, there: FloatArray, obstacles: Obstacles) -> BoolArray:
    """Return between which viewpoints (B, 3) the straight way, in their coordinates, keeps clear, (B,)."""
    way = there - here
    way[:, AZIMUTH] = wrap_difference(way[:, AZIMUTH])
    along = here[:, None] + WAY_SAMPLES[:, None] * way[:, None]
    clearance = obstacles.clearance(cartesian(along))
    return np.asarray(clearance.min(axis=1) >= np.minimum(PLANNED, clearance[:, 0] - 1e-6))
