"""Checks whether flights keep a vehicle's limits."""

from collections.abc import Sequence

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.flight.kinematics import CartesianMotion, SphericalState, local_motion, local_vectors
from ehar.flight.profile import SAMPLES, JerkProfile
from ehar.flight.vehicle import Vehicle
from ehar.viewpoint import AZIMUTH, DISTANCE, POLAR, Workspace

HEADROOM = 0.995  # share of a limit that samples may use, so that the limit also holds between samples
BLOCK = 64  # flights at a time, so that their samples stay in the cache
Components = tuple[FloatArray, FloatArray, FloatArray]  # of vectors, each (...)


def limit_shares(vehicle: Vehicle, state: SphericalState, centre: CartesianMotion | None = None) -> FloatArray:
    """Return the share of each limit that states (..., 3) use, (..., 5); 1 is the whole limit.

    The order is speed, acceleration, jerk, climb or descent speed, yaw rate. A camera that looks at the centre turns
    about the vertical axis as fast as its azimuth changes.

    Args:
        vehicle: the vehicle.
        state: the states around the centre.
        centre: the motion of the centre in the world's frame, each (..., 3); None if it rests.
    """
    return np.stack(_shares_of_state(vehicle, state, centre), axis=-1)


def world_motion(state: SphericalState, centre: CartesianMotion | None = None) -> CartesianMotion:
    """Return the motion in the world's frame, each (..., 3), on the axes of `local_motion`.

    The arguments are those of `limit_shares`.
    """
    motion = local_motion(state)
    if centre is None:
        return motion
    cos, sin = np.cos(state.viewpoint[..., AZIMUTH]), np.sin(state.viewpoint[..., AZIMUTH])
    return CartesianMotion(
        *(
            own + np.stack([cos * x + sin * y, cos * y - sin * x, z], axis=-1)
            for own, (x, y, z) in zip(motion, (np.moveaxis(part, -1, 0) for part in centre), strict=True)
        )
    )


def motion_shares(vehicle: Vehicle, motion: CartesianMotion, turn: FloatArray) -> FloatArray:
    """Return the share of each limit that a motion uses, (..., 5), in the order of `limit_shares`.

    Args:
        vehicle: the vehicle.
        motion: a result of `world_motion`.
        turn: (...) rate of the azimuth [rad/s].
    """
    return np.stack(_shares(vehicle, [_components(vector) for vector in motion], turn), axis=-1)


def _components(vector: FloatArray) -> Components:
    """Return the components of vectors (..., 3)."""
    return vector[..., 0], vector[..., 1], vector[..., 2]


def _shares_of_state(vehicle: Vehicle, state: SphericalState, centre: CartesianMotion | None) -> list[FloatArray]:
    """Return what `limit_shares` returns, each share by itself, (...)."""
    if centre is None:  # most flights are checked around a centre that rests: no component has to move in memory
        distance, azimuth, polar = ([part[..., axis] for part in state] for axis in (DISTANCE, AZIMUTH, POLAR))
        vectors: list[Components] = local_vectors(distance, azimuth, polar, np)
    else:
        vectors = [_components(vector) for vector in world_motion(state, centre)]
    return _shares(vehicle, vectors, state.velocity[..., AZIMUTH])


def _shares(vehicle: Vehicle, vectors: Sequence[Components], turn: FloatArray) -> list[FloatArray]:
    """Return the share of each limit that velocity, acceleration and jerk use, each by itself, (...)."""
    # Component by component: numpy takes five times as long for a sum over an axis of three.
    speed, acceleration, jerk = (np.sqrt(x**2 + y**2 + z**2) for x, y, z in vectors)
    upwards = vectors[0][2]
    return [
        speed / vehicle.speed,
        acceleration / vehicle.acceleration,
        jerk / vehicle.jerk,
        np.maximum(upwards / vehicle.climb_speed, -upwards / vehicle.descent_speed),
        np.abs(turn) / vehicle.yaw_rate,
    ]


def keeps_limits(profile: JerkProfile, vehicle: Vehicle, workspace: Workspace) -> BoolArray:
    """Return which flights keep the vehicle's limits and stay in the workspace until they are at rest, (B,).

    Where flights turn back is exact, and how fast they turn: near the vertical axis azimuths change fast. All else is
    sampled, at every change of jerk. In between, a flight bends only as fast as the camera goes round, so it is sampled
    nine times in the time that it takes for one radian; and no speed is more than j t^2 / 8 above those of samples that
    are t apart, for the vehicle's jerk j. Most flights that break a limit break it near a change of jerk: the first
    pass looks only there and leaves few flights for the second.
    """
    turn = min(float(np.sqrt(max(workspace.distance_min, 1e-3) / vehicle.acceleration)), 1 / vehicle.yaw_rate)
    slowest = min(vehicle.speed, vehicle.climb_speed, vehicle.descent_speed)
    apart = min(turn / 9, float(np.sqrt(8 * (1 - HEADROOM) * slowest / vehicle.jerk)))
    lowest, highest = profile.extremes()
    keeps = workspace.contains(lowest) & workspace.contains(highest)
    keeps &= profile.fastest()[:, AZIMUTH] <= HEADROOM * vehicle.yaw_rate
    for longest in (np.inf, (SAMPLES - 1) * apart):
        left = np.flatnonzero(keeps)
        for first in range(0, len(left), BLOCK):
            rows = left[first : first + BLOCK]
            flight, state = profile.select(rows).samples(longest)
            for share in _shares_of_state(vehicle, state, None):
                keeps[rows[flight[(share > HEADROOM).any(axis=1)]]] = False
    return keeps
