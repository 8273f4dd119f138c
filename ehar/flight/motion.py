"""`FlightMotion`: a vehicle carries the camera to its targets."""

from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.errors import EpisodeError
from ehar.flight.clearance import first_towards, keeps_clear
from ehar.flight.kinematics import SphericalState
from ehar.flight.limits import keeps_limits
from ehar.flight.profile import JerkProfile, Phases
from ehar.flight.proposals import BRAKING, PROPOSALS, limits_to_rest, limits_to_target
from ehar.flight.telemetry import FlightTelemetry
from ehar.flight.time_optimal import PHASES, AxisLimits, TimeOptimal
from ehar.flight.vehicle import Vehicle
from ehar.obstacles.free_space import FreeSpace
from ehar.obstacles.surroundings import Surroundings
from ehar.viewpoint import AZIMUTH, Workspace, wrap_difference

SAMPLE_TIME = 1e-3  # [s], between samples of the telemetry
WORTH_WHILE = 0.01  # [s]; a flight that arrives sooner by less is not worth a check
NEW_TURN = 5  # [frames]; a new target always costs a check, so another proposal is tried only this often
SAME_PLACE = 1e-9  # [m], [rad]


class FlightMotion:
    """A camera that a vehicle carries to its target; every frame plans anew from the present state.

    Ruckig plans on the axes of a viewpoint. There the workspace is a box, straight above is a place like any other, and
    azimuths go the short way round. The vehicle's limits are Cartesian, so flights are proposed with limits per axis,
    from bold to timid, and each proposal is checked until it is at rest. A proposal is valid if it keeps the vehicle's
    limits and stays in the workspace. The camera flies the valid proposal that arrives first. A plan that already leads
    to the target is replaced only by one that arrives sooner. If no valid proposal leads to the target, the camera
    brakes or keeps its plan. So a flight always keeps all limits, and it reaches any target that is held.

    Among obstacles a proposal is valid only if it also keeps clear of them until it is at rest. Where the straight way
    to the target does not, the camera flies first to a place on a free way that is in sight. In streams obstacles are
    taken to be where they are now relative to people, and there are no such places.

    Args:
        vehicle: the vehicle that carries the camera.
        workspace: where it may be; the paper's by default.
    """

    def __init__(self, *, vehicle: Vehicle, workspace: Workspace | None = None) -> None:
        """Create the motion; it flies after a reset."""
        self.vehicle = vehicle
        self.workspace = workspace or Workspace()
        self._time_optimal = TimeOptimal()
        self._surroundings: Surroundings | None = None

    def keep_clear(self, surroundings: Surroundings | None) -> None:
        """Keep clear of obstacles from the next reset on; None is an open world."""
        self._surroundings = surroundings if surroundings is not None and surroundings.obstacles else None

    def reset(self, viewpoint: FloatArray, frame_time: float) -> None:
        """Begin at rest at viewpoints (B, 3); a frame lasts `frame_time` [s].

        Raises:
            EpisodeError: a viewpoint is not finite or is outside the workspace, or the frame time is not positive.
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
        self._flown = np.zeros(len(viewpoint))  # [s], how long each plan has been flown
        self._proposal = np.zeros(len(viewpoint), dtype=np.int64)  # index of the proposal that was adopted last
        self._frames = 0
        self._telemetry = FlightTelemetry.none(len(viewpoint))

    def advance(self, target: FloatArray) -> FloatArray:
        """Fly for one frame towards targets (B, 3) and return the viewpoints reached, (B, 3)."""
        way = self._towards(self.workspace.clip(target)) - self._state.viewpoint
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
        """The demands of the flights on the vehicle since the reset."""
        return self._telemetry

    @property
    def velocity(self) -> FloatArray:
        """The rates of distance, azimuth and polar angle, (B, 3) [m/s], [rad/s]."""
        return self._state.velocity

    @property
    def acceleration(self) -> FloatArray:
        """The derivatives of `velocity`, (B, 3) [m/s^2], [rad/s^2]."""
        return self._state.acceleration

    def sample(self, times: FloatArray) -> SphericalState:
        """Return the states (B, S, 3) at times (S,) [s] of the last frame, from 0 to the frame time."""
        return self._plan.at(self._flown[:, None] - self._frame_time + times)

    def _towards(self, target: FloatArray) -> FloatArray:
        """Return where to fly first to get to targets (B, 3)."""
        around = self._surroundings
        if around is None or around.moved is not None:
            return target
        here = self.workspace.clip(self._state.viewpoint)
        return first_towards(here, target, FreeSpace.of(self.workspace, around.obstacles))

    def _clear(self, rows: IntArray, plan: JerkProfile) -> BoolArray:
        """Return which flights (n,) of rows (n,) keep clear of obstacles."""
        around = self._surroundings
        if around is None:
            return np.ones(len(rows), dtype=bool)
        moved = np.zeros((len(rows), 3)) if around.moved is None else around.moved[rows, self._frames]
        return keeps_clear(plan, around.obstacles, moved, self.vehicle.speed)

    def _replan(self, way: FloatArray, planned: BoolArray) -> None:
        """Find plans to targets that lie `way` (B, 3) from here; plans where `planned` (B,) already lead there.

        Every frame tries one proposal, in turn, if it arrives sooner than the plan. For a new target it has to arrive
        sooner than the proposal that was adopted last; next, that proposal is tried, and finally all of them.
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
        """Return how long the flights of a task last with proposals (R,), (R,) [s]."""
        limits = task.limits.select(proposal, np.arange(len(proposal)))
        return self._time_optimal.durations(task.start, task.target, limits)

    def _adopt(self, task: "_Task", flight: IntArray, proposal: IntArray) -> IntArray:
        """Plan flights (n,) of a task with proposals (n,), keep the soonest valid plans, and return their flights."""
        start = _rows(task.start, flight)
        phases, found = self._time_optimal.to_target(start, task.target[flight], task.limits.select(proposal, flight))
        kept = self._keep(task.rows[flight], JerkProfile.from_phases(start, phases), found)
        self._proposal[task.rows[flight[kept]]] = proposal[kept]
        return flight[kept]

    def _brake(self, rows: IntArray) -> None:
        """Plan to come to rest as soon as possible; without a valid plan, the present one stays."""
        rows = np.tile(rows, len(BRAKING))
        start = _rows(self._state, rows)
        proposal = np.repeat(np.arange(len(BRAKING)), len(rows) // len(BRAKING))
        limits = limits_to_rest(self.vehicle, start).select(proposal, np.arange(len(rows)))
        phases, found = self._time_optimal.to_rest(start, limits)
        self._keep(rows, JerkProfile.from_phases(start, phases), found)

    def _keep(self, rows: IntArray, plan: JerkProfile, found: BoolArray) -> IntArray:
        """Make the soonest valid ones of flights (n,) the plans of rows (n,); return which are valid."""
        kept = np.flatnonzero(found & keeps_limits(plan, self.vehicle, self.workspace))
        kept = kept[self._clear(rows[kept], plan.select(kept))]
        # The last, soonest plan of each row stays. Ties keep their order, so no row depends on the rows beside it.
        kept = kept[np.argsort(-plan.duration[kept], kind="stable")]
        self._plan.replace(rows[kept], plan.select(kept))
        self._flown[rows[kept]] = 0
        return kept


class _Task(NamedTuple):
    """Flights to be planned."""

    rows: IntArray  # (R,), indices of the episodes
    start: SphericalState  # each (R, 3)
    target: FloatArray  # (R, 3)
    limits: AxisLimits  # each (K, R, 3), for K proposals


def _rows(state: SphericalState, rows: IntArray) -> SphericalState:
    return SphericalState(*(part[rows] for part in state))
