"""Places around people: a map of them on the grid, counted from where people face in the first frame."""

from dataclasses import replace

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.motion_data import MotionData
from ehar.data.scenario import Scenarios
from ehar.data.skeleton import Skeleton
from ehar.errors import UsageError
from ehar.viewpoint import AZIMUTH, POLAR, Workspace
from planners.place.people import trunk_of


def viewpoint_map(workspace: Workspace, distance: float, azimuths: int, polars: int) -> FloatArray:
    """Return fixed viewpoints (polars, azimuths, 3) on the grid, from the least polar angle to the greatest.

    Raises:
        UsageError: the distance is outside the workspace, or there are too few angles, or more than the grid has.
    """
    if not workspace.distance_min <= distance <= workspace.distance_max:
        raise UsageError(
            f"distance: expected {workspace.distance_min:g} to {workspace.distance_max:g} m, got {distance:g}"
        )
    _, most_azimuths, most_polars = workspace.cells
    if not (1 <= azimuths <= most_azimuths and 2 <= polars <= most_polars):
        raise UsageError(
            f"expected a map of 1 to {most_azimuths} azimuths and 2 to {most_polars} polar angles, as the world's grid "
            f"has, got {azimuths} and {polars}"
        )
    polar = np.linspace(workspace.polar_min, workspace.polar_max, polars)
    azimuth = 2 * np.pi * np.arange(azimuths) / azimuths
    wanted = np.stack(np.broadcast_arrays(distance, azimuth, polar[:, None]), axis=-1)
    return workspace.from_cells(workspace.to_cells(wanted))


def counted_from(data: MotionData) -> str:
    """Return what the azimuths of `true_reference` are counted from, in words."""
    if data.persons > 1:
        return "the direction from the first person to the second in the first frame"
    if len(trunk_of(data.skeleton)):
        return "where people face in the first frame"
    return "azimuth 0 of the data, whose skeleton does not tell left from right"


def true_reference(positions: FloatArray, skeleton: Skeleton) -> FloatArray:
    """Return the azimuth that places of N scenarios are counted from, (N,) [rad], as the true joints tell it.

    It is what a `Situation` estimates: for one person, the azimuth that the person faces, across the mean vector from
    the right of the trunk to its left. For several it is the direction from the first to the second. If one person's
    skeleton does not tell left from right, it is the azimuth 0 of the data.

    Args:
        positions: (N, P, J, 3) [m], the joints in one frame.
        skeleton: says which joints are where limbs join the trunk.
    """
    if positions.shape[1] > 1:
        way = (positions[:, 1] - positions[:, 0]).mean(axis=1)
        return _azimuth(way)
    pairs = trunk_of(skeleton)
    if not len(pairs):
        return np.zeros(len(positions))
    lateral = (positions[:, 0, pairs[:, 0]] - positions[:, 0, pairs[:, 1]]).mean(axis=1)
    return _azimuth(lateral) - np.pi / 2


def placed_around(scenarios: Scenarios, places: FloatArray, workspace: Workspace) -> FloatArray:
    """Return the places of M cameras in each scenario's own frame, (N, M, 3), on the grid.

    Args:
        scenarios: N motions; only their first frame is looked at.
        places: (M, 3), whose azimuths are counted from `true_reference`.
        workspace: the grid.
    """
    first = replace(scenarios, length=1).positions(np.arange(len(scenarios)))[:, 0]
    around = np.repeat(places[None], len(scenarios), axis=0)
    around[..., AZIMUTH] += true_reference(first, scenarios.data.skeleton)[:, None]
    return workspace.from_cells(workspace.to_cells(around))


def directions(places: FloatArray) -> FloatArray:
    """Return the unit vectors (..., 3) from the people to places (..., 3)."""
    azimuth, polar = places[..., AZIMUTH], places[..., POLAR]
    level = np.sin(polar)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.cos(polar)], axis=-1)


def angles_between(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the angles (...) [degrees] between two places (..., 3), seen from the people.

    Straight above all azimuths are one place.
    """
    cosine = (directions(one) * directions(other)).sum(axis=-1)
    angles: FloatArray = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    return angles


def _azimuth(way: FloatArray) -> FloatArray:
    """Return the azimuths (N,) [rad] of vectors (N, 3)."""
    azimuth: FloatArray = np.arctan2(way[:, 1], way[:, 0])
    return azimuth
