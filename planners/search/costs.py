"""What a plan's flight costs, in the units of its weights: one formula for numpy and CasADi."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from ehar.arrays import Trigonometry
from ehar.flight.kinematics import local_vectors
from ehar.flight.multicopter import Multicopter, intensity
from ehar.viewpoint import AZIMUTH, DISTANCE, POLAR
from planners.value.view_basis import DistanceRange

ROUNDED_SPEED = 0.1  # [m/s]; below, the cost of a speed is that of its square, as a solver needs


class FlightShares(NamedTuple):
    """What is paid for at a node of a plan.

    Attributes:
        power: in units of hovering.
        sound: its intensity at the people, in units of hovering in the middle distance.
        speed: in units of 1 m/s.
    """

    power: Any
    sound: Any
    speed: Any


def flight_shares(
    body: Multicopter, span: DistanceRange, state: Sequence[Sequence[Any]], ops: Trigonometry
) -> FlightShares:
    """Return what is paid for in states.

    The centre of the people is taken to rest: nobody tells a planner how a vehicle will follow them.

    Args:
        body: the vehicle's.
        span: the range of distances of the world.
        state: position, velocity and acceleration, each of distance, azimuth and polar angle.
        ops: where sin, cos and sqrt come from: `numpy` or `casadi`.
    """
    distance, azimuth, polar = ([*(part[axis] for part in state), 0.0] for axis in (DISTANCE, AZIMUTH, POLAR))
    velocity, acceleration, _ = local_vectors(distance, azimuth, polar, ops)
    power, sound_power = body.demands(velocity, acceleration, ops)
    sound = intensity(sound_power, distance[0]) / intensity(body.hover_sound, span.middle)
    speed = ops.sqrt(sum(part * part for part in velocity) + ROUNDED_SPEED**2) - ROUNDED_SPEED
    return FlightShares(power / body.hover_power, sound, speed)
