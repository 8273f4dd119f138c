"""Vehicles: the limits that a flight keeps, what their flights cost, four named vehicles, and vehicle files."""

import math
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Le

from ehar.errors import UsageError
from ehar.files import read_json
from ehar.flight.multicopter import Multicopter

LEAST_LIMIT, MOST_LIMIT = 0.01, 1e5  # in m, s and degrees; beyond them flights take too long to plan or to check
Limit = Annotated[float, Ge(LEAST_LIMIT), Le(MOST_LIMIT)]


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """The limits of one vehicle.

    Speed, acceleration and jerk limit the length of the camera's Cartesian vectors, in any direction.

    Args:
        name: name of the vehicle in reports.
        speed: greatest speed [m/s].
        acceleration: greatest acceleration, besides the lift that carries the weight [m/s^2].
        jerk: greatest jerk [m/s^3].
        climb_speed: greatest speed upwards [m/s].
        descent_speed: greatest speed downwards [m/s].
        yaw_rate: greatest rate of turn about the vertical axis [rad/s].
        body: what power and sound depend on; None for one whose flights have neither, as that of a robot on wheels.

    Raises:
        UsageError: a limit is no number from `LEAST_LIMIT` to `MOST_LIMIT`.
    """

    name: str
    speed: float
    acceleration: float
    jerk: float
    climb_speed: float
    descent_speed: float
    yaw_rate: float
    body: Multicopter | None = None

    def __post_init__(self) -> None:
        """Check every limit."""
        for limit in LIMITS:
            value = getattr(self, limit)
            unit = math.radians(1) if limit == "yaw_rate" else 1.0
            least, most = unit * LEAST_LIMIT, unit * MOST_LIMIT
            if not isinstance(value, int | float) or isinstance(value, bool) or not least <= value <= most:
                raise UsageError(f"vehicle {self.name!r}: expected a {limit} from {least:g} to {most:g}, got {value!r}")


LIMITS = tuple(field.name for field in fields(Vehicle) if field.name not in ("name", "body"))


@dataclass(frozen=True, kw_only=True)
class VehicleFile:
    """The content of a vehicle file: as in `Vehicle`, but the yaw rate is in degrees per second. It may lack a body."""

    speed: Limit
    acceleration: Limit
    jerk: Limit
    climb_speed: Limit
    descent_speed: Limit
    yaw_rate_deg: Limit
    body: Multicopter | None = None

    def vehicle(self, name: str) -> Vehicle:
        """Return the vehicle under a name."""
        limits = asdict(self) | {"body": self.body}
        return Vehicle(name=name, yaw_rate=math.radians(limits.pop("yaw_rate_deg")), **limits)


def _rotors(diameter: float) -> float:
    """Return the area [m^2] of four rotors, each of so many inches."""
    return math.pi * (0.0254 * diameter) ** 2


def _permitted(mass: float) -> float:
    """Return the sound power level [dB] that the EU permitted a drone of a mass [kg] from 2019 on.

    It is that of hovering, A-weighted, in Part 15 of the annex to Regulation (EU) 2019/945, for 0.9 to 4 kg.
    """
    return round(85 + 18.5 * math.log10(mass / 0.9), 1)


# The quadrotor of PX4's simulator, x500: its mass, and propellers of 10 inches as its kit has. The other numbers are
# our choice. It hovers with 239 W.
X500 = Multicopter(
    mass=2.06, rotor_area=_rotors(10), drag_area=0.04, standby_power=8.0, sound_power_level=_permitted(2.06)
)
# DJI's Mavic 4 Pro: the mass of its data sheet; a drag at which it flies 25 m/s at a tilt of 40 degrees; and a standby
# power with which it hovers as long as the data sheet says, 45 minutes on 95.3 Wh. The size of the rotors is that of
# Mavic 3, as makers publish none.
CAMERA_DRONE = Multicopter(
    mass=1.063, rotor_area=_rotors(9.4), drag_area=0.023, standby_power=36.0, sound_power_level=_permitted(1.063)
)

VEHICLES = {
    vehicle.name: vehicle
    for vehicle in (
        # PX4's defaults for missions, multicopter_autonomous_params: MPC_XY_CRUISE, MPC_ACC_HOR, MPC_JERK_AUTO,
        # MPC_Z_V_AUTO_UP, MPC_Z_V_AUTO_DN, MPC_YAWRAUTO_MAX (60 deg/s in the newest releases).
        Vehicle(
            name="px4-auto",
            speed=5.0,
            acceleration=3.0,
            jerk=4.0,
            climb_speed=3.0,
            descent_speed=1.5,
            yaw_rate=math.radians(45),
            body=X500,
        ),
        # PX4's greatest in position mode: MPC_XY_VEL_MAX, MPC_ACC_HOR_MAX, MPC_JERK_MAX, MPC_Z_VEL_MAX_UP,
        # MPC_Z_VEL_MAX_DN, MPC_MAN_Y_MAX.
        Vehicle(
            name="px4-max",
            speed=12.0,
            acceleration=5.0,
            jerk=8.0,
            climb_speed=3.0,
            descent_speed=1.5,
            yaw_rate=math.radians(150),
            body=X500,
        ),
        # A camera drone that follows people: 15 m/s while tracking (DJI Mavic 4 Pro, data sheet), the acceleration
        # of a tilt of 35 degrees, g tan(35 deg). The others are our choice for a drone of this class: the full
        # tilt within half a second, as makers publish no jerk, and moderate vertical speeds and yaw rate.
        Vehicle(
            name="tracking-drone",
            speed=15.0,
            acceleration=6.9,
            jerk=14.0,
            climb_speed=6.0,
            descent_speed=6.0,
            yaw_rate=math.radians(100),
            body=CAMERA_DRONE,
        ),
        # A wheeled robot in a room, with the camera on a mast that goes up and down and turns. All limits are our
        # choice: half a walker's pace, up to speed within a second and smoothly, as a mast sways, and a slow lift. A
        # camera that keeps its distance and its polar angle needs no lift; any other way is as slow as the lift makes
        # it. The mast may turn faster than the base.
        Vehicle(
            name="ground-robot",
            speed=0.5,
            acceleration=0.5,
            jerk=1.0,
            climb_speed=0.15,
            descent_speed=0.15,
            yaw_rate=math.radians(90),
        ),
    )
}


def load_vehicle(name_or_path: str | Path) -> Vehicle:
    """Return a vehicle of `VEHICLES` by its name, or read a vehicle file.

    A vehicle file is a JSON object, whose keys are the fields of `VehicleFile`; `body` may be missing. The name of the
    file, without `.json`, is the name of the vehicle.

    Raises:
        UsageError: there is no such vehicle or file, the file has the name of a vehicle of ehar, or a key is missing,
            unknown, or not a positive number.
    """
    if isinstance(name_or_path, str) and name_or_path in VEHICLES:
        return VEHICLES[name_or_path]
    path = Path(name_or_path)
    if path.suffix != ".json":
        raise UsageError(
            f"unknown vehicle {str(name_or_path)!r}; expected one of: {', '.join(VEHICLES)}, or a .json file"
        )
    if path.stem in VEHICLES:  # what is trained is kept under the name
        raise UsageError(f"{path}: expected another name of a vehicle file, {path.stem!r} is a vehicle of ehar")
    held = read_json(path, VehicleFile, "a vehicle file", optional=("body",), wrong=UsageError)
    return held.vehicle(path.stem)
