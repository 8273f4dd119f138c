"""The setpoints of a drone that carries the camera: they keep its limits, whatever a planner wants or fails to say."""

from dataclasses import dataclass
from threading import Lock
from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray
from ehar.flight.centre import centre_limits
from ehar.flight.kinematics import SphericalState, local_motion
from ehar.flight.limits import keeps_limits
from ehar.flight.motion import FlightMotion
from ehar.flight.profile import JerkProfile
from ehar.flight.proposals import BRAKING, limits_to_rest
from ehar.flight.time_optimal import TimeOptimal
from ehar.flight.vehicle import Vehicle
from ehar.localisation import USUAL_LOCALISATION, FollowedCentre, Localisation
from ehar.viewpoint import AZIMUTH, Workspace, cartesian
from eval.live.messages import Vector

SLOW = 0.02  # [m/s] at which a people's frame counts as at rest


class Centre(NamedTuple):
    """The motion of the people's frame in the vehicle's local frame: east, north, up."""

    position: Vector  # [m]
    velocity: Vector  # [m/s]
    acceleration: Vector  # [m/s^2]


@dataclass(frozen=True, kw_only=True)
class Setpoint:
    """Where a drone is to be, in the people's frame: its origin is where people are, x east, y north, z up.

    Args:
        time: when it is to be there [s] after `begin`; the first one a frame after it.
        position: [m].
        velocity: [m/s].
        acceleration: [m/s^2].
        yaw: where the camera looks, from east towards north [rad], from -pi to pi.
        yaw_rate: [rad/s].
        viewpoint: the same place as distance [m], azimuth and polar angle [rad].
        braking: whether it brakes to hover, or hovers, as nobody says where to go.
        centre: the motion of the people's frame then, which comes on top; None if no frame says where people are.
    """

    time: float
    position: Vector
    velocity: Vector
    acceleration: Vector
    yaw: float
    yaw_rate: float
    viewpoint: Vector
    braking: bool
    centre: Centre | None = None

    @property
    def whole(self) -> Centre:
        """The drone's motion in the local frame; in the people's, if nobody knows where that is."""
        motion = Centre(self.position, self.velocity, self.acceleration)
        return motion if self.centre is None else Centre(*map(_sum, motion, self.centre))


