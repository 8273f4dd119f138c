"""The receding-horizon optimal control problem in CasADi, built once with its numbers as parameters.

States are position, velocity and acceleration of (distance, azimuth, polar angle). The control is the jerk. It is
constant between nodes, so the discretisation of the triple integrator is exact. Three more states add up the directions
of view, so that views that spread are worth something at the last node. Where something is in the way a view counts
there as far as it shows people, and a fourth state adds up how far. The azimuth is unwrapped, because the field is
periodic. All variables and constraints are in units of their limits, positions in units of half the range of distances
and 1 rad.

A vehicle's limits are Cartesian: they hold for the length of the camera's velocity, acceleration and jerk, with all
centripetal, Coriolis and Euler terms. On the grid the axes share one budget, because a frame moves one of them.

Second derivatives take most of a solve. The quick ones of a vehicle's limits leave out how acceleration and jerk bend
with position and velocity: steps are a little worse, optima the same, as first derivatives alone decide about these.
"""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.errors import UsageError
from ehar.flight.multicopter import Multicopter
from ehar.viewpoint import AZIMUTH, DISTANCE, POLAR
from planners.search.costs import FlightShares, flight_shares
from planners.search.scene import WEIGHT, SceneSize, SceneSymbols, kept_clear
from planners.search.shares import flown_shares, grid_shares, turning_points
from planners.search.task import Trajectory, TrajectoryTask
from planners.value.view_basis import BASIS_SIZE, PAPER_RANGE, DistanceRange, view_basis

REGULARISATION = 1e-5  # on the squared jerk: without gain and effort any trajectory would be a solution
MOTION, CONTROL = 9, 3  # position, velocity, acceleration, behind which stand the sums; jerk
INSIDE = 1e-5  # [m], [rad] from the bounds of the workspace: a flight keeps them exactly, a solver nearly
LEAST_ROOM = 2e-7  # [m], [rad] between bounds, where the workspace has a single distance or polar angle
VEHICLE_LIMITS = ("speed", "acceleration", "jerk", "climb_speed", "descent_speed")  # the yaw rate bounds a variable


