"""How much of people is seen from a viewpoint, given what is in the way and where people are thought to be."""

from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.obstacles.passers import FLOOR, PASSER_RADIUS, PASSER_TOP
from ehar.obstacles.shapes import Coordinates, Obstacles, coordinates, cylinder_cuts, moved, passes_by
from ehar.viewpoint import AZIMUTH, cartesian

# A person as seen from the side: an upright strip, three points high and three across.
HEIGHTS = np.array([[-0.7], [0.0], [0.6]])  # [m], from the mean of the joints
ACROSS = np.array([-0.25, 0.0, 0.25])  # [m]
ASIDE = 0.26  # [m], farther from the middle than any of these, rounding included


def seen_share(
    viewpoint: FloatArray,
    position: FloatArray,
    obstacles: Obstacles,
    passers: FloatArray | None = None,
    ahead: FloatArray | float = 0.0,
    centre: FloatArray | None = None,
) -> FloatArray:
    """Return the share of people that is seen from viewpoints, 0 to 1, (B, ...).

    It is the share of free lines of sight to points on people. Each person is an upright strip that faces the camera.
    Each passer-by is an upright cylinder, as nobody tells how they hold their limbs.

    Args:
        viewpoint: (B, ..., 3).
        position: (B, P, 3) where people are thought to be, the mean of their joints [m].
        obstacles: what stands there.
        passers: (B, W, 4) place and velocity of passers-by [m], [m/s]; they walk straight on. None if there are none.
        ahead: how far ahead the viewpoints are [s]; or (N,), for viewpoints (B, N, ..., 3).
        centre: (B, 3) where the centre is, from where it was in the first frame [m]; None if it has stayed.
    """
    if not obstacles and passers is None:
        return np.ones(viewpoint.shape[:-1])
    person = position.reshape(len(position), *[1] * (viewpoint.ndim - 2), *position.shape[1:])
    cameras = np.broadcast_to(cartesian(viewpoint)[..., None, :], (*viewpoint.shape[:-1], *position.shape[1:]))
    lines = _Lines(cameras, np.broadcast_to(person, cameras.shape), viewpoint[..., AZIMUTH])
    shift = np.zeros((len(position), 3)) if centre is None else centre
    hidden = np.zeros((*cameras.shape[:-1], len(HEIGHTS), len(ACROSS)), dtype=bool)
    for shape in obstacles.shapes:
        near, begin, end = lines.near(shape.centre[:2] - shift[:, :2], shape.reach)
        by = shift[np.nonzero(near)[0]].T[..., None, None]
        hidden[near] |= shape.cuts(_single(moved(begin, by)), _single(moved(end, by)))
    times = np.asarray(ahead)
    walkers = np.empty((len(position), 0, 4)) if passers is None else passers
    for walker in np.moveaxis(walkers, 1, 0):
        begun, pace = walker[:, :2], walker[:, 2:]
        place = begun + times * pace if times.ndim == 0 else begun[:, None] + times[:, None] * pace[:, None]
        near, begin, end = lines.near(place, PASSER_RADIUS)
        to_axis = np.zeros((3, len(begin[0]), 1, 1), dtype=np.float32)
        to_axis[:2, :, 0, 0] = -place[np.nonzero(near)[: place.ndim - 1]].T
        from_there, to_there = moved(_single(begin), to_axis), moved(_single(end), to_axis)
        hidden[near] |= cylinder_cuts(from_there, to_there, FLOOR, PASSER_TOP, PASSER_RADIUS)
    seen: FloatArray = 1 - hidden.mean(axis=(-3, -2, -1))
    return seen


def _single(points: Coordinates) -> Coordinates:
    """Return coordinates of 32 bits, which are enough for lines of sight."""
    x, y, z = (part.astype(np.float32) for part in points)
    return x, y, z


class _Lines(NamedTuple):
    """The lines of sight from cameras to people.

    Args:
        cameras: (B, ..., P, 3) [m].
        people: (B, ..., P, 3), their middles [m].
        azimuth: (B, ...) of the cameras [rad].
    """

    cameras: FloatArray
    people: FloatArray
    azimuth: FloatArray

    def near(self, place: FloatArray, reach: float) -> tuple[BoolArray, Coordinates, Coordinates]:
        """Return the lines that something may be in the way of; few come near a thing.

        Args:
            place: (B, 2) where it is [m]; or (B, N, 2).
            reach: its radius [m].

        Returns:
            of which people it may hide a part, (B, ..., P), and the ends of these n lines: the cameras, (n, 1, 1), and
            the points on people, (n, 1, 3) across and (n, 3, 1) up [m].
        """
        there = place.reshape(*place.shape[:-1], *[1] * (self.cameras.ndim - place.ndim), 2)
        near = passes_by(self.cameras, self.people, there, reach + ASIDE)
        azimuth = np.broadcast_to(self.azimuth[..., None], near.shape)[near][:, None, None]
        begin, middle = (coordinates(ends[near][:, None, None]) for ends in (self.cameras, self.people))
        x, y, z = middle
        return near, begin, (x - ACROSS * np.sin(azimuth), y + ACROSS * np.cos(azimuth), z + HEIGHTS)
