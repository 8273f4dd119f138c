"""The moving centre of a stream: how a vehicle follows it, and what that leaves for flights around it."""

from dataclasses import replace
from typing import Any

import numpy as np

from ehar.arrays import FloatArray
from ehar.flight.vehicle import Vehicle
from ehar.localisation import CentreLimits

# Shares of a vehicle's limits with which it follows a centre. People walk at 1.4 m/s, px4-auto follows at 1.5 m/s.
SPEED_SHARE, SHARE = 0.3, 0.2
KEEP_ON = 3.0  # [s], for about how long people walk on as they do
SPEED_UP = 0.8  # [s], for about how long they go on to change their velocity as they do


def centre_limits(vehicle: Vehicle) -> CentreLimits:
    """Return the limits of the centre that a vehicle follows: a share of its own."""
    return CentreLimits(
        speed=SPEED_SHARE * vehicle.speed,
        vertical_speed=SHARE * min(vehicle.climb_speed, vehicle.descent_speed),
        acceleration=SHARE * vehicle.acceleration,
        jerk=SHARE * vehicle.jerk,
    )


def around_centre(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with what is left of its limits for flights around a moving centre.

    The velocity in the world's frame is that of the centre and that around it, added up; so are acceleration and jerk.
    No sum of two vectors is longer than their lengths together, so the whole limits are kept in the world's frame. The
    camera looks at the centre, whose motion does not turn it.
    """
    left = 1 - SHARE
    return replace(
        vehicle,
        speed=(1 - SPEED_SHARE) * vehicle.speed,
        acceleration=left * vehicle.acceleration,
        jerk=left * vehicle.jerk,
        climb_speed=left * vehicle.climb_speed,
        descent_speed=left * vehicle.descent_speed,
    )


def walked(time: Any, exp: Any) -> Any:
    """Return the time [s] that people are expected to have walked on for, at their present velocity.

    It is about `time` at first, and `KEEP_ON` at most. Their velocity times this is the way that they have gone.

    Args:
        time: from now on [s]; an array, or a CasADi symbol.
        exp: the exponential function of numpy or CasADi.
    """
    return KEEP_ON * (1 - exp(-time / KEEP_ON))


def ways_ahead(times: FloatArray, velocity: FloatArray, acceleration: FloatArray) -> FloatArray:
    """Return three ways that people may have gone, (3, B, S, 3) [m]: they stay, walk on, or walk on and speed up.

    Who speeds up has the velocity (v + a T (1 - exp(-t / T))) exp(-t / K), T is `SPEED_UP` and K is `KEEP_ON`. Who
    walks on has it with a = 0, as in `walked`.

    Args:
        times: (B, S) from now on [s].
        velocity: (B, 3) people's [m/s].
        acceleration: (B, 3) people's [m/s^2].
    """
    both = 1 / (1 / SPEED_UP + 1 / KEEP_ON)
    whole = walked(times, np.exp)[..., None]
    walking = whole * velocity[:, None]
    sooner = whole - both * (1 - np.exp(-times / both))[..., None]
    return np.stack([np.zeros_like(walking), walking, walking + sooner * SPEED_UP * acceleration[:, None]])
