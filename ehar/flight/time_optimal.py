"""Time-optimal flights of limited velocity, acceleration and jerk on three independent axes, by Ruckig.

Berscheid and Kroeger, Jerk-limited Real-time Trajectory Generation with Arbitrary Target States, RSS 2021.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from ruckig import ControlInterface, InputParameter, Ruckig, RuckigError, Trajectory

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.flight.kinematics import SphericalState
from ehar.flight.profile import Phases

PHASES = 9  # of a Ruckig profile on one axis: 2 to get within the limits, and 7


class AxisLimits(NamedTuple):
    """The limits of each axis, in either direction, (..., 3)."""

    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray

    def select(self, *index: IntArray | BoolArray | int) -> "AxisLimits":
        """Return the limits at an index, one entry for each of the first axes."""
        return AxisLimits(*(limit[index] for limit in self))


class TimeOptimal:
    """Ruckig on the three axes; all axes arrive together with the slowest."""

    def __init__(self) -> None:
        """Make Ruckig's objects, which every call reuses."""
        self._ruckig = Ruckig(3)
        self._trajectory = Trajectory(3)
        self._order = InputParameter(3)

    def __reduce__(self) -> tuple[type["TimeOptimal"], tuple[()]]:
        """Copy and pickle as a new object: Ruckig's own objects support neither, and keep nothing between calls."""
        return TimeOptimal, ()

    def durations(self, start: SphericalState, target: FloatArray, limits: AxisLimits) -> FloatArray:
        """Return how long flights from starts (B, 3) to rest at targets (B, 3) last, (B,) [s]; inf if there is none."""
        durations = np.full(len(target), np.inf)
        for episode in self._solved(start, limits, target):
            durations[episode] = self._trajectory.duration
        return durations

    def to_target(self, start: SphericalState, target: FloatArray, limits: AxisLimits) -> tuple[Phases, BoolArray]:
        """Return flights from starts (B, 3) to rest at targets (B, 3), and which were found, (B,)."""
        return self._flights(start, limits, target)

    def to_rest(self, start: SphericalState, limits: AxisLimits) -> tuple[Phases, BoolArray]:
        """Return flights from starts (B, 3) to rest wherever that is soonest, and which were found, (B,)."""
        return self._flights(start, limits, None)

    def _flights(
        self, start: SphericalState, limits: AxisLimits, target: FloatArray | None
    ) -> tuple[Phases, BoolArray]:
        episodes = len(start.viewpoint)
        parts = np.zeros((episodes, 3, 2, PHASES))
        found = np.zeros(episodes, dtype=bool)
        for episode in self._solved(start, limits, target):
            found[episode] = True
            parts[episode] = [
                ((*profile.brake.t, *profile.t), (*profile.brake.j, *profile.j))
                for profile in self._trajectory.profiles[0]
            ]
        durations, jerks = np.moveaxis(parts, (2, 3), (0, 2))
        return Phases(durations, jerks), found

    def _solved(self, start: SphericalState, limits: AxisLimits, target: FloatArray | None) -> Iterator[int]:
        """Yield each episode for which a trajectory was found; `_trajectory` is then that episode's."""
        order = self._order
        order.control_interface = ControlInterface.Velocity if target is None else ControlInterface.Position
        # Lists, as Ruckig's binding takes them several times faster than rows of arrays.
        viewpoint, velocity, acceleration = (part.tolist() for part in start[:3])
        max_velocity, max_acceleration, max_jerk = (limit.tolist() for limit in limits)
        targets = viewpoint if target is None else target.tolist()
        for episode in range(len(viewpoint)):
            order.current_position = viewpoint[episode]
            order.current_velocity = velocity[episode]
            order.current_acceleration = acceleration[episode]
            order.target_position = targets[episode]
            order.max_velocity = max_velocity[episode]
            order.max_acceleration = max_acceleration[episode]
            order.max_jerk = max_jerk[episode]
            try:
                self._ruckig.calculate(order, self._trajectory)
            except (RuckigError, ValueError):  # ValueError: the binding does not know all of Ruckig's results
                continue
            yield episode
