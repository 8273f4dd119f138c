"""The task of a trajectory: the state of the camera, the worth of each viewpoint, and the limits."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import UsageError
from ehar.flight.multicopter import Multicopter
from ehar.flight.vehicle import Vehicle
from ehar.viewpoint import Workspace, cartesian
from planners.search.costs import FlightShares, flight_shares
from planners.search.scene import Scene
from planners.value.view_basis import BASIS_SIZE, PAPER_RANGE, DistanceRange, field_value

NO_COST = FlightShares(0.0, 0.0, 0.0)


class Trajectory(NamedTuple):
    """A spherical trajectory at H + 1 nodes; the jerk is constant between them. G trajectories: (G, ...) each."""

    position: FloatArray  # (H + 1, 3): distance [m], azimuth [rad] (unwrapped), polar angle [rad]
    velocity: FloatArray  # (H + 1, 3) [m/s], [rad/s]
    acceleration: FloatArray  # (H + 1, 3) [m/s^2], [rad/s^2]
    jerk: FloatArray  # (H, 3) [m/s^3], [rad/s^3]


@dataclass(frozen=True, eq=False)
class TrajectoryLimits:
    """How fast a camera may move along distance, azimuth and polar angle.

    Args:
        velocity: (3,) [m/s], [rad/s], [rad/s].
        acceleration: (3,) [m/s^2], [rad/s^2], [rad/s^2].
        jerk: (3,) [m/s^3], [rad/s^3], [rad/s^3].
        vehicle: what carries the camera. Its limits are Cartesian. Those of distance and polar angle are only about
            what it can do along them alone, from here. None is the grid, on which the axes share one budget: the shares
            of the velocity limits add up to at most 1.

    Raises:
        UsageError: a limit is not positive, or the limit of an axis is not finite.
    """

    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray
    vehicle: Vehicle | None = None

    def __post_init__(self) -> None:
        """Check shapes and signs."""
        for name in ("velocity", "acceleration", "jerk"):
            values = np.asarray(getattr(self, name))
            if values.shape != (3,) or not (np.isfinite(values).all() and (values > 0).all()):
                raise UsageError(f"trajectory limits: expected 3 positive, finite values of {name}, got {values}")


def grid_limits(workspace: Workspace, frame_time: float, node_time: float) -> TrajectoryLimits:
    """Return the limits of a smooth trajectory that a camera on the grid of a workspace can keep up with.

    The grid moves one axis by one step a frame, so the axes share that rate. The grid has no limit of acceleration, so
    a trajectory may reach the full rate within one node.

    Args:
        workspace: has the steps of the grid.
        frame_time: time of one frame [s].
        node_time: time from one node to the next [s].
    """
    velocity = workspace.step / frame_time
    return TrajectoryLimits(velocity, 2 * velocity / node_time, 4 * velocity / node_time**2)


@dataclass(frozen=True, eq=False)
class TrajectoryTask:
    """One planning task over H nodes; the numbers of a problem that is built once.

    Args:
        position: (3,) the camera's viewpoint at node 0: distance [m], azimuth [rad], polar angle [rad].
        velocity: (3,) the velocity at node 0.
        acceleration: (3,) the acceleration at node 0.
        field_weights: (H, 21) the weights of the gain field at nodes 1 to H, see `view_basis`.
        gain_weights: (H,) the weight of the field at nodes 1 to H; the last may carry the time after the horizon.
        effort_weight: cost of a mean squared jerk of one axis at its limit, in the unit of the objective.
        node_time: time from one node to the next [s].
        limits: the limits of velocity, acceleration, jerk and speed.
        workspace: the bounds of distance and polar angle.
        spread_weight: worth of views that spread over the whole sphere, in the unit of the objective.
        span: the range of distances of the world that the field was trained in.
        scene: what stands and walks around people; None in an open world.
        flight_weights: costs of the power of hovering, the sound of hovering in the middle distance and a speed of
            1 m/s, each at all nodes, in the unit of the objective.

    Raises:
        UsageError: a shape is wrong, the node time is not positive, a weight of a cost is negative, or flights have a
            cost and the vehicle no body.
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    field_weights: FloatArray
    gain_weights: FloatArray
    effort_weight: float
    node_time: float
    limits: TrajectoryLimits
    workspace: Workspace
    spread_weight: float = 0.0
    span: DistanceRange = PAPER_RANGE
    scene: Scene | None = None
    flight_weights: FlightShares = NO_COST

    def __post_init__(self) -> None:
        """Check shapes and signs; the solver reports values that are not finite."""
        for name in ("position", "velocity", "acceleration"):
            if np.shape(getattr(self, name)) != (3,):
                raise UsageError(f"trajectory task: expected 3 values of {name}, got {getattr(self, name)}")
        if np.ndim(self.gain_weights) != 1:
            raise UsageError(f"trajectory task: expected gain weights (H,), got shape {np.shape(self.gain_weights)}")
        if np.shape(self.field_weights) != (self.horizon, BASIS_SIZE):
            got = np.shape(self.field_weights)
            raise UsageError(f"trajectory task: expected field weights ({self.horizon}, {BASIS_SIZE}), got shape {got}")
        if not (self.node_time > 0 and self.effort_weight >= 0 and self.spread_weight >= 0):
            raise UsageError(
                "trajectory task: expected a node time > 0 and weights of effort and spread >= 0, "
                f"got {self.node_time} s, {self.effort_weight} and {self.spread_weight}"
            )
        if not min(self.flight_weights) >= 0:
            raise UsageError(f"trajectory task: expected flight weights >= 0, got {tuple(self.flight_weights)}")
        if any(self.flight_weights) and self.body is None:
            track = "the grid" if self.limits.vehicle is None else self.limits.vehicle.name
            raise UsageError(f"trajectory task: expected a vehicle with a body, as flights have a cost, got {track}")

    @property
    def horizon(self) -> int:
        """The number of nodes after the present one, H."""
        return len(self.gain_weights)

    @property
    def body(self) -> Multicopter | None:
        """The body whose flight costs something; None if no flight does."""
        vehicle = self.limits.vehicle
        return vehicle.body if vehicle is not None and any(self.flight_weights) else None

    @property
    def stake(self) -> float:
        """The size of the possible gain or cost, in the unit of the objective; 1 if there is none."""
        gain = np.abs(self.gain_weights) @ np.linalg.norm(self.field_weights[:, 1:], axis=1)
        return float(max(gain, self.effort_weight, self.spread_weight, *self.flight_weights)) or 1.0

    def objective(self, trajectory: Trajectory) -> FloatArray:
        """Return the gain of trajectories in the open less their cost, () or (G,); more is better.

        sum_h gain_weights[h] field_h(position[h]) - effort_weight mean_h sum_axes (jerk / limit)^2
        + spread_weight ((sum_h gain_weights[h])^2 - |sum_h gain_weights[h] direction(position[h])|^2)
        - mean_h flight_weights . flight_shares[h]
        """
        gain = field_value(self.field_weights, trajectory.position[..., 1:, :], self.span) @ self.gain_weights
        directions = cartesian(trajectory.position[..., 1:, :]) / trajectory.position[..., 1:, :1]
        mean = np.einsum("...hk,h->...k", directions, self.gain_weights)
        effort = ((trajectory.jerk / self.limits.jerk) ** 2).sum(-1).mean(-1)
        spread = self.gain_weights.sum() ** 2 - (mean**2).sum(-1)
        collected: FloatArray = gain - self.effort_weight * effort + self.spread_weight * spread
        return collected if self.body is None else collected - self._flight_cost(self.body, trajectory)

    def _flight_cost(self, body: Multicopter, trajectory: Trajectory) -> FloatArray:
        state = [list(np.moveaxis(part[..., 1:, :], -1, 0)) for part in trajectory[:3]]
        shares = flight_shares(body, self.span, state, np)
        cost: FloatArray = sum(
            weight * share.mean(-1) for weight, share in zip(self.flight_weights, shares, strict=True)
        )
        return cost

    def hold(self) -> Trajectory:
        """Return the trajectory that stays at the present viewpoint, whatever the camera's velocity."""
        still = np.zeros((self.horizon + 1, 3))
        return Trajectory(np.tile(self.position, (self.horizon + 1, 1)), still, still, still[1:])
