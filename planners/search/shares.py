"""The shares of a camera's limits that the nodes of a plan use, each at most 1, as CasADi's symbols."""

from itertools import product
from typing import Any

import casadi as ca
import numpy as np

from ehar.arrays import FloatArray
from ehar.flight.kinematics import local_vectors
from ehar.viewpoint import AZIMUTH, DISTANCE, POLAR

SMOOTHING = 0.1  # added under the root of a share, where the square is 1 at the limit


def flown_shares(moving: tuple[Any, ...], forced: tuple[Any, ...], vehicle: Any, *, first: bool) -> list[Any]:
    """Return the shares of a vehicle's limits that a node uses, each at most 1; at the first only that of the jerk.

    Args:
        moving: position, velocity, acceleration and jerk, of which the velocity is taken.
        forced: the same values, of which acceleration and jerk are taken.
        vehicle: its limits, in the order of `VEHICLE_LIMITS`.
        first: whether this is the present node.
    """
    speed, force, jolt, climb, descent = ca.vertsplit(vehicle)
    velocity, _, _ = _local(moving)
    _, acceleration, jerk = _local(forced)
    if first:
        return [_length(jerk, jolt)]
    upwards = velocity[2]
    return [
        _length(jerk, jolt),
        _length(velocity, speed),
        _length(acceleration, force),
        upwards / climb,
        -upwards / descent,
    ]


def grid_shares(state: Any) -> list[Any]:
    """Return the shares of the grid's pace, each at most 1: with any signs, the axes' shares of it add up to 1."""
    return [ca.dot(ca.DM(signs), state[3:6]) for signs in product((-1, 1), repeat=3)]


def turning_points(state: Any, velocity_limit: Any, unit: FloatArray, time: Any) -> list[Any]:
    """Return distances and polar angles between which the cubics before and after a node stay, for each two.

    They are control points of Bezier curves, and each curve stays within the bounds that its control points keep.
    """
    reach = state[3:6] * velocity_limit / unit * time / 3
    return [state[axis] + way * reach[axis] for axis in (DISTANCE, POLAR) for way in (-1, 1)]


def _local(parts: tuple[Any, ...]) -> list[tuple[Any, Any, Any]]:
    """Return Cartesian velocity, acceleration and jerk, for the spherical ones from the position on."""
    distance, azimuth, polar = ([part[axis] for part in parts] for axis in (DISTANCE, AZIMUTH, POLAR))
    return local_vectors(distance, azimuth, polar, ca)


def _length(vector: tuple[Any, Any, Any], limit: Any) -> Any:
    """Return the share of a limit that the length of a vector uses; 1 at the limit.

    The root of the squared share is nearly linear, so a solver's steps land near the limit. It is smoothed near 0.
    """
    return 1 + ca.sqrt(ca.sumsqr(ca.vertcat(*vector) / limit) + SMOOTHING) - np.sqrt(1 + SMOOTHING)
