"""What flights cost, in the world's frame: the distance flown, the energy, and the sound that reaches the people."""

from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray
from ehar.flight.kinematics import CartesianMotion
from ehar.flight.multicopter import HEARING, Multicopter, intensity


@dataclass(frozen=True, eq=False)
class FlightCosts:
    """The costs of B flights.

    Args:
        time: how long they lasted [s].
        distance: (B,) [m] flown in the world's frame.
        energy: (B,) [J], None for a vehicle without a body.
        exposure: (B,) [J/m^2], the sound energy that reached the centre of the people; None for a vehicle without a
            body.
    """

    time: float
    distance: FloatArray
    energy: FloatArray | None = None
    exposure: FloatArray | None = None

    @property
    def noise(self) -> FloatArray | None:
        """The equivalent A-weighted sound level at the centre of the people, (B,) [dB]; None without a body."""
        if self.exposure is None:
            return None
        level: FloatArray = 10 * np.log10(self.exposure / self.time / HEARING)
        return level

    def plus(self, more: "FlightCosts") -> "FlightCosts":
        """Return the costs of these flights and of what the same vehicles flew next."""
        return FlightCosts(
            self.time + more.time,
            self.distance + more.distance,
            None if self.energy is None or more.energy is None else self.energy + more.energy,
            None if self.exposure is None or more.exposure is None else self.exposure + more.exposure,
        )


def flight_costs(
    body: Multicopter | None, motion: CartesianMotion, distance: FloatArray, frame_time: float
) -> FlightCosts:
    """Return the costs of one frame.

    Args:
        body: the vehicle's, if it has one.
        motion: the motion in the world's frame, each (B, S, 3), at equal steps, both ends included; z is upwards.
        distance: (B, S) [m] from the centre of the people.
        frame_time: how long the frame lasted [s].
    """
    step = frame_time / (distance.shape[1] - 1)
    flown = np.trapezoid(np.linalg.norm(motion.velocity, axis=-1), dx=step, axis=1)
    if body is None:
        return FlightCosts(frame_time, flown)
    velocity, acceleration = (np.moveaxis(part, -1, 0) for part in (motion.velocity, motion.acceleration))
    power, sound_power = body.demands(list(velocity), list(acceleration), np)
    return FlightCosts(
        frame_time,
        flown,
        np.trapezoid(power, dx=step, axis=1),
        np.trapezoid(intensity(sound_power, distance), dx=step, axis=1),
    )
