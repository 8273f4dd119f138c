"""Shares out a vehicle's limits among the three axes of a viewpoint.

A vehicle's limits are Cartesian, Ruckig's are per axis, and on a sphere no limits per axis are equivalent. So there are
several proposals, from bold to timid; `ehar.flight.limits.keeps_limits` says whether a flight keeps the vehicle's
limits.
"""

from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray
from ehar.flight.kinematics import SphericalState, local_motion
from ehar.flight.time_optimal import AxisLimits
from ehar.flight.vehicle import Vehicle
from ehar.viewpoint import AZIMUTH, DISTANCE, POLAR


class Boldness(NamedTuple):
    """One way to share out the limits."""

    cross: float  # least share of an axis, even if the straight way needs less
    speed: float  # times the speed that is safe all the way
    acceleration: float  # times the acceleration, and the jerk, that are safe most of the time


# Each axis gets the share that the straight way needs of the following parts of a vehicle's limits.
SPEED_SHARE = 0.994
CURVE_SHARE = 0.9  # of the acceleration, by the curve at full speed
ACCELERATION_SHARE = 0.85
JERK_SHARE = 0.78

PROPOSALS = (
    *(
        Boldness(cross, speed, acceleration)
        for cross in (0.05, 0.25, 0.6)
        for speed, acceleration in ((2, 1.2), (1.5, 0.95), (1, 0.8), (0.8, 0.6))
    ),
    Boldness(0.05, 0.5, 0.35),
    Boldness(0.05, 0.2, 0.15),  # keeps all limits from rest, so that any target is reached
)
# Hardly anything but straight, from rest, in a viewpoint's coordinates: valid where the straight way keeps clear.
STRAIGHT = (Boldness(1e-6, 0.8, 0.6), Boldness(1e-6, 0.2, 0.15))
BRAKING = (Boldness(0.05, 1, 1), Boldness(0.05, 1, 0.6), Boldness(0.05, 1, 0.3))

PLACES = np.linspace(0, 1, 5)  # along the straight way


def limits_to_target(vehicle: Vehicle, state: SphericalState, way: FloatArray) -> AxisLimits:
    """Return limits (K, B, 3) for flights from states (B, 3) to rest `way` (B, 3) from there.

    They are those of `PROPOSALS`, and then of `STRAIGHT`.
    """
    back = way - braking_way(vehicle, state)
    # An axis that is bound to overshoot needs a share to come back.
    heading = np.copysign(np.maximum(np.abs(way), np.abs(back)), way)
    places = state.viewpoint[:, None] + PLACES[:, None] * way[:, None]
    return _shared_out(vehicle, state, heading, places, PROPOSALS + STRAIGHT)


def limits_to_rest(vehicle: Vehicle, state: SphericalState) -> AxisLimits:
    """Return the limits of `BRAKING`, (K, B, 3), for flights from states (B, 3) to rest at any place."""
    # An axis that has just begun to speed up has no velocity yet, but an acceleration that has to end too.
    build_up = vehicle.acceleration / vehicle.jerk
    heading = np.copysign(np.abs(state.velocity) + build_up * np.abs(state.acceleration), state.velocity)
    return _shared_out(vehicle, state, heading, state.viewpoint[:, None], BRAKING)


def stopping_time(vehicle: Vehicle, state: SphericalState) -> FloatArray:
    """Return about how long stops from states (B, 3) take, (B,) [s]."""
    motion = local_motion(state)
    speed, acceleration = (np.linalg.norm(vector, axis=-1) for vector in motion[:2])
    time: FloatArray = speed / vehicle.acceleration + (vehicle.acceleration + acceleration) / vehicle.jerk
    return time


