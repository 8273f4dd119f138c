"""Solves the optimal control problem: fatrop first, ipopt if fatrop fails, the present viewpoint if both fail.

In flight fatrop first takes the quick Hessian of the problem, and the exact one if it does not get there. Who plans
often gets machine code of the problem, which changes no plan: see `planners.search.machine_code`.
"""

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Literal, NamedTuple

import casadi as ca
import numpy as np

from ehar.arrays import FloatArray
from ehar.flight.multicopter import Multicopter
from planners.search.guess import at_rest_at_the_end, best_guesses, moved_on
from planners.search.machine_code import MachineCode, has_compiler
from planners.search.problem import TrajectoryProblem
from planners.search.scene import SceneSize
from planners.search.task import Trajectory, TrajectoryTask
from planners.value.view_basis import PAPER_RANGE, DistanceRange

TOLERANCE = 1e-6  # on every constraint, in units of its limit (positions: half the range of distances and 1 rad)
OPTIMALITY = 1e-4  # in units of the stake; a tenth of this takes 1.5 times as long and gains 0.02 %
ACCEPTABLE = 1e-3  # in the same units: enough where a solver gets no nearer
NO_NEARER = 10  # iterations in a row that are acceptable and no better
FIRST_BARRIER = 1e-4  # fatrop's; guesses are good, so a solve may begin near the end, with half of the iterations
BACK_OFF = (1.0, 0.998, 0.98, 0.9, 0.7, 0.4, 0.0)  # shares of a capped solve's step that are tried in turn
ITERATIONS = 100  # limit of a solve that is not capped
QUICK_ITERATIONS = 50  # and of one with the quick Hessian: 99 % of solo-stream's took at most 26
PATIENCE = 500  # plans before the problem is compiled: as much work, about, as compiling it
ACCEPTED = 2  # what fatrop returns where it ends at the acceptable tolerance
DERIVED = ("nlp_f", "nlp_g", "nlp_grad_f", "nlp_jac_g", "nlp_hess_l")  # functions that fatrop calls
START_TOLERANCE = 1e-6  # [m], [rad]: how far outside the workspace the camera may already be
SolverName = Literal["fatrop", "ipopt"]


class SolveStatus(StrEnum):
    """How a solve ended. All but the first two are fallbacks."""

    OPTIMAL = "optimal"
    CAPPED = "capped"  # the iterations ended early; the trajectory is repaired and keeps the limits
    IPOPT_FALLBACK = "ipopt-fallback"  # fatrop failed, ipopt did not
    UNCONVERGED = "unconverged"  # neither did; what was found by then keeps the limits
    INFEASIBLE = "infeasible"  # no trajectory within the limits was found: the viewpoint is held
    NAN_FIELD = "nan-field"  # the field is not finite: the viewpoint is held


@dataclass(frozen=True, eq=False)
class Solution:
    """A trajectory and how it came about."""

    trajectory: Trajectory
    objective: float  # gain less cost, see `TrajectoryTask.objective`
    violation: float  # the largest of any constraint, in units of its limit; NaN for a held viewpoint
    status: SolveStatus
    seconds: float  # wall time, all seeds and fallbacks together

    @property
    def held(self) -> bool:
        """Whether the viewpoint is held because there is no trajectory."""
        return self.status in (SolveStatus.INFEASIBLE, SolveStatus.NAN_FIELD)


@dataclass
class SolverStatistics:
    """Counts and times of all plans so far; a plan is one solve for each seed, and the solve of the fallback."""

    counts: Counter[SolveStatus] = field(default_factory=Counter)  # number of plans by status
    plan_seconds: list[float] = field(default_factory=list)
    solve_seconds: list[float] = field(default_factory=list)
    violation: float = 0.0  # the largest of any plan that is not a held viewpoint

    def add(self, solution: Solution) -> None:
        """Count a plan."""
        self.counts[solution.status] += 1
        self.plan_seconds.append(solution.seconds)
        if not solution.held:
            self.violation = max(self.violation, solution.violation)

    @property
    def fallbacks(self) -> int:
        """The number of plans that fell back."""
        return self.counts.total() - self.counts[SolveStatus.OPTIMAL] - self.counts[SolveStatus.CAPPED]


