"""Keeps flights clear of obstacles: whether a flight does, and where to fly first if the straight way does not."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.flight.centre import SPEED_UP, ways_ahead
from ehar.flight.profile import JerkProfile
from ehar.obstacles.free_space import FreeSpace
from ehar.obstacles.passers import passing_clearance
from ehar.obstacles.shapes import MARGIN, Obstacles
from ehar.viewpoint import AZIMUTH, DISTANCE, Workspace, cartesian, wrap_difference

PLANNED = MARGIN + 0.05  # [m] that plans keep, so that the margin also holds between samples
SPARE = 0.005  # [m] more that ways around obstacles keep, so that a straight flight along one is valid
FINEST = 0.06  # [m], the longest way between two samples of a flight
COARSEST = 8  # samples of a flight in the first pass
CORNERS = 24  # places, spread over a way around obstacles, that may be flown to first
NEXT = 4  # and the first places of the way, where no other is in sight
LONGEST = 400  # cells of such a way
ASTRAY = 0.15  # [m], three standard deviations of the error with which passers-by are tracked
FORESEEN = 3.0  # [s] for which passers-by are thought to walk straight on; after it they may be anywhere


class Around(NamedTuple):
    """What stands around cameras now, and how their people carry them along.

    Attributes:
        obstacles: what stands there.
        moved: (B, 3) how far people's centre, around which cameras fly, is from the obstacles' origin [m].
        walking: (B, 3) the velocity of that centre [m/s]; people may walk on for a while.
        speeding_up: (B, 3) its acceleration [m/s^2]; they may go on with that too, for less long.
        passers: (B, W, 4) place [m] and velocity [m/s] of passers-by, as tracked, relative to the centre; None if
            cameras meet none.
    """

    obstacles: Obstacles
    moved: FloatArray
    walking: FloatArray
    speeding_up: FloatArray
    passers: FloatArray | None = None

    def select(self, rows: IntArray) -> "Around":
        """Return that of some of the cameras."""
        passers = None if self.passers is None else self.passers[rows]
        return Around(self.obstacles, self.moved[rows], self.walking[rows], self.speeding_up[rows], passers)

    def clearance(self, cameras: FloatArray, times: FloatArray) -> FloatArray:
        """Return how clear cameras are on each of people's `ways_ahead`, (W, B, S) [m]; W is 1 if nobody moves.

        Args:
            cameras: (B, S, 3) relative to people's centre [m].
            times: (B, S) when they are there, from now on [s].
        """
        places = (cameras + self.moved[:, None])[None]
        if self.walking.any() or self.speeding_up.any():
            places = places + ways_ahead(times, self.walking, self.speeding_up)
        standing = self.obstacles.clearance(places)
        return standing if self.passers is None else np.minimum(standing, self._passing(cameras, times))

    def to_begin_with(self, cameras: FloatArray) -> FloatArray:
        """Return how clear cameras (B, S, 3) are if they stay, (W, B, S) [m].

        It is how clear they end up of what stands there, and how clear they now are of passers-by.
        """
        ever, now = (np.full((1, 1), time) for time in (np.inf, 0.0))
        standing = self._replace(passers=None).clearance(cameras, ever)
        return standing if self.passers is None else np.minimum(standing, self._passing(cameras, now))

    @property
    def fastest(self) -> FloatArray:
        """The speed of the fastest passer-by, (B,) [m/s]; 0 if there is none."""
        if self.passers is None:
            return np.zeros(len(self.moved))
        return np.asarray(np.linalg.norm(self.passers[..., 2:], axis=-1).max(axis=-1, initial=0))

    def _passing(self, cameras: FloatArray, times: FloatArray) -> FloatArray:
        """Return how clear cameras (B, S, 3) are of passers-by who walk straight on, at times (B, S), (B, S) [m].

        They may be `ASTRAY` nearer than they are thought to be.
        """
        assert self.passers is not None
        ways = np.moveaxis(self.passers[:, None], 2, 0)  # (W, B, 1, 4)
        places = (way[..., :2] + times[..., None] * way[..., 2:] for way in ways)
        clearance = passing_clearance(cameras, places, self.moved[:, None, 2])
        return np.where(times > FORESEEN, np.inf, clearance - ASTRAY)


def keeps_clear(profile: JerkProfile, around: Around, speed: float) -> BoolArray:
    """Return which flights keep clear of obstacles until they are at rest, (B,).

    A camera gets no farther between two samples than its speed allows. So a flight with large clearance needs few
    samples, and only those that come near are sampled more finely. A flight that begins nearer to an obstacle than
    plans keep may not get nearer. That is so if people stay. If they walk on, or speed up, it may not get nearer than
    plans keep either, or than that brings a camera that stays. Passers-by walk straight on for `FORESEEN`.

    Args:
        profile: B flights.
        around: what stands around them.
        speed: the highest that a camera reaches, with that of people who do not speed up [m/s].
    """

    def spare(rows: IntArray, shares: FloatArray) -> FloatArray:
        part, here = profile.select(rows), around.select(rows)
        times = part.duration[:, None] * shares
        cameras = cartesian(part.at(times).viewpoint)
        begun = here.to_begin_with(cameras[:, :1])
        return np.asarray((here.clearance(cameras, times) - np.minimum(PLANNED, begun - 1e-6)).min(axis=(0, 2)))

    highest = speed + SPEED_UP * np.linalg.norm(around.speeding_up, axis=1) + around.fastest
    return _keep_throughout(spare, highest * profile.duration)


def free_space_of_flights(workspace: Workspace, obstacles: Obstacles) -> FreeSpace:
    """Return the free space in which flights go around obstacles."""
    return FreeSpace.of(workspace, obstacles, PLANNED + SPARE)


def first_towards(here: FloatArray, target: FloatArray, space: FreeSpace) -> FloatArray:
    """Return where cameras fly first to get to their targets, (B, 3): there, or as far as a free way is in sight.

    Args:
        here: (B, 3) viewpoints.
        target: (B, 3) viewpoints; one too near to an obstacle stands for the nearest free cell.
        space: the free space of flights.
    """
    near = space.obstacles.clearance(cartesian(target)) < PLANNED
    goals = np.where(near[:, None], space.nearest(target), target)
    for row in np.flatnonzero(~_in_sight(here, goals, space.obstacles)):
        begin = space.centre(here[row])
        way = np.concatenate([begin[None], space.way(begin, space.nearest(goals[row]), LONGEST)])
        spread = np.linspace(0, len(way) - 1, CORNERS).astype(np.int64)
        corners = way[np.union1d(np.arange(min(NEXT, len(way))), spread)]
        seen = np.flatnonzero(_in_sight(np.broadcast_to(here[row], corners.shape), corners, space.obstacles))
        goals[row] = corners[seen[-1] if len(seen) else 0]
    return goals


def leads_nearer(here: FloatArray, there: FloatArray, target: FloatArray, space: FreeSpace) -> BoolArray:
    """Return whether the free way to targets is shorter from there than from here, (B,); each viewpoint is (B, 3)."""
    begin, end, goal = (space.nearest(one) for one in (here, there, target))
    lengths = [[len(space.way(*way, LONGEST)) for way in zip(ends, goal, strict=True)] for ends in (begin, end)]
    nearer: BoolArray = np.greater(*np.array(lengths))
    return nearer


def _in_sight(here: FloatArray, there: FloatArray, obstacles: Obstacles) -> BoolArray:
    """Return between which viewpoints (B, 3) the straight way, in their coordinates, keeps clear, (B,)."""
    way = there - here
    way[:, AZIMUTH] = wrap_difference(way[:, AZIMUTH])

    def spare(rows: IntArray, shares: FloatArray) -> FloatArray:
        clearance = obstacles.clearance(cartesian(here[rows, None] + shares[:, None] * way[rows, None]))
        return np.asarray(clearance.min(axis=1) - np.minimum(PLANNED + SPARE, clearance[:, 0] - 1e-6))

    farthest = np.maximum(here[:, DISTANCE], there[:, DISTANCE])
    return _keep_throughout(spare, np.abs(way[:, DISTANCE]) + farthest * np.abs(way[:, AZIMUTH:]).sum(axis=1))


def _keep_throughout(spare: Callable[[IntArray, FloatArray], FloatArray], length: FloatArray) -> BoolArray:
    """Return which ways have clearance to spare throughout, (B,).

    Args:
        spare: the least that ways of rows (n,) have at shares (S,) of them, from 0 to 1, (n,) [m]; it is below 0 where
            one comes too near.
        length: (B,) at most how long ways are [m].
    """
    keeps: BoolArray = np.ones(len(length), dtype=bool)
    undecided, samples = np.flatnonzero(keeps), COARSEST
    while len(undecided):
        least = spare(undecided, np.linspace(0, 1, samples + 1))
        keeps[undecided[least < 0]] = False
        farthest = length[undecided] / samples
        open_still = (least >= 0) & (least - farthest / 2 < 0)
        undecided, samples = undecided[open_still & (farthest > FINEST)], 4 * samples
    return keeps
