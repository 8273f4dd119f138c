"""The limits that a track puts on a trajectory."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.flight.vehicle import LIMITS, VEHICLES
from ehar.world import PAPER
from planners.search.limits import camera_limits
from tests.helpers.fakes import tiny_context


def test_the_grid_goes_one_step_a_frame_along_one_axis() -> None:
    limits = camera_limits(tiny_context(), np.array([7.0, 1, 1]), 0.16)
    np.testing.assert_allclose(limits.velocity * 0.04, PAPER.workspace.step)
    assert limits.vehicle is None


@pytest.mark.parametrize("name", VEHICLES)
@given(st.floats(5, 15), st.floats(0, 6), st.floats(0.01, np.pi / 2))
def test_plans_use_a_part_of_what_a_vehicle_can(name: str, distance: float, azimuth: float, polar: float) -> None:
    vehicle = VEHICLES[name]
    context = replace(tiny_context(), vehicle=vehicle, track=name)
    limits = camera_limits(context, np.array([distance, azimuth, polar]), 0.28)
    for limit in LIMITS:
        assert 0.7 * getattr(vehicle, limit) <= getattr(limits.vehicle, limit) <= 0.95 * getattr(vehicle, limit)
    assert limits.velocity[1] == limits.vehicle.yaw_rate
    for axis, lever in ((0, 1.0), (2, distance)):
        for part in ("acceleration", "jerk"):
            assert getattr(limits, part)[axis] * lever == pytest.approx(getattr(limits.vehicle, part))
        assert limits.velocity[axis] * lever == pytest.approx(limits.vehicle.speed)
