"""A planner that goes to a place relative to people, and stays there."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from ehar.arrays import FloatArray
from ehar.localisation import Localisation
from ehar.planner import Context, Observation, Planner
from ehar.viewpoint import AZIMUTH, DISTANCE, POLAR, wrap_difference
from planners.place.people import PeopleTracker

SWITCH = float(np.radians(20))  # how much nearer another azimuth has to be, so that noise does not turn the camera back
NEAR = 0.1  # share of the way from the nearest to the farthest distance; the paper's workspace: 6 m
LEVEL = float(np.radians(75))  # polar angle, a little above level


@dataclass(frozen=True)
class Place:
    """A place relative to people.

    Args:
        distance: share of the way from the workspace's nearest distance, 0, to its farthest, 1; None is any distance:
            the camera keeps its own.
        azimuth: angle from the people's front, to either side [rad]; None is any azimuth: the camera keeps its own.
        polar: polar angle [rad].
        absolute: whether the azimuth is counted from the world's axis instead, and to one side.
    """

    distance: Annotated[float, Ge(0), Le(1)] | None
    azimuth: float | None
    polar: Annotated[float, Ge(0), Le(np.pi)]
    absolute: bool = False

    def __str__(self) -> str:
        """Return the place in words."""
        where = "any azimuth"
        if self.azimuth is not None:
            where = f"{np.degrees(self.azimuth):.0f} degrees from {'azimuth 0' if self.absolute else 'the front'}"
        distance = (
            "any distance" if self.distance is None else f"{100 * self.distance:.0f} % from the nearest to the farthest"
        )
        return f"{distance}, {where}, polar angle {np.degrees(self.polar):.0f} degrees"


PLACES = {
    "near-level": Place(NEAR, None, LEVEL),
    "side": Place(NEAR, float(np.pi / 2), LEVEL),
    "front": Place(NEAR, 0.0, LEVEL),
}


class GoToPlace(Planner):
    """Goes to a place relative to people, and stays there as long as they do not turn.

    The front of people is estimated from 2D joints. Until it is known, the camera keeps its azimuth, and goes to the
    distance and the polar angle of the place. Of the azimuths on both sides of the front, the nearer one is taken, and
    kept until the other one is 20 degrees nearer.

    Args:
        name: name of the planner.
        place: the place.
        sha256: hash of the file that the place was read from; None for a place that nobody fitted.
        length: number of frames of the episodes that the place was chosen on; None if nobody chose it on any.
        localisation: the localisation that the place was chosen with; None in clips, or if nobody chose it.
    """

    def __init__(
        self,
        *,
        name: str,
        place: Place,
        sha256: str | None = None,
        length: int | None = None,
        localisation: Localisation | None = None,
    ) -> None:
        """Create the planner."""
        self.name = name
        self.place = place
        self.sha256 = sha256
        self.length = length
        self.localisation = localisation

    def reset(self, context: Context) -> None:
        """Forget the people."""
        self._people = PeopleTracker(context)
        self._workspace = context.workspace

    def act(self, observation: Observation) -> FloatArray:
        """Return the places as viewpoints (B, 3)."""
        here = observation.viewpoint[:, AZIMUTH]
        if observation.frame == 0:
            self._azimuth = np.array(here)
            self._distance = self._distance_from(observation.viewpoint[:, DISTANCE])
        if self.place.azimuth is not None:
            self._azimuth = self._nearest(here, self._azimuths(observation, self.place.azimuth))
        target: FloatArray = np.empty(observation.viewpoint.shape)
        target[:, DISTANCE] = self._distance
        target[:, AZIMUTH] = self._azimuth
        target[:, POLAR] = self.place.polar
        return self._workspace.clip(target)

    def _distance_from(self, here: FloatArray) -> FloatArray:
        """Return the distances to go to, (B,) [m], from the first ones."""
        if self.place.distance is None:
            return np.array(here)
        nearest, farthest = self._workspace.distance_min, self._workspace.distance_max
        return np.full(len(here), nearest + self.place.distance * (farthest - nearest))

    def _azimuths(self, observation: Observation, azimuth: float) -> FloatArray:
        """Return the azimuths that are equally good, (B, C) [rad]; NaN in a row whose people's front is not known."""
        if self.place.absolute:
            return np.full((len(observation.viewpoint), 1), azimuth)
        self._people.update(observation)
        return self._people.azimuths_at(azimuth)

    def _nearest(self, here: FloatArray, azimuths: FloatArray) -> FloatArray:
        """Return one of the azimuths (B, C) in each row: the one nearest to the last, or one far nearer to here."""
        known = np.isfinite(azimuths[:, 0])
        found = np.where(known[:, None], azimuths, 0.0)
        way = np.abs(wrap_difference(found - here[:, None]))
        kept = np.abs(wrap_difference(found - self._azimuth[:, None])).argmin(axis=1)
        nearest, rows = way.argmin(axis=1), np.arange(len(way))
        chosen = np.where(way[rows, nearest] < way[rows, kept] - SWITCH, nearest, kept)
        return np.where(known, found[rows, chosen], self._azimuth)
