"""The power and the sound of a multicopter: by hand where that can be, and how they change with the flight."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.errors import UsageError
from ehar.flight.multicopter import AIR_DENSITY, EFFICIENCY, GRAVITY, HEARING, Multicopter, intensity
from ehar.flight.vehicle import CAMERA_DRONE, VEHICLES, X500

STILL = (0.0, 0.0, 0.0)
parts = st.floats(-8, 8)


def power(body: Multicopter, velocity: Any, acceleration: Any = STILL) -> float:
    return float(body.demands(velocity, acceleration, np)[0])


def level(body: Multicopter, acceleration: Any, distance: float) -> float:
    return float(10 * np.log10(intensity(body.demands(STILL, acceleration, np)[1], distance) / HEARING))


def test_hovering_by_hand() -> None:
    """20 N on 0.2 m^2: air goes down at 6.39 m/s; tips move at 74.3 m/s."""
    body = Multicopter(mass=20 / GRAVITY, rotor_area=0.2, drag_area=0.04, standby_power=10, sound_power_level=90)
    induced, blades = 1.15 * 20 * 6.3888, 2.5e-4 * 1.225 * 0.2 * 74.27**3
    assert power(body, STILL) == pytest.approx(10 + (induced + blades) / 0.75, rel=1e-3)
    assert body.hover_power == pytest.approx(power(body, STILL))


def test_named_vehicles_hover_as_long_as_they_do() -> None:
    assert CAMERA_DRONE.hover_power == pytest.approx(95.3 / 0.75, rel=0.01)  # 95.3 Wh in 45 minutes
    assert X500.hover_power == pytest.approx(239, rel=0.01)
    assert {name for name, vehicle in VEHICLES.items() if vehicle.body is None} == {"ground-robot"}


@pytest.mark.parametrize("body", [X500, CAMERA_DRONE])
def test_there_is_a_cheapest_speed_and_climbing_costs_the_height(body: Multicopter) -> None:
    curve = [power(body, (speed, 0, 0)) for speed in range(21)]
    assert 6 <= np.argmin(curve) <= 12
    assert curve[-1] > 1.5 * curve[0] > 1.5 * min(curve)
    height = body.mass * GRAVITY * 0.5 / EFFICIENCY
    assert power(body, (0, 0, 0.5)) - body.hover_power == pytest.approx(height, rel=0.1)
    assert power(body, (0, 0, -0.5)) < body.hover_power


def test_drag_and_acceleration_are_paid_for_and_nothing_is_won_back() -> None:
    fast, drag = (15.0, 0.0, 0.0), AIR_DENSITY / 2 * CAMERA_DRONE.drag_area * 15**2
    sleek = replace(CAMERA_DRONE, drag_area=1e-9)
    assert power(CAMERA_DRONE, fast) - power(sleek, fast) == pytest.approx(drag * 15 / EFFICIENCY, rel=0.1)
    speeding, braking = (power(CAMERA_DRONE, fast, (change, 0, 0)) for change in (3, -3))
    assert speeding > power(CAMERA_DRONE, fast) > braking
    assert power(CAMERA_DRONE, fast, (-6.9, 0, 0)) == pytest.approx(CAMERA_DRONE.standby_power, abs=0.1)


@given(st.tuples(parts, parts, parts), st.tuples(parts, parts, parts), st.floats(0, 2 * np.pi))
def test_only_up_is_a_direction_of_its_own(velocity: Any, acceleration: Any, turn: float) -> None:
    def turned(vector: Any) -> tuple[float, float, float]:
        x, y, z = vector
        return np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, z

    before = X500.demands(velocity, acceleration, np)
    np.testing.assert_allclose(X500.demands(turned(velocity), turned(acceleration), np), before, rtol=1e-9)
    assert before[0] >= X500.standby_power


def test_levels_by_hand() -> None:
    """A sphere of 1 m has 11 dB; twice as far is 6 dB less; twice the thrust, 8 times the sound power, 9 dB more."""
    assert level(X500, STILL, 1) == pytest.approx(X500.sound_power_level - 10.99, abs=0.01)
    assert level(X500, STILL, 5) - level(X500, STILL, 10) == pytest.approx(6.02, abs=0.01)
    assert level(X500, (0, 0, GRAVITY), 5) - level(X500, STILL, 5) == pytest.approx(9.03, abs=0.01)


@pytest.mark.parametrize("name", [part.name for part in fields(Multicopter)])
@pytest.mark.parametrize("value", [0, -1.0, np.inf, np.nan, "heavy"])
def test_every_number_is_positive_and_finite(name: str, value: Any) -> None:
    with pytest.raises(UsageError, match=f"multicopter: expected a positive, finite {name}, got "):
        replace(X500, **{name: value})
