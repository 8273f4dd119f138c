"""Evades what people walk towards: where a camera flies that its plan, or staying, would carry too near to something.

People who walk carry the cameras around them along, and with them plans that were free when they were made.
"""

import numpy as np

from ehar.arrays import FloatArray
from ehar.flight.clearance import Around
from ehar.flight.kinematics import SphericalState
from ehar.flight.limits import keeps_limits
from ehar.flight.profile import JerkProfile
from ehar.flight.proposals import PROPOSALS, braking_way, limits_to_target
from ehar.flight.time_optimal import AxisLimits, TimeOptimal
from ehar.flight.vehicle import Vehicle
from ehar.viewpoint import AZIMUTH, Workspace, cartesian, spherical, wrap_difference

AHEAD = 3.0  # [s] that a flight is looked at
SAMPLES = 49  # of a flight in that time
AROUND = 8  # compass directions in which to evade, beside straight up and down
RISES = np.deg2rad([-45, 0, 45])  # of each; a camera that may come no nearer to people gets over them by climbing
AWAY = (0.4, 0.8, 1.6, 3.2)  # [m] from where a camera comes to rest if it brakes
AMPLE = 0.5  # [m]; more clearance is not looked for
CLEARER = 0.01  # [m] of clearance for which to leave a plan
TRIED = (slice(16), slice(16, 128), slice(128, None))  # flights of a row whose limits are checked, the clearest first
SOONER = 0.01  # [m/s] of clearance that a flight may be nearer to arrive sooner


def clearance_ahead(profile: JerkProfile, flown: FloatArray, around: Around) -> FloatArray:
    """Return the least clearance of flights in the next `AHEAD` seconds, (B,) [m], at most `AMPLE`.

    It is the least of what it is if people stay, if they walk on, and if they speed up.

    Args:
        profile: B flights.
        flown: (B,) for how long each has been flown [s].
        around: what stands around them.
    """
    ahead = np.broadcast_to(np.linspace(0, AHEAD, SAMPLES), (len(flown), SAMPLES))
    cameras = cartesian(profile.at(flown[:, None] + ahead).viewpoint)
    least: FloatArray = np.minimum(around.clearance(cameras, ahead).min(axis=(0, 2)), AMPLE)
    return least


def clearest(
    start: SphericalState, vehicle: Vehicle, workspace: Workspace, time_optimal: TimeOptimal, around: Around
) -> tuple[JerkProfile, FloatArray]:
    """Return of each state (B, 3) the valid flight to a place nearby that has the most clearance, and how much, (B,).

    Without a valid flight that is -inf. Of flights that are about as clear, a sooner one is returned. What comes after
    `AHEAD` is not looked at: every frame looks anew.
    """
    targets = _places_around(start.viewpoint + braking_way(vehicle, start), workspace)
    limits = [limits_to_target(vehicle, start, target - start.viewpoint) for target in targets]
    place, proposal, row = (index.ravel() for index in np.indices((len(targets), len(PROPOSALS), len(start.viewpoint))))
    here = start.select(row)
    shares = AxisLimits(*(np.stack(part)[place, proposal, row] for part in zip(*limits, strict=True)))
    phases, found = time_optimal.to_target(here, targets[place, row], shares)
    flights = JerkProfile.from_phases(here, phases)
    clear = np.where(found, clearance_ahead(flights, np.zeros(len(row)), around.select(row)), -np.inf)
    rows = np.arange(len(start.viewpoint))
    worth = (clear - SOONER * flights.duration).reshape(-1, len(rows))
    order = np.argsort(-worth, axis=0, kind="stable") * len(rows) + rows  # (flights of a row, rows)
    best, clearance = order[0].copy(), np.full(len(rows), -np.inf)
    left = rows
    for part in TRIED:  # limits take longest to check, and one of the first is most often valid
        tried = order[part, left]
        valid = keeps_limits(flights.select(tried.ravel()), vehicle, workspace).reshape(tried.shape)
        which, any_valid = valid.argmax(axis=0), valid.any(axis=0)
        kept = tried[which, np.arange(len(left))][any_valid]
        best[left[any_valid]], clearance[left[any_valid]] = kept, clear[kept]
        left = left[~any_valid]
    return flights.select(best), clearance


def _places_around(viewpoint: FloatArray, workspace: Workspace) -> FloatArray:
    """Return viewpoints (B, 3) and places around them, (C, B, 3), with azimuths that are not wrapped."""
    turns, rises = np.meshgrid(2 * np.pi / AROUND * np.arange(AROUND), RISES)
    around = np.stack([np.cos(rises) * np.cos(turns), np.cos(rises) * np.sin(turns), np.sin(rises)], axis=-1)
    directions = np.concatenate([around.reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]])
    steps = np.concatenate([np.zeros((1, 3)), *(away * directions for away in AWAY)])[:, None]
    places = workspace.clip(spherical(cartesian(viewpoint) + steps))
    places[..., AZIMUTH] = viewpoint[:, AZIMUTH] + wrap_difference(places[..., AZIMUTH] - viewpoint[:, AZIMUTH])
    return places
