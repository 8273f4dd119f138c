"""Cartesian motion of spherical trajectories: against finite differences, and on motions known by heart."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ehar.arrays import FloatArray
from ehar.flight.kinematics import CartesianMotion, SphericalState, local_motion
from ehar.viewpoint import AZIMUTH, cartesian

coefficients = arrays(np.float64, (4, 3), elements=st.floats(-2, 2))


def cartesian_motion(state: SphericalState) -> CartesianMotion:
    """Return the derivatives of `ehar.viewpoint.cartesian`: the local ones, turned by the azimuth."""
    azimuth = state.viewpoint[..., AZIMUTH]
    cos, sin = np.cos(azimuth), np.sin(azimuth)
    turned = (
        np.stack([out * cos - across * sin, out * sin + across * cos, up], axis=-1)
        for out, across, up in (np.moveaxis(vector, -1, 0) for vector in local_motion(state))
    )
    return CartesianMotion(*turned)


def polynomial(coefficient: FloatArray, time: float) -> SphericalState:
    """Return the state of viewpoints that are cubics in time, (3,)."""
    q, v, a, j = coefficient
    t = time
    return SphericalState(q + t * (v + t * (a / 2 + t * j / 6)), v + t * (a + t * j / 2), a + t * j, j)


@given(coefficients)
def test_each_derivative_is_the_slope_of_the_one_before(coefficient: FloatArray) -> None:
    """Central differences with an error of the fourth order."""
    coefficient[0] += [5, 0, 0]
    step = 1e-3
    times = np.array([-2, -1, 1, 2]) * step
    weights = np.array([1, -8, 8, -1]) / (12 * step)
    around = [cartesian_motion(polynomial(coefficient, time)) for time in times]
    position = [cartesian(polynomial(coefficient, time).viewpoint) for time in times]
    found = cartesian_motion(polynomial(coefficient, 0.0))
    for derivative, samples in (
        (found.velocity, position),
        (found.acceleration, [motion.velocity for motion in around]),
        (found.jerk, [motion.acceleration for motion in around]),
    ):
        slope = weights @ np.array(samples)
        np.testing.assert_allclose(derivative, slope, rtol=1e-6, atol=1e-6)


def circling(distance: float, polar: float, rate: float) -> SphericalState:
    zero = np.zeros(3)
    return SphericalState(np.array([distance, 0.3, polar]), np.array([0, rate, 0]), zero, zero)


def test_a_circle_at_constant_rate() -> None:
    """On a circle of radius r the vectors have lengths r w, r w^2 and r w^3; the second points at its centre."""
    motion = cartesian_motion(circling(10.0, np.radians(30), 0.5))
    lengths = [np.linalg.norm(vector) for vector in motion]
    assert lengths == pytest.approx([5 * 0.5, 5 * 0.25, 5 * 0.125])
    np.testing.assert_allclose(motion.acceleration, -1.25 * np.array([np.cos(0.3), np.sin(0.3), 0]), atol=1e-12)


def test_straight_above_turning_is_no_motion() -> None:
    for vector in cartesian_motion(circling(8.0, 0.0, 2.0)):
        np.testing.assert_allclose(vector, 0, atol=1e-12)


def test_coriolis() -> None:
    """Going straight out along a turning ray: 2 v w across, r w^2 inwards."""
    state = SphericalState(np.array([6.0, 0.0, np.pi / 2]), np.array([2.0, 0.5, 0.0]), np.zeros(3), np.zeros(3))
    np.testing.assert_allclose(cartesian_motion(state).acceleration, [-6 * 0.25, 2 * 2 * 0.5, 0], atol=1e-12)


@given(arrays(np.float64, (4, 3), elements=st.floats(-2, 2)), st.floats(-7, 7))
def test_lengths_and_heights_do_not_depend_on_the_azimuth(parts: FloatArray, turn: float) -> None:
    before = cartesian_motion(SphericalState(*parts))
    after = cartesian_motion(SphericalState(parts[0] + [0, turn, 0], *parts[1:]))
    for one, other in zip(before, after, strict=True):
        assert np.linalg.norm(one) == pytest.approx(np.linalg.norm(other), abs=1e-9)
        assert one[2] == other[2]


def test_any_number_of_leading_axes() -> None:
    rng = np.random.default_rng(0)
    parts = rng.standard_normal((4, 5, 7, 3))
    motion = cartesian_motion(SphericalState(*parts))
    single = cartesian_motion(SphericalState(*parts[:, 2, 3]))
    for whole, one in zip(motion, single, strict=True):
        assert whole.shape == (5, 7, 3)
        np.testing.assert_allclose(whole[2, 3], one)
