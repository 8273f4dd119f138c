"""The next-best-view planner: a receding-horizon optimal control problem over the gain field (nbv)."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import lru_cache, partial
from typing import get_args

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.errors import UsageError
from ehar.flight.multicopter import Multicopter
from ehar.planner import Context, Observation, Planner
from planners.search.costs import FlightShares
from planners.search.guess import moved_on, states_at, trajectory_along
from planners.search.limits import camera_limits
from planners.search.scene import Scene, SceneSize
from planners.search.solver import Solution, SolverName, SolverStatistics, SolveStatus, TrajectorySolver
from planners.search.start import stoppable
from planners.search.task import TrajectoryTask
from planners.search.view_search import Search, search_ways
from planners.value.model import FULL, GainModel
from planners.value.situation import FLIGHT_LOOKAHEAD, frames_to_come
from planners.value.view_basis import DistanceRange
from planners.value.view_value import ViewValue

GRID_LOOKAHEAD = 8  # frames: on the grid the target is a point of the plan this far ahead
SEEDS = 1  # goals that a plan is started from, beside the previous plan
FEWEST_NODES = 4  # a plan ends at rest; with a constant jerk between fewer nodes, it could only stay
LEAST_NODE_FRAMES = 4  # least frames between nodes; more if the default horizon is too short for the episode otherwise
DEFAULT_HORIZON = 15
EFFORT_WEIGHT = 0.001
SAME_STATE = 1e-6  # [m], [rad] and their derivatives
CLIP_HORIZON = (4.0, 6.0)  # [s] in flight; a vehicle that has to stop sooner hardly gets anywhere


class NextBestView(Planner):
    """Plan a smooth trajectory that collects the gain field, follow it for a while, and plan anew.

    The field depends on the belief, and at each node on what is expected of its time: in a stream activities end, and
    others follow. Without a valid plan the camera holds its viewpoint, and the plan is counted as a fallback.

    Args:
        model: trained gain fields and belief.
        horizon: number of nodes of a plan. The last one also stands for what is looked ahead after it. Nodes after the
            end of the episode count for nothing. 15 nodes reach to the end of a clip on
            the grid, in flight 4 to 6 s.
        effort_weight: cost of a trajectory at the limits of jerk, in gained probability.
        energy_weight: cost of the energy of hovering through the horizon, in gained probability; in flight only.
        noise_weight: cost of the noise of hovering in the middle distance through the horizon, in gained probability;
            in flight only.
        distance_weight: cost of flying at 1 m/s through the horizon, in gained probability; in flight only.
        replan: number of frames from one plan to the next.
        solver: `fatrop`, with ipopt as its fallback, or `ipopt`.
        max_iterations: largest number of solver iterations, for the real-time mode; None lets the solver converge.
        variant: name of one of the model's gain fields; all but `full` are for ablations.
        name: name of the planner in reports.

    Raises:
        UsageError: a number is too small, not whole or not finite, or there is no such solver or field.
    """

    def __init__(
        self,
        *,
        model: GainModel,
        horizon: int = DEFAULT_HORIZON,
        effort_weight: float = EFFORT_WEIGHT,
        energy_weight: float = 0.0,
        noise_weight: float = 0.0,
        distance_weight: float = 0.0,
        replan: int = 10,
        solver: SolverName = "fatrop",
        max_iterations: int | None = None,
        variant: str = FULL,
        name: str = "nbv",
    ) -> None:
        """Create the planner; the problem is built with the first plan, once in each process."""
        for option, value in (("horizon", horizon), ("replan", replan), ("max_iterations", max_iterations)):
            if value is not None and not (isinstance(value, int) and value >= 1):
                raise UsageError(f"{name}: expected a whole {option} of at least 1, got {value}")
        if solver not in get_args(SolverName):
            raise UsageError(f"{name}: expected the solver {' or '.join(get_args(SolverName))}, got {solver!r}")
        flight = {"energy_weight": energy_weight, "noise_weight": noise_weight, "distance_weight": distance_weight}
        for option, weight in {"effort_weight": effort_weight, **flight}.items():
            if not 0 <= weight < math.inf:
                raise UsageError(f"{name}: expected a finite {option} of at least 0, got {weight}")
        self.name = name
        self.horizon, self.effort_weight, self.replan = horizon, effort_weight, replan
        self.flight_weights = FlightShares(*flight.values())
        self._solver_options = (solver, max_iterations)
        self._value = ViewValue(model, variant=variant)
        self._scene: SceneSize | None = None  # that of the last plan since the last reset
        self._begin_counting()

    @property
    def statistics(self) -> SolverStatistics:
        """The statistics of all plans since the last reset."""
        return self._statistics

    def _begin_counting(self) -> None:
        """Count plans anew: a plan of an episode may take several tries, from several states."""
        self._tries = SolverStatistics()
        self._statistics = SolverStatistics(solve_seconds=self._tries.solve_seconds)

    def reset(self, context: Context) -> None:
        """Forget plans and episodes; the problem stays built.

        Raises:
            UsageError: flights have a cost, and the track is no vehicle with a body.
        """
        self._context = context
        counted, vehicle = any(self.flight_weights), context.vehicle
        self._body = vehicle.body if counted and vehicle is not None else None
        if counted and self._body is None:
            raise UsageError(
                f"{self.name}: expected a vehicle with a body for weights of energy, noise and distance, "
                f"got the track {context.track!r}"
            )
        self._value.reset(context)
        self._plans: list[Solution | None] = [None] * context.episodes
        self._centre: FloatArray | None = None  # where it was at the plan before
        self._scene = None
        self._nodes = max(self.horizon, FEWEST_NODES)
        frames = max(LEAST_NODE_FRAMES, math.ceil(frames_to_come(context) / DEFAULT_HORIZON))
        if context.vehicle is not None:
            horizon = (FLIGHT_LOOKAHEAD, FLIGHT_LOOKAHEAD) if context.length is None else CLIP_HORIZON
            least, most = (round(time / context.frame_time / DEFAULT_HORIZON) for time in horizon)
            frames = min(max(frames, least), max(most, 1))
        self._node_frames = math.ceil(frames * self.horizon / self._nodes)
        self._begin_counting()
        if context.world.is_open:  # elsewhere the first frame says how many people there are
            self._solver()

    def _solver(self) -> TrajectorySolver:
        """Return the solver of the problem of the last plan, which counts for this planner from now on."""
        flown = self._context.vehicle is not None
        solver = _solver_of(self._nodes, *self._solver_options, self._value.span, flown, self._scene, self._body)
        solver.statistics = self._tries
        return solver

    def compile(self) -> bool:
        """Wait for machine code of the problem of the last plan; return whether plans run on it."""
        return self._solver().compile()

    def act(self, observation: Observation) -> FloatArray:
        """Return the targets of the plans, or their paths; plan every `replan` frames."""
        self._value.update(observation)
        if observation.frame % self.replan == 0:
            self._target = self._plan(observation)
        since = observation.frame % self.replan
        return self._target[:, since:] if self._target.ndim == 4 else self._target[:, since]

    def _plan(self, observation: Observation) -> FloatArray:
        """Plan for every episode and return the targets of the next frames (B, replan, 3), or paths (B, F, 3, 3)."""
        context, elapsed = self._context, self.replan * self._context.frame_time
        node_time = self._node_frames * context.frame_time
        _, gains, weights = self._value.coming(self._nodes, self._node_frames)
        walking = np.zeros((len(weights), 3))
        if observation.centre is not None:
            walking = walking if self._centre is None else (observation.centre - self._centre) / elapsed
            self._centre = observation.centre
        scenes = scenes_of(self._value, observation, walking)
        self._scene = scenes[0].size if scenes else None
        beside = partial(self._planned, observation) if scenes and context.vehicle is None else None
        found = search_ways(self._value, observation, context, beside)
        targets = []
        for episode, viewpoint in enumerate(observation.viewpoint):
            task = TrajectoryTask(
                position=viewpoint,
                velocity=observation.velocity[episode],
                acceleration=observation.acceleration[episode],
                field_weights=weights[episode],
                gain_weights=gains,
                effort_weight=self.effort_weight,
                node_time=node_time,
                limits=camera_limits(context, viewpoint, node_time),
                workspace=context.workspace,
                spread_weight=self._value.field.spread,
                span=self._value.span,
                scene=scenes[episode] if scenes else None,
                flight_weights=self.flight_weights,
            )
            starts: Iterable[TrajectoryTask] = (
                [task] if context.vehicle is None else _starts(self._plans[episode], elapsed, task)
            )
            seconds = 0.0
            for start in starts:
                plan = self._solved(start, found, episode, elapsed)
                seconds += plan.seconds
                if plan.status is not SolveStatus.INFEASIBLE:
                    break
            self._statistics.add(replace(plan, seconds=seconds))
            self._plans[episode] = plan
            targets.append(self._targets(plan, int(np.flatnonzero(gains)[-1]) + 1))
        return np.stack(targets)

    def _solved(self, task: TrajectoryTask, found: Search, episode: int, elapsed: float) -> Solution:
        """Return the plan for the task of an episode.

        Where something is in the way, it is solved near the best way that was found, or near the previous plan if that
        collects more: a way straight through things would be a poor guess. In flight nothing was gained by that.
        """
        solver, previous = self._solver(), self._plans[episode]
        best = np.argsort(-found.collected[episode])[:SEEDS]
        if found.planned is None:
            return solver.solve_best(task, found.ways.goals[episode, best], previous, elapsed)
        way = None
        if found.collected[episode, best[0]] > found.planned[episode]:
            times = found.frames * self._context.frame_time
            way = trajectory_along(found.places[episode, :, best[0]], times, task)
        return solver.solve_along(task, way, previous, elapsed)

    def _planned(self, observation: Observation, frames: IntArray) -> FloatArray:
        """Return where the previous plans lead, (B, N, 3), after frames (N,) from now; without one they stay."""
        node_time = self._node_frames * self._context.frame_time
        times = (self.replan + frames) * self._context.frame_time
        return np.stack(
            [
                np.broadcast_to(viewpoint, (len(frames), 3))
                if plan is None or plan.held
                else states_at(plan.trajectory, times, node_time)[0]
                for plan, viewpoint in zip(self._plans, observation.viewpoint, strict=True)
            ]
        )

    def _targets(self, plan: Solution, last: int) -> FloatArray:
        """Return the path of a plan, (F, 3, 3), or what the camera heads for in the next frames, (replan, 3).

        A vehicle that follows paths flies the plan itself. Another one brakes for its target, so its target is the end
        of the plan. On the grid, the target is only a little ahead, so that the camera follows the plan. It is never
        after the `last` node that counts: the solver gains nothing from later nodes.
        """
        if self._context.follows and self._context.vehicle is not None:
            time = self._context.frame_time
            times = time * np.arange(1, max(self._nodes * self._node_frames, self.replan) + 1)
            return np.stack(states_at(plan.trajectory, times, self._node_frames * time), axis=1)
        frames = np.arange(1, self.replan + 1)
        ahead = np.full(self.replan, float(self._nodes))
        if self._context.vehicle is None:
            ahead = np.minimum((frames + GRID_LOOKAHEAD) / self._node_frames, last)
        position, nodes = plan.trajectory.position, np.arange(self._nodes + 1)
        return np.stack([np.interp(ahead, nodes, position[:, axis]) for axis in range(3)], axis=1)


@lru_cache(maxsize=4)
def _solver_of(
    nodes: int,
    solver: SolverName,
    max_iterations: int | None,
    span: DistanceRange,
    flown: bool,
    scene: SceneSize | None,
    body: Multicopter | None,
) -> TrajectorySolver:
    """Return the solver of a problem, which is built once in each process: each job there has a planner of its own."""
    return TrajectorySolver(
        horizon=nodes,
        solver=solver,
        max_iterations=max_iterations,
        seeds=SEEDS,
        span=span,
        flown=flown,
        scene=scene,
        body=body,
    )


def scenes_of(value: ViewValue, observation: Observation, walking: FloatArray) -> list[Scene]:
    """Return what stands and walks around people, whose centres walk with (B, 3) [m/s]; nothing in an open world."""
    episodes, passers = len(observation.viewpoint), observation.passers
    if not value.obstacles and passers is None:
        return []
    around = [value.obstacles] * episodes
    if observation.centre is not None:
        around = [value.obstacles.relative_to(centre) for centre in observation.centre]
    strangers = [None] * episodes if passers is None else passers
    met = value.meets_passers
    return [Scene.of(*each, met=met) for each in zip(value.situation.position, around, strangers, walking, strict=True)]


def _starts(previous: Solution | None, elapsed: float, task: TrajectoryTask) -> Iterator[TrajectoryTask]:
    """Yield the task of a flight as it is, and with slower starts, from those that ask for least to the surest.

    A camera off its plan is where no plan may begin. One on its plan is between two nodes of it, and limits hold at
    nodes: beside them a plan may exceed its share of a limit by a thousandth. Then no plan begins there either.
    """
    if _on_plan(previous, elapsed, task):
        yield task
    yield stoppable(task, surely=False)
    yield stoppable(task)


def _on_plan(previous: Solution | None, elapsed: float, task: TrajectoryTask) -> bool:
    """Return whether the camera is where its previous plan led to."""
    if previous is None:
        return not (task.velocity.any() or task.acceleration.any())
    planned = moved_on(previous.trajectory, elapsed, task)
    state = zip((task.position, task.velocity, task.acceleration), planned, strict=False)
    return not previous.held and all(np.abs(now - then[0]).max() < SAME_STATE for now, then in state)
