"""`FlightMotion`: a vehicle carries the camera to its targets."""

from copy import copy
from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.errors import EpisodeError
from ehar.flight.centre import around_centre
from ehar.flight.clearance import Around, first_towards, free_space_of_flights, keeps_clear, leads_nearer
from ehar.flight.costs import flight_costs
from ehar.flight.evasion import CLEARER, clearance_ahead, clearest
from ehar.flight.kinematics import CartesianMotion, SphericalState
from ehar.flight.limits import keeps_limits, motion_shares, world_motion
from ehar.flight.profile import (
    JerkProfile,
    Phases,
    coasted,
    phases_along,
    phases_between,
    phases_to_rest,
    rates_after,
)
from ehar.flight.proposals import BRAKING, PROPOSALS, STRAIGHT, limits_to_rest, limits_to_target, stopping_time
from ehar.flight.telemetry import FlightTelemetry
from ehar.flight.time_optimal import PHASES, AxisLimits, TimeOptimal
from ehar.flight.vehicle import Vehicle
from ehar.localisation import CentreMotion
from ehar.obstacles.free_space import FreeSpace
from ehar.obstacles.surroundings import Surroundings, too_near
from ehar.viewpoint import AZIMUTH, DISTANCE, Workspace, cartesian, wrap_difference

SAMPLE_TIME = 1e-3  # [s], between samples of the telemetry
WORTH_WHILE = 0.01  # [s]; a flight that arrives sooner by less is not worth a check
# In how many frames to get to a path, and how many of its frames to fly; None is all.
JOINS = ((1, None), (1, 12), (4, None), (12, None), (36, None))
STOPS = (0.7, 1.0, 1.4, 2.0, 2.8)  # times the usual time of a stop, in which a camera tries to stop
NEW_TURN = 5  # [frames]; a new target always costs a check, so another proposal is tried only this often
SAME_PLACE = 1e-9  # [m], [rad]
SAME_RATE = 1e-6  # [m/s], [rad/s] and per second: what a path claims to end in, and where its accelerations lead


