"""The costs of flights: hovering by hand, sound that is averaged as energy, and flights that are added up."""

import numpy as np
import pytest

from ehar.flight.costs import FlightCosts, flight_costs
from ehar.flight.kinematics import CartesianMotion
from ehar.flight.vehicle import X500


def hovering(*distances: float, time: float = 2.0) -> FlightCosts:
    """Return the costs of hovering at distances [m] from people, (B,)."""
    rest = np.zeros((len(distances), 5, 3))
    far = np.broadcast_to(np.array(distances)[:, None], (len(distances), 5))
    return flight_costs(X500, CartesianMotion(rest, rest, rest), far, time)


def test_hovering_by_hand() -> None:
    costs = hovering(5.0, 10.0)
    assert costs.energy is not None and costs.noise is not None
    np.testing.assert_array_equal(costs.distance, 0)
    np.testing.assert_allclose(costs.energy, 2 * X500.hover_power)
    np.testing.assert_allclose(costs.noise, X500.sound_power_level - 10 * np.log10(4 * np.pi * np.array([25, 100])))


def test_levels_are_averaged_as_energy_over_time() -> None:
    near, far = hovering(5.0, time=1.0), hovering(10.0, time=3.0)
    both = near.plus(far)
    assert near.noise is not None and far.noise is not None and both.noise is not None and both.energy is not None
    expected = 10 * np.log10((10 ** (near.noise / 10) + 3 * 10 ** (far.noise / 10)) / 4)
    np.testing.assert_allclose(both.noise, expected)
    np.testing.assert_allclose(both.energy, 4 * X500.hover_power)


def test_a_vehicle_without_a_body_has_a_distance_only() -> None:
    rest = np.zeros((1, 5, 3))
    motion = CartesianMotion(rest + np.array([3.0, 0.0, 4.0]), rest, rest)
    costs = flight_costs(None, motion, np.ones((1, 5)), 0.5)
    both = costs.plus(costs)
    assert both.distance == pytest.approx(5.0)
    assert both.energy is None and both.noise is None
