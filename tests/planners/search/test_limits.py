"""The limits that a track puts on a trajectory."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.flight.vehicle import VEHICLES
from ehar.viewpoint import cartesian
from ehar.world import PAPER
from planners.search.limits import camera_limits
from tests.helpers.fakes import tiny_context


def test_the_grid_goes_one_step_a_frame_along_one_axis() -> None:
    limits = camera_limits(tiny_context(), np.array([7.0, 1, 1]), 0.16)
    np.testing.assert_allclose(limits.velocity * 0.04, PAPER.workspace.step)
    assert limits.shared
    assert limits.speed == np.inf


@pytest.mark.parametrize("name", VEHICLES)
@given(st.floats(5, 15), st.floats(0, 6), st.floats(0.01, np.pi / 2), st.integers(0, 2))
def test_along_one_axis_no_vehicle_is_asked_for_more_than_it_can(
    name: str, distance: float, azimuth: float, polar: float, axis: int
) -> None:
    vehicle = VEHICLES[name]
    context = replace(tiny_context(), vehicle=vehicle, track=name)
    viewpoint = np.array([distance, azimuth, polar])
    limits = camera_limits(context, viewpoint, 0.28)
    assert limits.speed == vehicle.speed
    assert not limits.shared
    assert limits.velocity[1] <= vehicle.yaw_rate
    step = 1e-5 * np.eye(3)[axis]
    metres_a_unit = np.linalg.norm(cartesian(viewpoint + step) - cartesian(viewpoint - step)) / 2e-5
    for limit, most in (("velocity", "speed"), ("acceleration", "acceleration"), ("jerk", "jerk")):
        assert getattr(limits, limit)[axis] * metres_a_unit <= getattr(vehicle, most) * (1 + 1e-6)
    # Nor is a vehicle asked for less than it can where its yaw does not hinder it, level with the people.
    if axis != 1:
        assert limits.velocity[axis] * metres_a_unit == pytest.approx(vehicle.speed, rel=1e-6)
