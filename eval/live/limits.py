"""How much of a vehicle's limits a stream of setpoints uses."""

import numpy as np

from ehar.flight.vehicle import Vehicle
from eval.live.loop import Said
from eval.live.setpoints import Setpoint


class LimitShares:
    """The greatest share of each limit; above 1 it would be broken.

    Jerk is the change of the acceleration from one setpoint to the next, by the setpoints' own times: a mean, which is
    never above the greatest value in between.

    Args:
        vehicle: has the limits.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        """Begin with nothing used."""
        self._vehicle = vehicle
        self._before: Setpoint | None = None
        self.greatest = dict.fromkeys(("speed", "acceleration", "jerk", "climb", "yaw rate"), 0.0)

    def take(self, said: Said) -> None:
        """Take one more setpoint."""
        setpoint, vehicle = said.setpoint, self._vehicle
        if setpoint is None:
            return
        up = setpoint.velocity[2]
        used = {
            "speed": float(np.linalg.norm(setpoint.velocity)) / vehicle.speed,
            "acceleration": float(np.linalg.norm(setpoint.acceleration)) / vehicle.acceleration,
            "climb": up / vehicle.climb_speed if up > 0 else -up / vehicle.descent_speed,
            "yaw rate": abs(setpoint.yaw_rate) / vehicle.yaw_rate,
        }
        if self._before is not None:
            change = np.subtract(setpoint.acceleration, self._before.acceleration)
            used["jerk"] = float(np.linalg.norm(change)) / (setpoint.time - self._before.time) / vehicle.jerk
        self.greatest |= {name: max(self.greatest[name], share) for name, share in used.items()}
        self._before = setpoint
