"""The receding-horizon optimal control problem in CasADi, built once with its numbers as parameters.

States are position, velocity and acceleration of (distance, azimuth, polar angle). The control is the jerk. It is
constant between nodes, so the discretisation of the triple integrator is exact. Three more states add up the
directions of view, so that a lack of spread has a cost at the last node. The azimuth is unwrapped, because the field is
periodic. All variables and constraints are in units of their limits, positions in units of half the range of distances
and 1 rad.
"""

from typing import Any

import casadi as ca
import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.errors import UsageError
from ehar.viewpoint import AZIMUTH, DISTANCE, POLAR, cartesian
from planners.search.task import Trajectory, TrajectoryTask
from planners.value.view_basis import BASIS_SIZE, PAPER_RANGE, DistanceRange, view_basis

REGULARISATION = 1e-5  # on the squared jerk: without gain and effort any trajectory would be a solution
SMOOTHING = 0.1  # added under the root of the pace, where the square is 1 at the limit
STATE, CONTROL = 12, 3  # position, velocity, acceleration, sum of directions; jerk
STAGE = STATE + CONTROL


class TrajectoryProblem:
    """The symbols of the problem, with conversions of a task to numbers, and of numbers to a trajectory.

    `nlp` is the argument of `casadi.nlpsol`, in the order that fatrop asks for. The variables are x_0, u_0, x_1, ...
    x_H. The constraints of a stage begin with the gap to the next node. `equality` marks the constraints that are
    equations.
    """

    def __init__(self, horizon: int, span: DistanceRange = PAPER_RANGE) -> None:
        """Write the problem down for H = `horizon` nodes after the present one, in a world with such distances."""
        self.horizon, self.span = horizon, span
        self._unit = unit = np.array([span.half, 1.0, 1.0])  # of a position: [m], [rad], [rad]
        start, weights, gains = ca.SX.sym("start", STATE), ca.SX.sym("weights", BASIS_SIZE), ca.SX.sym("gains", horizon)
        effort, spread, time = ca.SX.sym("effort"), ca.SX.sym("spread"), ca.SX.sym("node_time")
        units = [ca.SX.sym(name, 3) for name in ("velocity", "acceleration", "jerk")]
        inverse_speed, shared = ca.SX.sym("inverse_speed"), ca.SX.sym("shared")

        states = [ca.SX.sym(f"x{node}", STATE) for node in range(horizon + 1)]
        controls = [ca.SX.sym(f"u{node}", CONTROL) for node in range(horizon)]
        variables, constraints, equality = [], [], []
        cost: Any = 0
        for node, state in enumerate(states):
            variables.append(state)
            if node < horizon:
                control = controls[node]
                variables.append(control)
                gain = gains[node - 1] if node else 0
                constraints.append(states[node + 1] - _next_state(state, control, time, units, unit, gain))
                equality += [True] * STATE
                cost += (effort + REGULARISATION) * ca.sumsqr(control) / horizon
            if node == 0:
                constraints.append(state - start)
                equality += [True] * STATE
            else:
                constraints.append(_pace(state, units[0], unit, inverse_speed, shared))
                equality.append(False)
                distance, azimuth, polar = ca.vertsplit(state[:3] * unit)
                cost -= gains[node - 1] * ca.dot(weights, ca.vertcat(*view_basis(distance, azimuth, polar, span, ca)))
        cost += spread * ca.sumsqr(states[-1][9:] + gains[-1] * _direction(states[-1]))
        constraints.append(states[-1][3:9])  # at rest: the camera can stay there, so the next plan exists
        equality += [True] * 6
        parameters = ca.vertcat(start, weights, gains, effort, spread, time, *units, inverse_speed, shared)
        self.nlp = {"x": ca.vertcat(*variables), "f": cost, "g": ca.vertcat(*constraints), "p": parameters}
        self.equality: list[bool] = equality
        self._constraints = ca.Function("constraints", [self.nlp["x"], self.nlp["p"]], [self.nlp["g"]])
        is_equality: BoolArray = np.array(equality)
        self._constraint_bounds = np.where(is_equality, 0.0, -np.inf), np.where(is_equality, 0.0, 1.0)

    def arguments(self, task: TrajectoryTask, guess: Trajectory) -> dict[str, FloatArray]:
        """Return the arguments of a CasADi solver: x0, p, lbx, ubx, lbg, ubg.

        Raises:
            UsageError: the task is for another horizon, or another world.
        """
        if task.horizon != self.horizon:
            raise UsageError(f"trajectory task: expected {self.horizon} gain weights, got {task.horizon}")
        if task.span != self.span:
            raise UsageError(f"trajectory task: expected a world with {self.span}, got {task.span}")
        limits = task.limits
        start = np.concatenate(
            [
                task.position / self._unit,
                task.velocity / limits.velocity,
                task.acceleration / limits.acceleration,
                np.zeros(3),
            ]
        )
        parameters = np.concatenate(
            [
                start,
                task.field_weights / task.stake,  # so that a solver's tolerance means the same for every field
                task.gain_weights,
                [task.effort_weight / task.stake, task.spread_weight / task.stake, task.node_time],
                limits.velocity,
                limits.acceleration,
                limits.jerk,
                [1 / limits.speed, limits.shared],
            ]
        )
        lower, upper = self._variable_bounds(task)
        first = self.pack(guess, task)
        first[:STATE] = start
        return {
            "x0": first,
            "p": parameters,
            "lbx": lower,
            "ubx": upper,
            "lbg": self._constraint_bounds[0],
            "ubg": self._constraint_bounds[1],
        }

    def _variable_bounds(self, task: TrajectoryTask) -> tuple[FloatArray, FloatArray]:
        """Return the bounds of all variables; the present state is given, so it has none."""
        workspace = task.workspace
        upper = np.ones((self.horizon + 1, STAGE))
        lower = -upper
        unbounded = [AZIMUTH, *range(9, STATE)]
        lower[:, unbounded], upper[:, unbounded] = -np.inf, np.inf
        lower[:, DISTANCE], upper[:, DISTANCE] = (
            workspace.distance_min / self.span.half,
            workspace.distance_max / self.span.half,
        )
        lower[:, POLAR], upper[:, POLAR] = workspace.polar_min, workspace.polar_max
        lower[0, :STATE], upper[0, :STATE] = -np.inf, np.inf
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

    def pack(self, trajectory: Trajectory, task: TrajectoryTask) -> FloatArray:
        """Return the problem's variables for a trajectory."""
        limits = task.limits
        stages = np.zeros((self.horizon + 1, STAGE))
        stages[:, 0:3] = trajectory.position / self._unit
        stages[:, 3:6] = trajectory.velocity / limits.velocity
        stages[:, 6:9] = trajectory.acceleration / limits.acceleration
        directions = cartesian(trajectory.position) / trajectory.position[:, :1]
        gains = np.concatenate([[0.0], task.gain_weights[:-1]])
        stages[1:, 9:STATE] = np.cumsum(gains[:, None] * directions[:-1], axis=0)
        stages[:-1, STATE:] = trajectory.jerk / limits.jerk
        return stages.ravel()[:-CONTROL]

    def unpack(self, variables: FloatArray, task: TrajectoryTask) -> Trajectory:
        """Return the trajectory that the problem's variables stand for."""
        limits = task.limits
        stages = np.append(variables, np.zeros(CONTROL)).reshape(self.horizon + 1, STAGE)
        return Trajectory(
            stages[:, 0:3] * self._unit,
            stages[:, 3:6] * limits.velocity,
            stages[:, 6:9] * limits.acceleration,
            stages[:-1, STATE:] * limits.jerk,
        )


