"""The pace at which cameras get along ways: that of the grid, or that of a vehicle from its present motion."""

from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.flight.kinematics import SphericalState
from ehar.flight.limits import limit_shares
from ehar.flight.proposals import lever
from ehar.flight.vehicle import Vehicle
from ehar.planner import Context, Observation
from ehar.viewpoint import Workspace
from planners.search.ways import Ways

LEAST = 1e-9  # takes the place of 0, because we divide by it
PASSED = np.linspace(0, 1, 3)  # shares of a way at which its pace is looked at
# As seen in flights to targets: the share of a vehicle's acceleration that they use, since three axes share it; and for
# which part of the time in which it builds up cameras go on as they did.
ACCELERATION_SHARE, BUILD_UP = 0.7, 0.9


@dataclass(frozen=True, eq=False)
class Pace:
    """How fast B cameras get along the ways to G goals each, until they are at rest there.

    Args:
        needed: (B, G) frames that the ways take at full speed.
        ramp: (B, G) frames to get up to full speed, or to brake from it; 0 on the grid.
        along: (B, G) present speed along the ways, as a share of the full one; negative if a camera moves away.
        across: (B, G, 3) the rest of the present velocity [m, rad, rad per frame]; None on the grid.
        back: (B, G) frames until that is made up for.
        late: frames in which cameras go on as they do, because the acceleration builds up with a limited jerk.
    """

    needed: FloatArray
    ramp: FloatArray
    along: FloatArray
    across: FloatArray | None
    back: FloatArray
    late: float

    def places(self, ways: Ways, frames: IntArray, workspace: Workspace) -> FloatArray:
        """Return where cameras are after frames (N,) from now, (B, N, G, 3).

        What they had across their ways takes them aside, by the cubic in time that begins with it and ends at rest.
        """
        time, needed = frames[:, None], np.maximum(self.needed, LEAST)[:, None]  # (N, 1) and (B, 1, G)
        ramp, along, back = (each[:, None] for each in (self.ramp, self.along, self.back))
        coasted = np.minimum(time, self.late) * along
        made = coasted + way_made(np.maximum(time - self.late, 0.0), needed - coasted, ramp, along)
        places = ways.at(made / needed)
        if self.across is None:
            return places
        part = np.minimum(time / np.maximum(back, LEAST), 1)
        return workspace.clip(places + (time * (1 - part) ** 2)[..., None] * self.across[:, None])


def pace_of(ways: Ways, observation: Observation, context: Context) -> Pace:
    """Return the pace along ways on the track of the episodes."""
    if context.vehicle is None:
        needed = np.abs(ways.straight / context.workspace.step).sum(axis=-1) * ways.longer
        none = np.zeros_like(needed)
        return Pace(needed, ramp=none, along=none, across=None, back=none, late=0.0)
    return _flown(ways, observation, context.vehicle, context.frame_time)


def _flown(ways: Ways, observation: Observation, vehicle: Vehicle, frame_time: float) -> Pace:
    """Return the pace of a vehicle.

    A way that takes one second at a steady rate uses some shares of the limits: k times that of the speed if it takes
    1 / k of the time, k^2 times that of the acceleration. What of the present velocity leads along the way is told in
    metres, by the lever of the present viewpoint. An acceleration has to end: it adds a^2 / 2 J to the velocity.
    """
    here, way = observation.viewpoint[:, None], ways.straight
    places = here[:, :, None] + PASSED[:, None] * way[:, :, None]  # (B, G, P, 3)
    still = np.zeros_like(places)
    steady = SphericalState(places, np.broadcast_to(way[:, :, None], places.shape), still, still)
    speed, force, jolt, vertical, turn = np.moveaxis(limit_shares(vehicle, steady).max(axis=2), -1, 0)
    seconds = np.maximum.reduce([speed, np.sqrt(force), np.cbrt(jolt), vertical, turn, np.full(speed.shape, LEAST)])

    arms = lever(here)  # (B, 1, 3)
    there = arms * way
    length = np.linalg.norm(there, axis=-1)
    push = arms[:, 0] * observation.acceleration
    moving = (arms[:, 0] * observation.velocity + push * np.abs(push) / (2 * vehicle.jerk))[:, None]
    towards = there / np.maximum(length, LEAST)[..., None]
    ahead = (moving * towards).sum(axis=-1)
    beside = moving - ahead[..., None] * towards

    fastest = np.where(length > LEAST, length / seconds, vehicle.speed)
    acceleration = ACCELERATION_SHARE * vehicle.acceleration
    late = BUILD_UP * vehicle.acceleration / vehicle.jerk
    swing = np.linalg.norm(beside, axis=-1) / acceleration
    return Pace(
        needed=seconds * ways.longer / frame_time,
        ramp=fastest / acceleration / frame_time,
        along=(ahead / fastest).clip(-1, 1),
        across=beside / arms * frame_time,
        back=((1 + np.sqrt(2)) * swing + late) / frame_time,  # to brake, and to get back from rest to rest
        late=late / frame_time,
    )


def way_made(
    frames: FloatArray | float, way: FloatArray, ramp: FloatArray | float, along: FloatArray | float = 0.0
) -> FloatArray:
    """Return how much of ways is covered after some frames, until rest, in their unit and shape.

    A camera speeds up in the same way for every goal. At a constant mean pace, the goals behind a good view would seem
    best, because the camera would pass that view sooner. It is the way of the least time at a constant acceleration or
    none. A camera that is too fast to stop at the goal passes it and comes back.

    Args:
        frames: number of frames since the start; the arguments broadcast.
        way: the ways, each as the number of frames that it takes at full speed.
        ramp: number of frames to get up to full speed, or to brake from it.
        along: present speed along the ways, as a share of the full one.
    """
    ramp = np.maximum(ramp, LEAST)
    ahead = np.where(way >= ramp * along * np.abs(along) / 2, 1.0, -1.0)  # the direction to speed up in first
    speed, way = ahead * along, ahead * way
    top = np.minimum(np.sqrt(np.maximum(way / ramp + speed**2 / 2, 0.0)), 1.0)
    rising = ramp * (top - speed)
    cruising = np.maximum(way - ramp * (top**2 - speed**2 / 2), 0.0) / np.maximum(top, LEAST)
    first = np.minimum(frames, rising)
    second = (frames - rising).clip(0, cruising)
    third = (frames - rising - cruising).clip(0, ramp * top)
    made: FloatArray = ahead * (
        first * (speed + first / (2 * ramp)) + second * top + third * (top - third / (2 * ramp))
    )
    return made