class Setpoints:
    """Flies towards targets, one setpoint a frame; any thread may ask.

    Args:
        vehicle: the vehicle that keeps its limits.
        workspace: where the camera may be.
        frame_time: time from one setpoint to the next [s].
        localisation: how well it is told where people are; its delay is not used, and what is told counts as of now.
        origin: where people are taken to be in the local frame until somebody says it [m].
    """

    def __init__(
        self,
        *,
        vehicle: Vehicle,
        workspace: Workspace,
        frame_time: float,
        localisation: Localisation = USUAL_LOCALISATION,
        origin: Vector = (0.0, 0.0, 0.0),
    ) -> None:
        """Create the setpoints; they begin where `begin` says."""
        import filterpy.kalman  # noqa: F401  # for `follow`: it takes long, and later somebody flies

        self.frame_time = frame_time
        self._motion = FlightMotion(vehicle=vehicle, workspace=workspace, moving_centre=True)  # people walk about
        self._time_optimal = TimeOptimal()
        self._lock = Lock()
        self._viewpoint: FloatArray = np.empty((1, 3))
        self._target: FloatArray | None = None
        self._path: FloatArray | None = None  # (1, F, 3, 3) after each of the next frames
        self._limits, self._localisation = centre_limits(vehicle), localisation
        self._origin = np.array(origin, dtype=np.float64)
        self._centre: FollowedCentre | None = None
        self._braking = False
        self._frames = 0

    @property
    def begun(self) -> bool:
        """Whether there are setpoints."""
        return self._target is not None

    @property
    def braking(self) -> bool:
        """Whether it brakes or hovers until there is a target."""
        return self._braking

    def begin(self, viewpoint: FloatArray) -> bool:
        """Begin at rest at a viewpoint (3,); return whether it is in the workspace, and so whether they began."""
        with self._lock:
            if self._target is None and self._motion.workspace.contains(viewpoint):
                self._viewpoint = np.array(viewpoint, dtype=np.float64)[None]
                self._motion.reset(self._viewpoint, self.frame_time)
                self._target = self._viewpoint
            return self._target is not None

    def settle(self) -> None:
        """If the vehicle hovers, plan as if it had just begun there: where it goes then depends on nothing before."""
        if self.begun and self.resting:
            with self._lock:
                self._motion.reset(self._viewpoint, self.frame_time)
                self._target, self._path = self._viewpoint, None

    def aim(self, target: FloatArray, path: FloatArray | None = None) -> None:
        """Fly to a target (3,) from now on, as far as the workspace allows.

        Args:
            target: the target.
            path: (1, F, 3, 3), the way there: viewpoint, velocity and acceleration after each of the next frames, as
                `FlightMotion.follow` takes it; None flies as the motion itself finds best.
        """
        with self._lock:
            self._target, self._path, self._braking = np.array(target, dtype=np.float64)[None], path, False

    def follow(self, place: Vector, time: float) -> Vector:
        """Follow people who are said to be at a place in the local frame [m]; return where their frame is taken to be.

        Args:
            place: where they are.
            time: when that was, by the clock of all such times [s]; how long ago that is, is not made up for.
        """
        with self._lock:
            if self._target is None or (self._centre is None and not self._frames):
                self._centre = self._centre_at(np.array(place), time)  # nobody flies yet: the frame is where people are
            else:
                if self._centre is None:  # in flight the frame leaves where it was taken to be, and keeps the limits
                    self._centre = self._centre_at(self._origin, -np.inf)
                self._centre.tell(np.array(place), time)
            return _vector(self._centre.motion.position)

    def _centre_at(self, place: FloatArray, time: float) -> FollowedCentre:
        """Return a frame at rest at a place (3,)."""
        return FollowedCentre(place, time, self.frame_time, self._limits, self._localisation)

    def brake(self) -> None:
        """Come to rest as soon as the limits allow, and hover there until there is a target."""
        with self._lock:
            if self._target is not None and not self._braking:
                self._target, self._path, self._braking = self._resting_place(), None, True

    def next(self) -> Setpoint:
        """Return the setpoint one frame later."""
        with self._lock:
            assert self._target is not None
            self._viewpoint = self._motion.advance(self._target) if self._path is None else self._along(self._path)
            self._frames += 1
            state = self._motion.sample(np.array([self.frame_time]))
            braking = self._braking
            centre = None if self._centre is None else Centre(*map(_vector, self._centre.next()[:3]))
            time = self._frames * self.frame_time
        return _setpoint(SphericalState(*(part[0, 0] for part in state)), time, braking, centre)

    def state(self) -> SphericalState:
        """Return the present viewpoint and its derivatives, each (1, 3)."""
        with self._lock:
            viewpoint = self._viewpoint.copy()
            velocity, acceleration = self._motion.velocity.copy(), self._motion.acceleration.copy()
        return SphericalState(viewpoint, velocity, acceleration, np.zeros_like(velocity))

    @property
    def resting(self) -> bool:
        """Whether the vehicle hovers in the people's frame."""
        state = self.state()
        return not (state.velocity.any() or state.acceleration.any())  # both end at exactly 0

    @property
    def hovering(self) -> bool:
        """Whether the vehicle hovers, and the people's frame rests."""
        with self._lock:
            still = self._centre is None or float(np.linalg.norm(self._centre.motion.velocity)) < SLOW
        return self.resting and still

    def _along(self, path: FloatArray) -> FloatArray:
        """Fly for one frame along a path, keep what is left of it, and return the viewpoint (1, 3)."""
        self._path = path[:, 1:] if path.shape[1] > 1 else None
        return self._motion.follow(path)

    def _resting_place(self) -> FloatArray:
        """Return the viewpoint (1, 3) of the soonest rest that keeps the limits; the target if there is none."""
        assert self._target is not None
        state = SphericalState(*(part[:, 0] for part in self._motion.sample(np.array([self.frame_time]))))
        copies = SphericalState(*(np.repeat(part, len(BRAKING), axis=0) for part in state))
        every = np.arange(len(BRAKING))
        limits = limits_to_rest(self._motion.vehicle, copies).select(every, every)
        phases, found = self._time_optimal.to_rest(copies, limits)
        plan = JerkProfile.from_phases(copies, phases)
        kept = np.flatnonzero(found & keeps_limits(plan, self._motion.vehicle, self._motion.workspace))
        if not len(kept):
            return self._target
        soonest = kept[plan.duration[kept].argmin()]
        return plan.end.viewpoint[[soonest]]


def _setpoint(state: SphericalState, time: float, braking: bool, centre: Centre | None) -> Setpoint:
    """Return the setpoint of a state, each (3,)."""
    azimuth = float(state.viewpoint[AZIMUTH])
    motion = local_motion(state)
    cos, sin = np.cos(azimuth), np.sin(azimuth)
    to_axes = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return Setpoint(
        time=time,
        position=_vector(cartesian(state.viewpoint)),
        velocity=_vector(to_axes @ motion.velocity),
        acceleration=_vector(to_axes @ motion.acceleration),
        yaw=float(np.remainder(azimuth, 2 * np.pi) - np.pi),  # the camera looks back at the people
        yaw_rate=float(state.velocity[AZIMUTH]),
        viewpoint=_vector(state.viewpoint),
        braking=braking,
        centre=centre,
    )


def _vector(array: FloatArray) -> Vector:
    x, y, z = array.tolist()
    return x, y, z


def _sum(one: Vector, other: Vector) -> Vector:
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


class LimitShares:
    """How much of a vehicle's limits a stream of setpoints uses: the greatest share of each; above 1 one is broken.

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

    def take(self, setpoint: Setpoint | None) -> None:
        """Take one more setpoint."""
        if setpoint is None:
            return
        vehicle, (_, velocity, acceleration) = self._vehicle, setpoint.whole
        up = velocity[2]
        used = {
            "speed": float(np.linalg.norm(velocity)) / vehicle.speed,
            "acceleration": float(np.linalg.norm(acceleration)) / vehicle.acceleration,
            "climb": up / vehicle.climb_speed if up > 0 else -up / vehicle.descent_speed,
            "yaw rate": abs(setpoint.yaw_rate) / vehicle.yaw_rate,
        }
        if self._before is not None:
            change = np.subtract(acceleration, self._before.whole.acceleration)
            used["jerk"] = float(np.linalg.norm(change)) / (setpoint.time - self._before.time) / vehicle.jerk
        self.greatest |= {name: max(self.greatest[name], share) for name, share in used.items()}
        self._before = setpoint