class TrajectoryProblem:
    """The symbols of the problem, with conversions of a task to numbers, and of numbers to a trajectory.

    `nlp` is the argument of `casadi.nlpsol`, in the order that fatrop asks for. The variables are x_0, u_0, x_1, ...
    x_H. The constraints of a stage begin with the gap to the next node. `equality` marks the constraints that are
    equations. A state has `state_size` numbers, and a stage, a state and its control, `stage_size`. `quick_hessian` is
    the Lagrangian's on the grid, and about it in flight, as fatrop takes it.
    """

    def __init__(
        self,
        horizon: int,
        span: DistanceRange = PAPER_RANGE,
        *,
        flown: bool = False,
        scene: SceneSize | None = None,
        body: Multicopter | None = None,
    ) -> None:
        """Write the problem down.

        Args:
            horizon: number H of nodes after the present one.
            span: the range of distances of the world.
            flown: whether tasks have the limits of a vehicle, or those of the grid.
            scene: how much stands and walks around people; None in an open world.
            body: the vehicle's, if tasks have flight weights.
        """
        self.horizon, self.span, self.flown, self.scene, self.body = horizon, span, flown, scene, body
        around, keep = None if scene is None else SceneSymbols(scene), kept_clear(flown=flown)
        self.state_size = MOTION + (3 if scene is None else 4)  # directions, and how much is seen
        self.stage_size = self.state_size + CONTROL
        self._unit = unit = np.array([span.half, 1.0, 1.0])  # of a position: [m], [rad], [rad]
        start, gains = ca.SX.sym("start", self.state_size), ca.SX.sym("gains", horizon)
        weights = ca.SX.sym("weights", BASIS_SIZE, horizon)
        effort, spread, time = ca.SX.sym("effort"), ca.SX.sym("spread"), ca.SX.sym("node_time")
        units = [ca.SX.sym(name, 3) for name in ("velocity", "acceleration", "jerk")]
        vehicle = ca.SX.sym("vehicle", len(VEHICLE_LIMITS) if flown else 0)
        prices = [ca.SX.sym(f"price_of_{name}") for name in FlightShares._fields]

        states = [ca.SX.sym(f"x{node}", self.state_size) for node in range(horizon + 1)]
        controls = [ca.SX.sym(f"u{node}", CONTROL) for node in range(horizon)]
        # The variables, of which no derivative is taken.
        still = ca.SX.sym("still", (horizon + 1) * self.stage_size - CONTROL)
        variables, constraints, equality, turns = [], [], [], []
        bent: dict[int, Any] = {}  # some constraints, as their second derivatives are taken quickly
        cost: Any = 0
        looked: Any = ca.SX.zeros(self.state_size - MOTION)  # the sums that the nodes so far lead to
        sums = []
        for node, state in enumerate(states):
            variables.append(state)
            sums.append(looked)
            view, seen = _direction(state), ca.SX(1)
            if around is not None:
                camera = state[0] * unit[0] * view
                seen = around.seen(camera, node * time)
                view = seen * ca.vertcat(view, 1)
            view *= gains[node - 1] if node else 0
            looked += view
            shares: list[Any] = []
            control: Any = ca.SX.zeros(CONTROL)
            if node < horizon:
                control = controls[node]
                variables.append(control)
                constraints.append(states[node + 1] - _next_state(state, control, time, units, unit, view))
                equality += [True] * self.state_size
                cost += (effort + REGULARISATION) * ca.sumsqr(control) / horizon
            if node == 0:
                constraints.append(state - start)
                equality += [True] * self.state_size
            else:
                distance, azimuth, polar = ca.vertsplit(state[:3] * unit)
                value = ca.dot(weights[:, node - 1], ca.vertcat(*view_basis(distance, azimuth, polar, span, ca)))
                if around is not None:
                    cost += WEIGHT * around.intrusion(camera, keep, node * time)
                cost -= gains[node - 1] * seen * value
                if body is not None:
                    parts = _moving(state, control, units, unit)[:3]
                    paid = flight_shares(body, span, [ca.vertsplit(part) for part in parts], ca)
                    cost += sum(price * share for price, share in zip(prices, paid, strict=True)) / horizon
            if node < horizon and flown:
                first, moving = node == 0, _moving(state, control, units, unit)
                on_its_way = _moving(still[self.stage_size * node :], control, units, unit)[:2]
                shares = flown_shares(moving, moving, vehicle, first=first)
                bent |= enumerate(flown_shares(moving, (*on_its_way, *moving[2:]), vehicle, first=first), len(equality))
                if node:
                    turns += [len(equality) + len(shares) + corner for corner in range(4)]
                    shares += turning_points(state, units[0], unit, time)
            if node and not flown:
                shares = grid_shares(state)
            constraints += shares
            equality += [False] * len(shares)
        total = states[-1][MOTION:] + view
        seen = total[3] if around is not None else ca.sum1(gains)
        cost += spread * (ca.sumsqr(total[:3]) - seen**2)  # less w_i w_j (1 - cos) of all pairs of seen views
        constraints.append(states[-1][3:MOTION])  # at rest: the camera can stay there, so the next plan exists
        equality += [True] * 6
        parameters = ca.vertcat(start, ca.vec(weights), gains, effort, spread, time, *units, vehicle)
        if around is not None:
            parameters = ca.vertcat(parameters, around.numbers)
        if body is not None:
            parameters = ca.vertcat(parameters, *prices)
        self.nlp = {"x": ca.vertcat(*variables), "f": cost, "g": ca.vertcat(*constraints), "p": parameters}
        self.quick_hessian = _hessian(self.nlp, bent, still)
        self.equality: list[bool] = equality
        self._cost = ca.Function("cost", [self.nlp["x"], self.nlp["p"]], [self.nlp["f"]])
        self._constraints = ca.Function("constraints", [self.nlp["x"], self.nlp["p"]], [self.nlp["g"]])
        self._sums = ca.Function("sums", [self.nlp["x"], self.nlp["p"]], [ca.horzcat(*sums).T])
        is_equality: BoolArray = np.array(equality)
        self._constraint_bounds = np.where(is_equality, 0.0, -np.inf), np.where(is_equality, 0.0, 1.0)
        self._turns = np.array(turns, dtype=np.int64).reshape(-1, 2, 2)  # (nodes, axes, before and after the node)

    def arguments(self, task: TrajectoryTask, guess: Trajectory) -> dict[str, FloatArray]:
        """Return the arguments of a CasADi solver: x0, p, lbx, ubx, lbg, ubg.

        Raises:
            UsageError: the task is for another horizon, world, scene or body, or another kind of limits.
        """
        lower, upper = self._variable_bounds(task)
        least, most = (bounds.copy() for bounds in self._constraint_bounds)
        for place, axis in enumerate((DISTANCE, POLAR)):
            first = self.stage_size + axis  # of node 1
            least[self._turns[:, place]], most[self._turns[:, place]] = lower[first], upper[first]
            # x_1 - v_1 time / 3 = x_0 + 2 / 3 v_0 time + a_0 time^2 / 6: the present state gives it, whatever the jerk.
            given = self._turns[:1, place, 0]
            least[given], most[given] = -np.inf, np.inf
        parameters = self._parameters(task)
        return {
            "x0": self._variables(guess, task, parameters),
            "p": parameters,
            "lbx": lower,
            "ubx": upper,
            "lbg": least,
            "ubg": most,
        }

    def _variables(self, guess: Trajectory, task: TrajectoryTask, parameters: FloatArray) -> FloatArray:
        """Return the problem's variables for a guess, which begins at the present state."""
        stages = self._pack(guess, task)
        stages[0, : self.state_size] = parameters[: self.state_size]
        stages[:, MOTION : self.state_size] = self._sums(stages.ravel()[:-CONTROL], parameters).full()
        return stages.ravel()[:-CONTROL]

    def _parameters(self, task: TrajectoryTask) -> FloatArray:
        """Return the numbers of a task, which begin with its state."""
        if task.horizon != self.horizon:
            raise UsageError(f"trajectory task: expected {self.horizon} gain weights, got {task.horizon}")
        if task.span != self.span:
            raise UsageError(f"trajectory task: expected a world with {self.span}, got {task.span}")
        limits, vehicle = task.limits, task.limits.vehicle
        if (vehicle is not None) != self.flown:
            expected = "a vehicle" if self.flown else "the grid"
            got = "the grid" if vehicle is None else vehicle.name
            raise UsageError(f"trajectory task: expected limits of {expected}, got those of {got}")
        size = None if task.scene is None else task.scene.size
        if size != self.scene:
            raise UsageError(f"trajectory task: expected a scene with {self.scene}, got {size}")
        if task.body != self.body:
            raise UsageError(f"trajectory task: expected flights that cost those of {self.body}, got {task.body}")
        start = np.concatenate(
            [
                task.position / self._unit,
                task.velocity / limits.velocity,
                task.acceleration / limits.acceleration,
                np.zeros(self.state_size - MOTION),
            ]
        )
        parameters: FloatArray = np.concatenate(
            [
                start,
                task.field_weights.ravel() / task.stake,  # so that a solver's tolerance means the same for every field
                task.gain_weights,
                [task.effort_weight / task.stake, task.spread_weight / task.stake, task.node_time],
                limits.velocity,
                limits.acceleration,
                limits.jerk,
                [getattr(vehicle, name) for name in VEHICLE_LIMITS] if vehicle else [],
                [] if task.scene is None else task.scene.numbers,
                [] if task.body is None else np.array(task.flight_weights) / task.stake,
            ]
        )
        return parameters

    @property
    def functions(self) -> list[Any]:
        """The CasADi functions that plans are judged by."""
        return [self._cost, self._constraints, self._sums]

    def take(self, functions: dict[str, Any]) -> None:
        """Take the same functions, quicker ones, in place of `functions`, by their names."""
        self._cost, self._constraints, self._sums = (functions[name] for name in ("cost", "constraints", "sums"))

    def _variable_bounds(self, task: TrajectoryTask) -> tuple[FloatArray, FloatArray]:
        """Return the bounds of all variables; the present state is given, so it has none."""
        workspace = task.workspace
        upper = np.ones((self.horizon + 1, self.stage_size))
        lower = -upper
        unbounded = [AZIMUTH, *range(MOTION, self.state_size)]
        if self.flown:  # the vehicle's limits bound them, but a turn on the spot
            unbounded += [3 * order + axis for order in (1, 2) for axis in (DISTANCE, POLAR)]
            unbounded += [self.state_size + DISTANCE, self.state_size + POLAR]
        lower[:, unbounded], upper[:, unbounded] = -np.inf, np.inf
        inside = INSIDE if self.flown else 0.0
        for axis, least, most in (
            (DISTANCE, workspace.distance_min, workspace.distance_max),
            (POLAR, workspace.polar_min, workspace.polar_max),
        ):
            # Equal bounds would be equations too many, and fatrop solves other problems otherwise after one with them.
            room = min(inside, (most - least - LEAST_ROOM) / 2)
            lower[:, axis], upper[:, axis] = (least + room) / self._unit[axis], (most - room) / self._unit[axis]
        lower[0, : self.state_size], upper[0, : self.state_size] = -np.inf, np.inf
        return lower.ravel()[:-CONTROL], upper.ravel()[:-CONTROL]

    def violation(self, variables: FloatArray, numbers: dict[str, FloatArray]) -> float:
        """Return the largest violation of any bound or constraint, 0 if there is none, NaN if a value is NaN.

        Args:
            variables: the problem's variables.
            numbers: a result of `arguments`, which holds the bounds.
        """
        constraints = self._constraints(variables, numbers["p"]).full().ravel()
        low = np.concatenate([numbers["lbx"] - variables, numbers["lbg"] - constraints])
        high = np.concatenate([variables - numbers["ubx"], constraints - numbers["ubg"]])
        return float(np.max([low.max(), high.max(), 0.0]))

    def objective(self, task: TrajectoryTask, guesses: Sequence[Trajectory]) -> FloatArray:
        """Return the gain of trajectories less their cost, (G,), with all that is in the way; more is better."""
        parameters = self._parameters(task)
        costs = [float(self._cost(self._variables(guess, task, parameters), parameters)) for guess in guesses]
        return -np.array(costs) * task.stake

    def _pack(self, trajectory: Trajectory, task: TrajectoryTask) -> FloatArray:
        """Return the stages (H + 1, `stage_size`) of a trajectory, without sums."""
        limits = task.limits
        stages = np.zeros((self.horizon + 1, self.stage_size))
        stages[:, 0:3] = trajectory.position / self._unit
        stages[:, 3:6] = trajectory.velocity / limits.velocity
        stages[:, 6:9] = trajectory.acceleration / limits.acceleration
        stages[:-1, self.state_size :] = trajectory.jerk / limits.jerk
        return stages

    def unpack(self, variables: FloatArray, task: TrajectoryTask) -> Trajectory:
        """Return the trajectory that the problem's variables stand for."""
        limits = task.limits
        stages = np.append(variables, np.zeros(CONTROL)).reshape(self.horizon + 1, self.stage_size)
        return Trajectory(
            stages[:, 0:3] * self._unit,
            stages[:, 3:6] * limits.velocity,
            stages[:, 6:9] * limits.acceleration,
            stages[:-1, self.state_size :] * limits.jerk,
        )


