"""Trajectory tasks: what a trajectory is worth, and which tasks are refused."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.errors import UsageError
from ehar.flight.vehicle import VEHICLES
from ehar.world import PAPER
from planners.search.costs import FlightShares
from planners.search.task import Trajectory, grid_limits
from planners.value.view_basis import BASIS_SIZE, PAPER_RANGE, field_value
from tests.helpers.trajectory_tasks import FLIGHT, GRID, HORIZON, random_task


def test_the_objective_weighs_the_field_at_the_nodes_against_the_jerk() -> None:
    rng = np.random.default_rng(0)
    weights = rng.normal(size=(HORIZON, BASIS_SIZE))
    task = random_task(rng, field_weights=weights, gain_weights=np.arange(1.0, HORIZON + 1), effort_weight=0.7)
    position, jerk = rng.uniform(1, 5, (HORIZON + 1, 3)), rng.normal(size=(HORIZON, 3))
    still = np.zeros((HORIZON + 1, 3))
    gain = sum((node + 1) * field_value(weights[node], position[node + 1], PAPER_RANGE) for node in range(HORIZON))
    cost = 0.7 * sum(((jerk[node] / FLIGHT.jerk) ** 2).sum() for node in range(HORIZON)) / HORIZON
    assert task.objective(Trajectory(position, still, still, jerk)) == pytest.approx(gain - cost)


def test_holding_stays_where_the_camera_is() -> None:
    task = random_task(np.random.default_rng(0), velocity=np.ones(3))
    hold = task.hold()
    np.testing.assert_array_equal(hold.position, np.tile(task.position, (HORIZON + 1, 1)))
    assert not hold.velocity.any() and not hold.jerk.any() and hold.jerk.shape == (HORIZON, 3)


def test_the_grid_moves_one_step_a_frame() -> None:
    limits = grid_limits(PAPER.workspace, 0.04, 0.08)
    np.testing.assert_allclose(limits.velocity * 0.04, PAPER.workspace.step)
    assert limits.vehicle is None
    # Up with full jerk for one node, down again: full speed is reached within two nodes, within the limits.
    np.testing.assert_allclose(limits.jerk * 0.08, 2 * limits.acceleration)
    assert (limits.acceleration * 0.08 >= limits.velocity).all()


@pytest.mark.parametrize("name", ["velocity", "acceleration", "jerk"])
@pytest.mark.parametrize("wrong", [[1.0, 0.0, 1.0], [1.0, -1.0, 1.0], [1.0, np.nan, 1.0], [np.inf, 1.0, 1.0], [1.0]])
def test_limits_that_are_none_are_refused(name: str, wrong: list[float]) -> None:
    with pytest.raises(UsageError, match=name):
        replace(FLIGHT, **{name: np.array(wrong)})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"position": np.zeros(2)}, "position"),
        ({"field_weights": np.zeros(21)}, r"field weights \(15, 21\), got shape \(21,\)"),
        ({"gain_weights": np.zeros((3, 3))}, "gain weights"),
        ({"node_time": 0.0}, "node time"),
        ({"effort_weight": -1.0}, "weights of effort and spread"),
        ({"flight_weights": FlightShares(0.0, -1.0, 0.0)}, r"flight weights >= 0, got \(0.0, -1.0, 0.0\)"),
        ({"flight_weights": FlightShares(1.0, 0.0, 0.0), "limits": GRID}, r"a vehicle with a body, .*, got the grid$"),
        (
            {
                "flight_weights": FlightShares(1.0, 0.0, 0.0),
                "limits": replace(FLIGHT, vehicle=VEHICLES["ground-robot"]),
            },
            r"a vehicle with a body, .*, got ground-robot$",
        ),
    ],
)
def test_tasks_that_are_none_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        random_task(np.random.default_rng(0), **changes)