def _next_state(state: Any, control: Any, time: Any, units: list[Any], unit: FloatArray, gain: Any) -> Any:
    """Return the exact state one node later, for a constant jerk; `gain` is the weight of the present node's view."""
    position, (velocity, acceleration, jerk) = state[:3], (state[3:6], state[6:9], control)
    velocity, acceleration, jerk = velocity * units[0], acceleration * units[1], jerk * units[2]
    travelled = time * velocity + time**2 / 2 * acceleration + time**3 / 6 * jerk
    return ca.vertcat(
        position + travelled / unit,
        (velocity + time * acceleration + time**2 / 2 * jerk) / units[0],
        (acceleration + time * jerk) / units[1],
        state[9:] + gain * _direction(state),
    )


def _direction(state: Any) -> Any:
    """Return the unit vector from the people towards the camera."""
    azimuth, polar = state[AZIMUTH], state[POLAR]
    return ca.vertcat(ca.sin(polar) * ca.cos(azimuth), ca.sin(polar) * ca.sin(azimuth), ca.cos(polar))


def _pace(state: Any, velocity_limit: Any, unit: FloatArray, inverse_speed: Any, shared: Any) -> Any:
    """Return the used share of the Cartesian speed limit, or of the axes' common budget; at most 1 within the limits.

    The squared speed of (distance, azimuth, polar) = (r, a, p) is r'^2 + (r sin(p) a')^2 + (r p')^2. The root of the
    squared share is nearly linear, so a solver's steps land near the limit. The root is smoothed where it is small.
    """
    distance, _, polar = ca.vertsplit(state[:3] * unit)
    radial, azimuthal, polar_rate = ca.vertsplit(state[3:6] * velocity_limit)
    speed = ca.vertcat(radial, distance * ca.sin(polar) * azimuthal, distance * polar_rate)
    squared = ca.sumsqr(speed * inverse_speed) + shared * ca.sumsqr(state[3:6])
    return 1 + ca.sqrt(squared + SMOOTHING) - np.sqrt(1 + SMOOTHING)