def _next_state(state: Any, control: Any, time: Any, units: list[Any], unit: FloatArray, view: Any) -> Any:
    """Return the exact state one node later, for a constant jerk; `view` is what the present node adds to the sums."""
    position, velocity, acceleration, jerk = _moving(state, control, units, unit)
    return ca.vertcat(
        (position + time * velocity + time**2 / 2 * acceleration + time**3 / 6 * jerk) / unit,
        (velocity + time * acceleration + time**2 / 2 * jerk) / units[0],
        (acceleration + time * jerk) / units[1],
        state[MOTION:] + view,
    )


def _direction(state: Any) -> Any:
    """Return the unit vector from the people towards the camera."""
    azimuth, polar = state[AZIMUTH], state[POLAR]
    return ca.vertcat(ca.sin(polar) * ca.cos(azimuth), ca.sin(polar) * ca.sin(azimuth), ca.cos(polar))


def _hessian(nlp: dict[str, Any], bent: dict[int, Any], still: Any) -> Any:
    """Return a function of the Lagrangian's gradient and of about its Hessian; what is in it twice is computed once.

    Args:
        nlp: the problem: x, f, g and p.
        bent: the constraints that have other second derivatives than those of g, by their row.
        still: (V,) stands for variables in them, of which no derivatives are taken.
    """
    variables, multiplier, multipliers = nlp["x"], ca.SX.sym("lam_f"), ca.SX.sym("lam_g", nlp["g"].numel())
    curved = ca.SX(nlp["g"])
    for row, constraint in bent.items():
        curved[row] = constraint
    lagrangian, bending = (multiplier * nlp["f"] + ca.dot(multipliers, each) for each in (nlp["g"], curved))
    hessian = ca.substitute(ca.hessian(bending, variables)[0], still, variables)
    return ca.Function(
        "nlp_hess_l",
        [variables, nlp["p"], multiplier, multipliers],
        ca.cse([ca.gradient(lagrangian, variables), hessian]),
        ["x", "p", "lam_f", "lam_g"],
        ["grad_gamma_x", "hess_gamma_x_x"],
    )


def _moving(state: Any, control: Any, units: list[Any], unit: FloatArray) -> tuple[Any, Any, Any, Any]:
    """Return position, velocity, acceleration and jerk in SI units."""
    return state[:3] * unit, state[3:6] * units[0], state[6:9] * units[1], control * units[2]
