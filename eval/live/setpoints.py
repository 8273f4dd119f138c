"""The setpoints of a drone that carries the camera: they keep its limits, whatever a planner wants or fails to say."""

from dataclasses import dataclass
from threading import Lock

import numpy as np

from ehar.arrays import FloatArray
from ehar.flight.kinematics import SphericalState, local_motion
from ehar.flight.limits import keeps_limits
from ehar.flight.motion import FlightMotion
from ehar.flight.profile import JerkProfile
from ehar.flight.proposals import BRAKING, limits_to_rest
from ehar.flight.time_optimal import TimeOptimal
from ehar.flight.vehicle import Vehicle
from ehar.viewpoint import AZIMUTH, Workspace, cartesian
from eval.live.messages import Vector


@dataclass(frozen=True, kw_only=True)
class Setpoint:
    """Where a drone is to be, in the people's frame: its origin is where people are, x east, y north, z up.

    Args:
        time: when it is to be there [s], counted from the first setpoint.
        position: [m].
        velocity: [m/s].
        acceleration: [m/s^2].
        yaw: where the camera looks, from east towards north [rad], from -pi to pi.
        yaw_rate: [rad/s].
        viewpoint: the same place as distance [m], azimuth and polar angle [rad].
        braking: whether it brakes to hover, or hovers, as nobody says where to go.
    """

    time: float
    position: Vector
    velocity: Vector
    acceleration: Vector
    yaw: float
    yaw_rate: float
    viewpoint: Vector
    braking: bool


class Setpoints:
    """Flies towards targets, one setpoint a frame; any thread may ask.

    Args:
        vehicle: the vehicle that keeps its limits.
        workspace: where the camera may be.
        frame_time: time from one setpoint to the next [s].
    """

    def __init__(self, *, vehicle: Vehicle, workspace: Workspace, frame_time: float) -> None:
        """Create the setpoints; they begin where `begin` says."""
        self.frame_time = frame_time
        self._motion = FlightMotion(vehicle=vehicle, workspace=workspace, moving_centre=True)  # people walk about
        self._time_optimal = TimeOptimal()
        self._lock = Lock()
        self._viewpoint: FloatArray = np.empty((1, 3))
        self._target: FloatArray | None = None
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
                self._target = self._viewpoint

    def aim(self, target: FloatArray) -> None:
        """Fly to a target (3,) from now on, as far as the workspace allows."""
        with self._lock:
            self._target, self._braking = np.array(target, dtype=np.float64)[None], False

    def brake(self) -> None:
        """Come to rest as soon as the limits allow, and hover there until there is a target."""
        with self._lock:
            if self._target is not None and not self._braking:
                self._target, self._braking = self._resting_place(), True

    def next(self) -> Setpoint:
        """Return the setpoint one frame later."""
        with self._lock:
            assert self._target is not None
            self._viewpoint = self._motion.advance(self._target)
            self._frames += 1
            state = self._motion.sample(np.array([self.frame_time]))
            braking = self._braking
        return _setpoint(SphericalState(*(part[0, 0] for part in state)), self._frames * self.frame_time, braking)

    def state(self) -> SphericalState:
        """Return the present viewpoint and its derivatives, each (1, 3)."""
        with self._lock:
            viewpoint = self._viewpoint.copy()
            velocity, acceleration = self._motion.velocity.copy(), self._motion.acceleration.copy()
        return SphericalState(viewpoint, velocity, acceleration, np.zeros_like(velocity))

    @property
    def resting(self) -> bool:
        """Whether the vehicle hovers."""
        state = self.state()
        return not (state.velocity.any() or state.acceleration.any())  # both end at exactly 0

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


def _setpoint(state: SphericalState, time: float, braking: bool) -> Setpoint:
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
    )


def _vector(array: FloatArray) -> Vector:
    x, y, z = array.tolist()
    return x, y, z
