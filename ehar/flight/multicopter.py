"""What a multicopter's flight costs: the power that it takes, and the sound that it makes; one formula for all."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Annotated, Any

from annotated_types import Gt

from ehar.arrays import Trigonometry
from ehar.errors import UsageError

GRAVITY, AIR_DENSITY = 9.81, 1.225  # [m/s^2]; [kg/m^3], at sea level and 15 degrees
# Rotors with fixed blades turn as fast as their thrust asks for. Both numbers are our choice, of a two-bladed propeller
# of 10 inches that lifts 0.5 kg at 5,500 turns a minute: its thrust T / (density, area, tip speed^2), and an eighth of
# the blades' share of the disc, 0.1, times their drag coefficient, 0.02.
THRUST_COEFFICIENT, PROFILE_COEFFICIENT = 0.0148, 2.5e-4
INDUCED_FACTOR = 1.15  # Leishman, Principles of Helicopter Aerodynamics: air does not flow evenly through a rotor
EFFICIENCY = 0.75  # of motors and their controllers; our choice
HEARING = 1e-12  # [W/m^2], of 0 dB
SMALL_SPEED, SMALL_POWER = 1e-3, 1.0  # [m/s], [W]; they round the corners of a length and of what is never negative

Positive = Annotated[float, Gt(0)]


@dataclass(frozen=True, kw_only=True)
class Multicopter:
    """The body of a multicopter, as far as power and sound depend on it.

    Args:
        mass: with battery and camera [kg].
        rotor_area: of the discs of all rotors together [m^2].
        drag_area: drag coefficient times frontal area [m^2].
        standby_power: of everything but the motors [W].
        sound_power_level: of hovering, A-weighted [dB]; drones of the EU's classes C1 and C2 bear it on a label.

    Raises:
        UsageError: a number is not positive and finite.
    """

    mass: Positive
    rotor_area: Positive
    drag_area: Positive
    standby_power: Positive
    sound_power_level: Positive

    def __post_init__(self) -> None:
        """Check every number."""
        for part in fields(self):
            value = getattr(self, part.name)
            if not (isinstance(value, int | float) and 0 < value < math.inf):
                raise UsageError(f"multicopter: expected a positive, finite {part.name}, got {value!r}")

    @property
    def hover_power(self) -> float:
        """The power of hovering [W]."""
        power, _ = self.demands((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), math)
        return float(power)

    @property
    def hover_sound(self) -> float:
        """The sound power of hovering [W]."""
        return HEARING * 10 ** (self.sound_power_level / 10)

    def demands(self, velocity: Sequence[Any], acceleration: Sequence[Any], ops: Trigonometry) -> tuple[Any, Any]:
        """Return the electric power [W] and the sound power [W] of a motion through air that rests.

        Thrust carries the weight, accelerates the mass and overcomes the drag. The rotors' power is the work of the
        thrust, the power that goes into the air that they push down, and that of the blades' drag (Zeng, Xu, Zhang,
        *Energy Minimization for Wireless Communication With Rotary-Wing UAV*, IEEE TWC 2019, Appendix A; the tip speed
        is the one that the thrust asks for). Rotors give no power back. The sound power grows with the sixth power of
        the tip speed (broadband noise; Pegg, NASA TM-80200, 1979), so with the cube of the thrust.

        Args:
            velocity: its three components [m/s], the last one upwards; arrays or symbols.
            acceleration: those of the acceleration [m/s^2].
            ops: where sqrt comes from: `numpy`, `casadi` or `math`.
        """
        squared = _squares(velocity)
        drag = AIR_DENSITY / 2 * self.drag_area * ops.sqrt(squared + SMALL_SPEED**2)
        lift = (0.0, 0.0, GRAVITY)
        force = [
            self.mass * (change + own) + drag * speed
            for change, own, speed in zip(acceleration, lift, velocity, strict=True)
        ]
        thrust = ops.sqrt(_squares(force))
        work = sum(part * speed for part, speed in zip(force, velocity, strict=True))
        hovering = thrust / (2 * AIR_DENSITY * self.rotor_area)  # [m^2/s^2], squared induced speed at rest
        induced = hovering / ops.sqrt(squared / 2 + ops.sqrt(squared * squared / 4 + hovering * hovering))
        tip = ops.sqrt(thrust / (THRUST_COEFFICIENT * AIR_DENSITY * self.rotor_area))
        blades = PROFILE_COEFFICIENT * AIR_DENSITY * self.rotor_area * tip * (tip * tip + 3 * squared)
        rotors = work + INDUCED_FACTOR * thrust * induced + blades
        turned = (rotors + ops.sqrt(rotors * rotors + SMALL_POWER**2)) / 2
        share = thrust / (self.mass * GRAVITY)
        return self.standby_power + turned / EFFICIENCY, self.hover_sound * share * share * share


def intensity(sound_power: Any, distance: Any) -> Any:
    """Return the intensity [W/m^2] of a sound power [W] at a distance [m]: it spreads over a sphere."""
    return sound_power / (4 * math.pi * distance * distance)


def _squares(vector: Sequence[Any]) -> Any:
    return sum(part * part for part in vector)
