"""The moving centre of a stream: how a vehicle follows it, and what that leaves for flights around it."""

from dataclasses import replace
from typing import Any

from ehar.flight.vehicle import Vehicle
from ehar.localisation import CentreLimits

# Shares of a vehicle's limits with which it follows a centre. People walk at 1.4 m/s, px4-auto follows at 1.5 m/s.
SPEED_SHARE, SHARE = 0.3, 0.2
KEEP_ON = 3.0  # [s], for about how long people walk on as they do


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
