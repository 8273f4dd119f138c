"""How far a camera gets in one frame when a vehicle carries it: FlightMotion."""

from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.errors import EpisodeError
from ehar.flight.kinematics import SphericalState
from ehar.flight.limits import keeps_limits
from ehar.flight.profile import JerkProfile, Phases
from ehar.flight.proposals import BRAKING, PROPOSALS, limits_to_rest, limits_to_target
from ehar.flight.telemetry import FlightTelemetry
from ehar.flight.time_optimal import PHASES, AxisLimits, TimeOptimal
from ehar.flight.vehicle import Vehicle
from ehar.viewpoint import AZIMUTH, Workspace, wrap_difference

SAMPLE_TIME = 1e-3  # [s], of the telemetry
WORTH_WHILE = 0.01  # [s]; a flight that arrives sooner by less is not worth a check
NEW_TURN = 5  # [frames]; a new target costs a check in any case, so another proposal is tried only so often
SAME_PLACE = 1e-9  # [m], [rad]


class FlightMotion:
    """A camera that a vehicle carries to the target, re-planned in each frame from what it is doing.

    Ruckig plans on the axes of a viewpoint, where the workspace is a box, straight above is a place like any
    other, and azimuths are taken the short way round. What is limited is Cartesian, so flights are proposed with
    limits per axis from bold to timid, and each is checked as a whole, until it is at rest. The one that arrives
    first, of those that keep the vehicle's limits and stay in the workspace, is flown; a plan that leads to the
    target already only gives way to one that arrives sooner. Where nothing leads to the target, the camera brakes
    or flies the plan that it has. So all limits are kept always, and a target that is held is reached.

    Args:
        vehicle: what carries the camera.
        workspace: where it may be; the paper's by default.
    """

    def __init__(self, *, vehicle: Vehicle, workspace: Workspace | None = None) -> None:
        """Create the motion; it flies after a reset."""
        self.vehicle = vehicle
        self.workspace = workspace or Workspace()
        self._time_optimal = TimeOptimal()

    def reset(self, viewpoint: FloatArray, frame_time: float) -> None:
        """Begin at rest at viewpoints (B, 3); a frame lasts `frame_time` [s].

        Raises:
            EpisodeError: a viewpoint is not finite or outside of the workspace, or the frame time not positive.
        """
        if not (0 < frame_time < np.inf):
            raise EpisodeError(
                f"flight of {self.vehicle.name!r}: expected a positive, finite frame time, got {frame_time}"
            )
        inside = self.workspace.contains(viewpoint) & np.isfinite(viewpoint).all(axis=1)
        if not inside.all():
            bad = int(np.argmin(inside))
            raise EpisodeError(
                f"flight of {self.vehicle.name!r}, episode {bad}: expected a start within {self.workspace}, "
                f"got {viewpoint[bad].tolist()}"
            )
        rest = np.zeros(viewpoint.shape)
        self._frame_time = frame_time
        self._state = SphericalState(np.array(viewpoint, dtype=np.float64), rest, rest, rest)
        none = np.zeros((len(viewpoint), PHASES, 3))
        self._plan = JerkProfile.from_phases(self._state, Phases(none, none))
        self._flown = np.zeros(len(viewpoint))  # [s] of each plan
        self._proposal = np.zeros(len(viewpoint), dtype=np.int64)  # the one adopted last
        self._frames = 0
        self._telemetry = FlightTelemetry.none(len(viewpoint))

    def advance(self, target: FloatArray) -> FloatArray:
        """Fly for one frame towards targets (B, 3) and return the viewpoints reached, (B, 3)."""
        way = self.workspace.clip(target) - self._state.viewpoint
        way[:, AZIMUTH] = wrap_difference(way[:, AZIMUTH])
        off = self._plan.end.viewpoint - self._state.viewpoint - way
        off[:, AZIMUTH] = wrap_difference(off[:, AZIMUTH])
        self._replan(way, np.all(np.abs(off) < SAME_PLACE, axis=1))
        self._flown += self._frame_time
        self._frames += 1
        self._state = SphericalState(*(part[:, 0] for part in self._plan.at(self._flown[:, None])))
        steps = int(np.ceil(self._frame_time / SAMPLE_TIME))
        states = self.sample(np.linspace(0, self._frame_time, steps + 1))
        self._telemetry = self._telemetry.after(self.vehicle, states, self._frame_time)
        return self.workspace.clip(self._state.viewpoint)

    @property
    def telemetry(self) -> FlightTelemetry:
        """What the flights have demanded of the vehicle since the reset."""
        return self._telemetry

    @property
    def velocity(self) -> FloatArray:
        """The rates of distance, azimuth and polar angle, (B, 3) [m/s], [rad/s]."""
        return self._state.velocity

    @property
    def acceleration(self) -> FloatArray:
        """The rates of those rates, (B, 3) [m/s^2], [rad/s^2]."""
        return self._state.acceleration

    def sample(self, times: FloatArray) -> SphericalState:
        """Return the states (B, S, 3) at times (S,) [s] of the last frame, from 0 to the frame time."""
        return self._plan.at(self._flown[:, None] - self._frame_time + times)

    def _replan(self, way: FloatArray, planned: BoolArray) -> None:
        """Find plans to targets `way` (B, 3) from here; those that are planned (B,) lead there already.

        In each frame one proposal, in turn, is tried if it arrives sooner: than the plan does or, where the target
        is new, than the proposal that was adopted last. Then, for a new target, that one is tried, and at last all.
        """
        remaining = self._plan.duration - self._flown - WORTH_WHILE
        rows = np.flatnonzero(~planned | (remaining > 0))
        if len(rows) == 0:
            return
        state, way, pending = _rows(self._state, rows), way[rows], ~planned[rows]
        task = _Task(rows, state, state.viewpoint + way, limits_to_target(self.vehicle, state, way))
        if self._frames > 0:
            last, challenger = self._proposal[rows], np.full(len(rows), self._frames % len(PROPOSALS))
            arrival = np.where(pending, self._durations(task, last), remaining[rows])
            turn = ~pending | (self._frames % NEW_TURN == 0)
            sooner = np.flatnonzero(turn & (self._durations(task, challenger) < arrival))
            pending[self._adopt(task, sooner, challenger[sooner])] = False
            again = np.flatnonzero(pending)
            pending[self._adopt(task, again, last[again])] = False
        left = np.flatnonzero(pending)
        every = np.repeat(np.arange(len(PROPOSALS)), len(left))
        pending[self._adopt(task, np.tile(left, len(PROPOSALS)), every)] = False
        self._brake(rows[pending])

    def _durations(self, task: "_Task", proposal: IntArray) -> FloatArray:
        """Return how long the flights of a task last by proposals (R,), (R,) [s]."""
        limits = task.limits.select(proposal, np.arange(len(proposal)))
        return self._time_optimal.durations(task.start, task.target, limits)

    def _adopt(self, task: "_Task", flight: IntArray, proposal: IntArray) -> IntArray:
        """Plan some flights of a task (n,) by proposals (n,), each by the soonest that may be flown; return which."""
        start = _rows(task.start, flight)
        phases, found = self._time_optimal.to_target(start, task.target[flight], task.limits.select(proposal, flight))
        kept = self._keep(task.rows[flight], JerkProfile.from_phases(start, phases), found)
        self._proposal[task.rows[flight[kept]]] = proposal[kept]
        return flight[kept]

    def _brake(self, rows: IntArray) -> None:
        """Plan to come to rest as soon as may be; where no such plan may be flown, the present one stays."""
        rows = np.tile(rows, len(BRAKING))
        start = _rows(self._state, rows)
        proposal = np.repeat(np.arange(len(BRAKING)), len(rows) // len(BRAKING))
        limits = limits_to_rest(self.vehicle, start).select(proposal, np.arange(len(rows)))
        phases, found = self._time_optimal.to_rest(start, limits)
        self._keep(rows, JerkProfile.from_phases(start, phases), found)

    def _keep(self, rows: IntArray, plan: JerkProfile, found: BoolArray) -> IntArray:
        """Make flights (n,) the plans of rows (n,), the soonest for each, of those that may be flown; return which."""
        kept = np.flatnonzero(found & keeps_limits(plan, self.vehicle, self.workspace))
        kept = kept[np.argsort(-plan.duration[kept])]  # of the plans for one row the last stays
        self._plan.replace(rows[kept], plan.select(kept))
        self._flown[rows[kept]] = 0
        return kept


class _Task(NamedTuple):
    """Flights to be planned."""

    rows: IntArray  # (R,), which of the B
    start: SphericalState  # each (R, 3)
    target: FloatArray  # (R, 3)
    limits: AxisLimits  # each (K, R, 3), one of K for each proposal


def _rows(state: SphericalState, rows: IntArray) -> SphericalState:
    return SphericalState(*(part[rows] for part in state))