class TrajectorySolver:
    """Finds trajectories for tasks of one horizon.

    `statistics` counts how the plans ended; `compiled` tells whether they run on machine code.
    """

    def __init__(
        self,
        *,
        horizon: int = 15,
        solver: SolverName = "fatrop",
        max_iterations: int | None = None,
        seeds: int = 1,
        span: DistanceRange = PAPER_RANGE,
        flown: bool = False,
        scene: SceneSize | None = None,
        body: Multicopter | None = None,
    ) -> None:
        """Build the problem and its solvers, which takes about 0.3 s, and 1.6 s where something is in the way.

        Args:
            horizon: number H of nodes after the present one.
            solver: the solver to call first; ipopt is the fallback of fatrop.
            max_iterations: largest number of iterations, for the real-time mode. A trajectory that does not keep the
                limits by then is repaired; if the repair fails, the viewpoint is held. None: iterate until optimal.
            seeds: number of goals that a plan is solved from, beside the previous solution: the most promising ones.
            span: the range of distances of the world of its tasks.
            flown: whether its tasks have the limits of a vehicle, or those of the grid.
            scene: how much stands and walks around people in its tasks; None in an open world.
            body: the vehicle's, if its tasks have flight weights.
        """
        self.statistics = SolverStatistics()
        self.horizon = horizon
        self._problem = TrajectoryProblem(horizon, span, flown=flown, scene=scene, body=body)
        self._seeds = seeds
        self._capped = max_iterations is not None
        quick = solver == "fatrop"
        iterations = max_iterations or (QUICK_ITERATIONS if quick and flown else ITERATIONS)
        self._solvers = [self._build(solver, iterations, {"nlp_hess_l": self._problem.quick_hessian} if quick else {})]
        if quick and flown and not self._capped:
            self._solvers.append(self._build(solver, ITERATIONS))
        falls_back = solver == "fatrop" and not self._capped
        self._fallback = self._build("ipopt", ITERATIONS) if falls_back else None
        self._iterations, self._asked, self.compiled = iterations, 0, False
        self._code: MachineCode | None = None
        if quick and has_compiler():
            self._code = MachineCode([*map(self._solvers[0].get_function, DERIVED), *self._problem.functions])
            self._quicken()

    def compile(self) -> bool:
        """Wait for machine code, which takes 5 to 20 s if there is none; return whether plans now run on it."""
        if self._code is not None:
            self._code.make(wait=True)
            self._quicken()
        return self.compiled

    def solve(self, task: TrajectoryTask, guess: Trajectory) -> Solution:
        """Return the best trajectory near a guess."""
        return self._solve_from(task, guess, lambda: [guess])

    def solve_best(
        self, task: TrajectoryTask, goals: FloatArray, previous: Solution | None = None, elapsed: float = 0.0
    ) -> Solution:
        """Return the best of the trajectories from several guesses, as the problem has many local optima.

        The previous solution is always a guess, and others are if they collect more than has been found; without one
        all are, on the grid in the open. In flight and where something is in the way a solve takes longer: there the
        best guess comes first.

        Args:
            task: the planning task.
            goals: (G, 3) promising viewpoints.
            previous: the previous solution, of the same horizon and node time. Without one, the first guess is to
                stay.
            elapsed: time since the previous solution [s].
        """
        first = _proceeding(task, previous, elapsed)

        def guesses() -> list[Trajectory]:
            found = [first, *best_guesses(goals, task, self._seeds, lambda tried: self._objective(task, tried))]
            one = task.scene is not None or task.limits.vehicle is not None
            return (
                [found[index] for index in np.argsort(-self._objectives(task, found), kind="stable")] if one else found
            )

        afresh = task.scene is None and task.limits.vehicle is None and (previous is None or previous.held)
        return self._solve_from(task, first, guesses, every=afresh)

    def solve_along(
        self, task: TrajectoryTask, way: Trajectory | None, previous: Solution | None = None, elapsed: float = 0.0
    ) -> Solution:
        """Return the best trajectory near a way that somebody has found to be the best one.

        Args:
            task: the planning task.
            way: the guess; None is the previous solution, or to stay.
            previous: the previous solution, of the same horizon and node time.
            elapsed: time since the previous solution [s].
        """
        first = _proceeding(task, previous, elapsed)
        return self._solve_from(task, first, lambda: [first if way is None else way])

    def _solve_from(
        self, task: TrajectoryTask, first: Trajectory, guesses: Callable[[], list[Trajectory]], *, every: bool = False
    ) -> Solution:
        """Return the best solution from several guesses, and count it; a task without a solution needs no guesses."""
        self._asked += 1
        self._quicken()
        begin = time.perf_counter()
        best = None
        if not (np.isfinite(task.field_weights).all() and np.isfinite(task.gain_weights).all()):
            status = SolveStatus.NAN_FIELD
        else:
            status = SolveStatus.INFEASIBLE
            if _can_start(task):
                best = self._best_attempt(task, first, guesses(), every)
        if best is not None:
            trajectory, objective, violation, status = best
        else:
            trajectory, violation = task.hold(), float("nan")
            objective = float("nan") if status is SolveStatus.NAN_FIELD else float(self._objective(task, trajectory))
        solution = Solution(trajectory, objective, violation, status, time.perf_counter() - begin)
        self.statistics.add(solution)
        return solution

    def _best_attempt(
        self, task: TrajectoryTask, first: Trajectory, guesses: list[Trajectory], every: bool
    ) -> "_Attempt | None":
        """Return the best attempt of those that keep the limits; ipopt is called if all seeds failed.

        The first guess is always tried; unless `every` one is, others only if they collect more than has been found.

        What the camera does already, `first`, is kept if no attempt beats it by more than the solver's tolerance. So if
        there is nothing to gain, the camera stays, or follows its previous plan.
        """
        first = at_rest_at_the_end(first, task) if self._capped else first
        attempts: list[_Attempt] = []
        for guess in guesses:
            if every or not attempts or self._objective(task, guess) > max(attempt.worth for attempt in attempts):
                attempts.append(self._attempt(self._solvers, task, guess, first))
        if self._fallback is not None and all(attempt.status is not SolveStatus.OPTIMAL for attempt in attempts):
            attempts.append(self._attempt([self._fallback], task, first, first))
        kept = [attempt for attempt in attempts if attempt.violation <= TOLERANCE]
        best = max(kept, key=lambda attempt: attempt.objective, default=None)
        if best is None:
            return None
        numbers = self._problem.arguments(task, first)
        violation = self._problem.violation(numbers["x0"], numbers)
        objective = float(self._objective(task, first))
        if violation <= TOLERANCE and objective > best.objective - OPTIMALITY * task.stake:
            return _Attempt(self._problem.unpack(numbers["x0"], task), objective, violation, best.status)
        return best

    def _attempt(self, solvers: list[Any], task: TrajectoryTask, guess: Trajectory, first: Trajectory) -> "_Attempt":
        """Call solvers in turn until one gets there, and judge its result by the constraints, not by its own report."""
        begin = time.perf_counter()
        numbers = self._problem.arguments(task, guess)
        for solver in solvers:
            variables = solver(**numbers)["x"].full().ravel()
            violation, ended = self._problem.violation(variables, numbers), solver.stats()
            accepted = ended.get("fatrop", {}).get("return_flag") == ACCEPTED  # which is no success to CasADi
            converged = bool(ended["success"]) or (accepted and violation <= TOLERANCE)
            if converged:
                break
        unfinished = SolveStatus.CAPPED if self._capped else SolveStatus.UNCONVERGED
        status = SolveStatus.OPTIMAL if converged else unfinished
        if self._capped and violation > TOLERANCE:
            variables, violation = self._repaired(variables, task, first)
        if solver is self._fallback and converged:
            status = SolveStatus.IPOPT_FALLBACK
        self.statistics.solve_seconds.append(time.perf_counter() - begin)
        trajectory = self._problem.unpack(variables, task)
        return _Attempt(trajectory, float(self._objective(task, trajectory)), violation, status)

    def _objective(self, task: TrajectoryTask, trajectory: Trajectory) -> FloatArray:
        """Return what trajectories collect, () or (G,)."""
        if task.scene is None:
            return task.objective(trajectory)
        if trajectory.position.ndim == 2:
            return np.array(self._problem.objective(task, [trajectory])[0])
        return self._problem.objective(task, [Trajectory(*parts) for parts in zip(*trajectory, strict=True)])

    def _objectives(self, task: TrajectoryTask, trajectories: list[Trajectory]) -> FloatArray:
        """Return what each of several trajectories collects, (G,)."""
        return self._objective(task, Trajectory(*map(np.stack, zip(*trajectories, strict=True))))

    def _repaired(self, variables: FloatArray, task: TrajectoryTask, first: Trajectory) -> tuple[FloatArray, float]:
        """Return the trajectory within the limits that is nearest to the result of a capped solve, and its violation.

        The motion's equations are integrated exactly. The other constraints are inequalities, nearly all of them
        convex. The first guess keeps them: it is the previous plan moved on in time, or a stay at rest. So a trajectory
        between the first guess and the result keeps them too. If not even the first guess does, it is returned.
        """
        found = at_rest_at_the_end(self._problem.unpack(variables, task), task)
        for share in BACK_OFF:
            between = Trajectory(*(old + share * (new - old) for old, new in zip(first, found, strict=True)))
            numbers = self._problem.arguments(task, between)
            violation = self._problem.violation(numbers["x0"], numbers)
            if violation <= TOLERANCE:
                break
        return numbers["x0"], violation

    def _quicken(self) -> None:
        """Take machine code if there is some; have it made when many plans have been asked for."""
        if self._code is None:
            return
        functions = self._code.load()
        if functions is not None:
            self._solvers[0] = self._build("fatrop", self._iterations, functions)
            self._problem.take(functions)
            self._code, self.compiled = None, True
        elif self._asked == PATIENCE:
            self._code.make()

    def _build(self, solver: str, max_iterations: int, functions: dict[str, Any] | None = None) -> Any:
        """Return a CasADi solver of the problem; it takes `functions`, by name, in place of its own."""
        options: dict[str, Any] = {"expand": True, "print_time": False, "cache": functions or {}}
        options[solver] = {"max_iter": max_iterations}
        if solver == "fatrop":
            options |= {"structure_detection": "auto", "equality": self._problem.equality}
            options[solver] |= {"print_level": 0, "tolerance": OPTIMALITY, "constr_viol_tol": TOLERANCE / 10}
            options[solver] |= {"mu_init": FIRST_BARRIER, "tol_acceptable": ACCEPTABLE, "acceptable_iter": NO_NEARER}
        else:
            options[solver] |= {"print_level": 0, "sb": "yes", "tol": OPTIMALITY, "constr_viol_tol": TOLERANCE / 10}
            options[solver] |= {"acceptable_tol": ACCEPTABLE, "acceptable_constr_viol_tol": TOLERANCE / 10}
            options[solver] |= {"acceptable_iter": NO_NEARER}
        return ca.nlpsol("trajectory", solver, self._problem.nlp, options)


class _Attempt(NamedTuple):
    """What a solver returned for one guess."""

    trajectory: Trajectory
    objective: float
    violation: float
    status: SolveStatus

    @property
    def worth(self) -> float:
        """What it collects; nothing if it breaks a limit."""
        return self.objective if self.violation <= TOLERANCE else -np.inf


def _proceeding(task: TrajectoryTask, previous: Solution | None, elapsed: float) -> Trajectory:
    """Return the previous solution moved on in time [s]; without one, the trajectory that stays."""
    return task.hold() if previous is None or previous.held else moved_on(previous.trajectory, elapsed, task)


def _can_start(task: TrajectoryTask) -> bool:
    """Return whether a trajectory can start from the present state."""
    state = [*task.position, *task.velocity, *task.acceleration]
    return bool(np.isfinite(state).all() and task.workspace.contains(task.position, START_TOLERANCE))