def _shared_out(
    vehicle: Vehicle, state: SphericalState, heading: FloatArray, places: FloatArray, ways: tuple[Boldness, ...]
) -> AxisLimits:
    """Return limits (K, B, 3) for flights from states (B, 3) along headings (B, 3) that pass places (B, P, 3).

    The straight line along the heading, in viewpoint coordinates, is a curve in space. Its kinematics at unit speed say
    how fast a camera may go along it, and each axis gets its share of that. A part of the jerk is reserved: the present
    velocity and acceleration already cause it.
    """
    arms = lever(places)
    length = np.linalg.norm(arms * heading[:, None], axis=-1, keepdims=True)
    path = heading[:, None] / np.where(length > 0, length, 1)
    alone = np.eye(3) / arms[..., None, :]
    directions = np.concatenate([path[..., None, :], alone], axis=-2)  # (B, P, 4, 3), all of unit speed
    safe = _along(vehicle, places[..., None, :], directions)
    together = [(limit[..., :1] * np.abs(path)).min(axis=1) for limit in safe]
    single = [(limit[..., 1:] / arms).min(axis=1) for limit in safe]
    coasting = local_motion(state._replace(jerk=np.zeros_like(state.velocity))).jerk
    used = (coasting**2).sum(axis=-1, keepdims=True) / vehicle.jerk**2
    left = np.sqrt(np.maximum(1 - used, 0.1))
    cross, speed, acceleration = np.array(ways).T[:, :, None, None]
    velocity, force, jerk = (np.maximum(t, cross * s) for t, s in zip(together, single, strict=True))
    return AxisLimits(speed * velocity, acceleration * force, acceleration * left * jerk)


def _along(vehicle: Vehicle, viewpoint: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return speed, acceleration and jerk (...,) that are safe along directions of unit speed (..., 3)."""
    still = np.zeros_like(direction)
    unit = local_motion(SphericalState(np.broadcast_to(viewpoint, direction.shape), direction, still, still))
    curve, twist = (np.linalg.norm(vector, axis=-1) for vector in unit[1:])
    upwards, turning = unit.velocity[..., 2], np.abs(direction[..., AZIMUTH])
    vertical_speed = np.where(upwards > 0, vehicle.climb_speed, vehicle.descent_speed)
    speed = np.minimum.reduce(
        [
            np.full(turning.shape, SPEED_SHARE * vehicle.speed),
            np.sqrt(CURVE_SHARE * _ratio(vehicle.acceleration, curve)),
            np.cbrt(_ratio(vehicle.jerk, twist)),
            SPEED_SHARE * _ratio(vertical_speed, np.abs(upwards)),
            SPEED_SHARE * _ratio(vehicle.yaw_rate, turning),
        ]
    )
    # No vehicle names a yaw acceleration: the yaw rate takes as long to build up as the acceleration does.
    build_up = vehicle.acceleration / vehicle.jerk
    acceleration = np.minimum(ACCELERATION_SHARE * vehicle.acceleration, _ratio(vehicle.yaw_rate / build_up, turning))
    jerk = np.minimum(JERK_SHARE * vehicle.jerk, _ratio(vehicle.yaw_rate / build_up**2, turning))
    return speed, acceleration, jerk


def braking_way(vehicle: Vehicle, state: SphericalState) -> FloatArray:
    """Return about how much farther each axis gets if it brakes now, alone, (B, 3)."""
    arms = lever(state.viewpoint)
    acceleration = arms * state.acceleration
    speed = arms * state.velocity + acceleration * np.abs(acceleration) / (2 * vehicle.jerk)
    build_up = vehicle.acceleration / vehicle.jerk
    farther: FloatArray = speed * (np.abs(speed) / vehicle.acceleration + build_up) / (2 * arms)
    return farther


def lever(viewpoint: FloatArray) -> FloatArray:
    """Return how far a camera moves as each coordinate changes by one unit, (..., 3): [m/m], [m/rad], [m/rad]."""
    distance = np.maximum(viewpoint[..., DISTANCE], 1e-3)
    radius = distance * np.maximum(np.sin(viewpoint[..., POLAR]), 1e-3)  # on the vertical axis any turn is free
    return np.stack([np.ones_like(distance), radius, distance], axis=-1)


def _ratio(limit: FloatArray | float, rate: FloatArray) -> FloatArray:
    """Return the quotient; it is practically unlimited if the rate is 0."""
    quotient: FloatArray = limit / np.maximum(rate, 1e-9)
    return quotient