class FlightMotion:
    """A camera that a vehicle carries to its target; every frame plans anew from the present state.

    Ruckig plans on the axes of a viewpoint. There the workspace is a box, straight above is a place like any other, and
    azimuths go the short way round. The vehicle's limits are Cartesian, so flights are proposed with limits per axis,
    from bold to timid, and each proposal is checked until it is at rest. A proposal is valid if it keeps the vehicle's
    limits and stays in the workspace. The camera flies the valid proposal that arrives first. A plan that already leads
    to the target is replaced only by one that arrives sooner. If no valid proposal leads to the target, the camera
    brakes or keeps its plan. So a flight always keeps all limits, and it reaches any target that is held.

    Among obstacles a proposal is valid only if it also keeps clear of them until it is at rest. Where the straight way
    to the target does not, the camera flies first to a place on a free way that is in sight. A straight flight from
    rest gets there, and a plan that leads nearer to the target is not braked. In streams people may walk on for a
    while, or speed up, and there are no such places. Where they carry a camera towards something, it evades: see
    `ehar.flight.evasion`.

    Around a moving centre, a flight has what following the centre leaves of the vehicle's limits: see
    `ehar.flight.centre`.

    Args:
        vehicle: the vehicle that carries the camera.
        workspace: where it may be; the paper's by default.
        moving_centre: whether the centre moves.

    Attributes:
        vehicle: the limits of flights around the centre.
        centre: the motion of the centre, each (B, L, 3), of which flights know the present; None if it rests.
    """

    def __init__(self, *, vehicle: Vehicle, workspace: Workspace | None = None, moving_centre: bool = False) -> None:
        """Create the motion; it flies after a reset."""
        self.vehicle = around_centre(vehicle) if moving_centre else vehicle
        self.centre: CentreMotion | None = None
        self._whole = vehicle
        self.workspace = workspace or Workspace()
        self._time_optimal = TimeOptimal()
        self._surroundings: Surroundings | None = None
        self._free_space: FreeSpace | None = None  # where ways around obstacles lead

    def keep_clear(self, surroundings: Surroundings | None) -> None:
        """Keep clear of obstacles from the next reset on; None is an open world.

        Raises:
            UsageError: no flight is possible among them, or no camera sees anybody.
        """
        around = surroundings if surroundings is not None and surroundings.can_be_hit else None
        self._surroundings, self._free_space = around, None
        if around is not None and around.obstacles and around.moved is None:
            self._free_space = free_space_of_flights(self.workspace, around.obstacles)

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
        self._evades = np.zeros(len(viewpoint), dtype=bool)  # whether the plan evades something
        self._frames = 0
        self._telemetry: FlightTelemetry | None = FlightTelemetry.none(len(viewpoint))

    def forked(self, paths: int) -> "FlightMotion":
        """Return a motion of B x `paths` cameras that go on from here, each for itself; it has no telemetry.

        Those of the first camera come first, then those of the second.
        """
        rows = np.repeat(np.arange(len(self._flown)), paths)
        fork = copy(self)
        fork._state, fork._plan = self._state.select(rows), self._plan.select(rows)
        fork._flown, fork._proposal, fork._evades = self._flown[rows], self._proposal[rows], self._evades[rows]
        fork.centre = None if self.centre is None else CentreMotion(*(part[rows] for part in self.centre))
        fork._surroundings = None if self._surroundings is None else self._surroundings.select(rows)
        fork._telemetry = None
        return fork

    def advance(self, target: FloatArray) -> FloatArray:
        """Fly for one frame towards targets (B, 3) and return the viewpoints reached, (B, 3)."""
        self._head_for(target, np.arange(len(target)))
        self._evade()
        return self._fly(np.full(target.shape, np.nan))

    def follow(self, states: FloatArray) -> FloatArray:
        """Fly for one frame along a path and return the viewpoints reached, (B, 3).

        A camera that is off its path gets back to it within some frames. It stops after the path, if that does not end
        at rest. A path is flown if the whole flight is valid. If no valid flight leads along it, the camera flies to
        its end, as to a target.

        Args:
            states: (B, F, 3, 3) after each of the next F frames: viewpoint, velocity, acceleration. The jerk is
                constant within a frame.
        """
        path = np.array(states)
        turns = wrap_difference(
            np.diff(path[:, :, 0, AZIMUTH], axis=1, prepend=self._state.viewpoint[:, None, AZIMUTH])
        )
        path[:, :, 0, AZIMUTH] = self._state.viewpoint[:, None, AZIMUTH] + np.cumsum(turns, axis=1)
        pending = np.flatnonzero(~self._leads_along(path))
        for lead, frames in JOINS:
            pending = pending[~self._join(pending, path[pending, :frames], lead)]
        self._head_for(path[:, -1, 0], pending)
        self._evade()
        return self._fly(cartesian(path[:, 0, 0]))

    def _leads_along(self, path: FloatArray) -> BoolArray:
        """Return which plans already lead along paths (B, F, 3, 3) to their ends, (B,)."""
        frames = 1 + np.array([0, path.shape[1] - 1])
        planned = np.stack(self._plan.at(self._flown[:, None] + self._frame_time * frames)[:3], axis=2)
        off = np.abs(planned - path[:, [0, -1]]).max(axis=(1, 2, 3))
        ends = self._plan.duration < self._flown + self._frame_time * (frames[-1] + 0.5)
        leads: BoolArray = np.less(off, SAME_PLACE) & ends
        return leads

    def _join(self, rows: IntArray, path: FloatArray, lead: int) -> BoolArray:
        """Plan flights that are on paths (R, F, 3, 3) after `lead` frames; return in which of the rows that is valid.

        A path that is shorter goes on at constant acceleration. One whose accelerations do not lead to the rates in
        which it claims to end is refused: nobody can fly it.
        """
        start, time = self._state.select(rows), self._frame_time
        joined = min(lead, path.shape[1]) - 1
        ahead, end = (coasted(_state(path[:, frame]), (lead - 1 - joined) * time) for frame in (joined, -1))
        along = phases_along(path[:, joined:, 2], time)
        usual = stopping_time(self.vehicle, end)
        at_rest = ~path[:, -1, 1:].any(axis=(1, 2))
        off = np.stack(rates_after(ahead, along)) - np.stack([end.velocity, end.acceleration])
        flyable = np.abs(off).max(axis=(0, 2)) < SAME_RATE
        kept = np.zeros(len(rows), dtype=bool)
        for factor in (None, *STOPS):
            left = np.flatnonzero(flyable & ~kept & (at_rest if factor is None else ~at_rest))
            if not left.size:
                continue
            parts = [phases_between(start.select(left), ahead.select(left), lead * time), along.select(left)]
            if factor is not None:
                parts.append(phases_to_rest(end.select(left), factor * usual[left]))
            plan = JerkProfile.from_phases(start.select(left), Phases.joined(parts))
            kept[left[self._keep(rows[left], plan, np.ones(len(left), dtype=bool))]] = True
        return kept

    def _fly(self, wanted: FloatArray) -> FloatArray:
        """Fly the plans for one frame and return the viewpoints reached, (B, 3).

        Args:
            wanted: where the cameras should then be, (B, 3) [m] relative to the centre; NaN if that was not said.
        """
        self._flown += self._frame_time
        self._evades &= self._flown < self._plan.duration
        self._frames += 1
        self._state = SphericalState(*(part[:, 0] for part in self._plan.at(self._flown[:, None])))
        if self._telemetry is not None:
            self._telemetry = self._measured(self._telemetry, wanted)
        return self.workspace.clip(self._state.viewpoint)

    def _measured(self, telemetry: FlightTelemetry, wanted: FloatArray) -> FlightTelemetry:
        """Return the telemetry after the last frame; for `wanted` see `_fly`."""
        times = np.linspace(0, self._frame_time, int(np.ceil(self._frame_time / SAMPLE_TIME)) + 1)
        states = self.sample(times)
        error = np.linalg.norm(cartesian(self._state.viewpoint) - wanted, axis=-1)
        motion = world_motion(states, self._centre_motion(times))
        shares = motion_shares(self._whole, motion, states.velocity[..., AZIMUTH])
        costs = flight_costs(self._whole.body, motion, states.viewpoint[..., DISTANCE], self._frame_time)
        return telemetry.after(self._whole, shares, self._frame_time, error, costs)

    @property
    def telemetry(self) -> FlightTelemetry:
        """The demands of the flights on the vehicle since the reset.

        Raises:
            EpisodeError: these are forks of flights, of which nothing is measured.
        """
        if self._telemetry is None:
            raise EpisodeError(f"flight of {self.vehicle.name!r}: expected one that is measured, got a fork")
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
        space = self._free_space
        return target if space is None else first_towards(self.workspace.clip(self._state.viewpoint), target, space)

    def _around(self, rows: IntArray) -> Around | None:
        """Return what stands around the cameras of rows (n,) in this frame; None in an open world."""
        around = self._surroundings
        if around is None:
            return None
        rest = np.zeros((len(rows), 3))
        met = around.passers if around.meets_passers else None
        return Around(
            around.obstacles,
            rest if around.moved is None else around.moved[rows, self._frames],
            rest if self.centre is None else self.centre.velocity[rows, self._frames],
            rest if self.centre is None else self.centre.acceleration[rows, self._frames],
            None if met is None else met.tracked[rows, self._frames],
        )

    def _clear(self, rows: IntArray, plan: JerkProfile) -> BoolArray:
        """Return which flights (n,) of rows (n,) keep clear of obstacles."""
        around = self._around(rows)
        if around is None:
            return np.ones(len(rows), dtype=bool)
        clear = keeps_clear(plan, around, self._whole.speed)
        # A flight that is no worse than staying is no reason to give up one that evades.
        evades = np.flatnonzero(clear & self._evades[rows])
        clear[evades] = ~too_near(clearance_ahead(plan.select(evades), np.zeros(len(evades)), around.select(evades)))
        return clear

    def _evade(self) -> None:
        """Leave plans that come too near to something as people walk, for the clearest valid flight nearby."""
        around, surroundings = self._around(np.arange(len(self._flown))), self._surroundings
        if around is None or surroundings is None or (surroundings.moved is None and not surroundings.meets_passers):
            return
        planned = clearance_ahead(self._plan, self._flown, around)
        rows = np.flatnonzero(too_near(planned))
        if len(rows) == 0:
            return
        here = self._state.select(rows)
        plan, clear = clearest(here, self.vehicle, self.workspace, self._time_optimal, around.select(rows))
        clearer = clear > planned[rows] + CLEARER
        self._replace(rows[clearer], plan.select(clearer))
        self._evades[rows[clearer]] = True

    def _centre_motion(self, times: FloatArray) -> CartesianMotion | None:
        """Return the motion of the centre at times (S,) [s] of the last frame, each (B, S, 3); None if it rests."""
        if self.centre is None:
            return None
        _, velocity, acceleration, jerk = (part[:, self._frames - 1, None] for part in self.centre)
        after = times[:, None]
        return CartesianMotion(
            velocity + after * (acceleration + after / 2 * jerk),
            acceleration + after * jerk,
            np.broadcast_to(jerk, (len(jerk), len(times), 3)),
        )

    def _head_for(self, target: FloatArray, rows: IntArray) -> None:
        """Find plans of some rows (R,) to targets (B, 3), unless their plans already lead there.

        Every frame tries one proposal, in turn, if it arrives sooner than the plan. For a new target it has to arrive
        sooner than the proposal that was adopted last; next, that proposal is tried, and finally all of them.
        """
        target = self.workspace.clip(target)
        way = self._towards(target) - self._state.viewpoint
        way[:, AZIMUTH] = wrap_difference(way[:, AZIMUTH])
        off = self._plan.end.viewpoint - self._state.viewpoint - way
        off[:, AZIMUTH] = wrap_difference(off[:, AZIMUTH])
        planned = np.all(np.abs(off) < SAME_PLACE, axis=1)
        remaining = self._plan.duration - self._flown - WORTH_WHILE
        rows = rows[~planned[rows] | (remaining[rows] > 0)]
        if len(rows) == 0:
            return
        state, way, pending = self._state.select(rows), way[rows], ~planned[rows]
        task = _Task(rows, state, state.viewpoint + way, limits_to_target(self.vehicle, state, way))
        if self._frames > 0:
            last, challenger = self._proposal[rows], np.full(len(rows), self._frames % len(PROPOSALS))
            arrival = np.where(pending, self._durations(task, last), remaining[rows])
            turn = ~pending | (self._frames % NEW_TURN == 0)
            sooner = np.flatnonzero(turn & (self._durations(task, challenger) < arrival))
            pending[self._adopt(task, sooner, challenger[sooner])] = False
            again = np.flatnonzero(pending)
            pending[self._adopt(task, again, last[again])] = False
        left, space = np.flatnonzero(pending), self._free_space
        proposals = len(PROPOSALS) + (len(STRAIGHT) if space is not None else 0)
        every = np.repeat(np.arange(proposals), len(left))
        pending[self._adopt(task, np.tile(left, proposals), every)] = False
        lost = rows[pending & ~self._evades[rows]]
        if space is not None and len(lost):
            here, end = (state.viewpoint[lost] for state in (self._state, self._plan.end))
            lost = lost[~leads_nearer(here, end, target[lost], space)]
        self._brake(lost)

    def _durations(self, task: "_Task", proposal: IntArray) -> FloatArray:
        """Return how long the flights of a task last with proposals (R,), (R,) [s]."""
        limits = task.limits.select(proposal, np.arange(len(proposal)))
        return self._time_optimal.durations(task.start, task.target, limits)

    def _adopt(self, task: "_Task", flight: IntArray, proposal: IntArray) -> IntArray:
        """Plan flights (n,) of a task with proposals (n,), keep the soonest valid plans, and return their flights."""
        start = task.start.select(flight)
        phases, found = self._time_optimal.to_target(start, task.target[flight], task.limits.select(proposal, flight))
        kept = self._keep(task.rows[flight], JerkProfile.from_phases(start, phases), found)
        self._proposal[task.rows[flight[kept]]] = proposal[kept]
        return flight[kept]

    def _brake(self, rows: IntArray) -> None:
        """Plan to come to rest as soon as possible; without a valid plan, the present one stays."""
        rows = np.tile(rows, len(BRAKING))
        start = self._state.select(rows)
        proposal = np.repeat(np.arange(len(BRAKING)), len(rows) // len(BRAKING))
        limits = limits_to_rest(self.vehicle, start).select(proposal, np.arange(len(rows)))
        phases, found = self._time_optimal.to_rest(start, limits)
        self._keep(rows, JerkProfile.from_phases(start, phases), found)

    def _keep(self, rows: IntArray, plan: JerkProfile, found: BoolArray) -> IntArray:
        """Make the soonest valid ones of flights (n,) the plans of rows (n,); return which are valid."""
        kept = np.flatnonzero(found)
        kept = kept[self._clear(rows[kept], plan.select(kept))]  # first: what is in the way ends most flights
        kept = kept[keeps_limits(plan.select(kept), self.vehicle, self.workspace)]
        # The last, soonest plan of each row stays. Ties keep their order, so no row depends on the rows beside it.
        kept = kept[np.argsort(-plan.duration[kept], kind="stable")]
        self._replace(rows[kept], plan.select(kept))
        return kept

    def _replace(self, rows: IntArray, plan: JerkProfile) -> None:
        """Make flights (n,) the plans of rows (n,); of several for one row, the last."""
        longest = max(plan.times.shape[1], self._plan.times.shape[1])
        self._plan = self._plan.padded(longest)
        self._plan.replace(rows, plan.padded(longest))
        self._flown[rows], self._evades[rows] = 0, False


class _Task(NamedTuple):
    """Flights to be planned."""

    rows: IntArray  # (R,), indices of the episodes
    start: SphericalState  # each (R, 3)
    target: FloatArray  # (R, 3)
    limits: AxisLimits  # each (K, R, 3), for K proposals


def _state(states: FloatArray) -> SphericalState:
    """Return states (B, 3, 3) of a path in parts."""
    return SphericalState(states[:, 0], states[:, 1], states[:, 2], np.zeros_like(states[:, 2]))
