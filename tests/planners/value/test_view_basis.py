"""The view basis: one formula in two libraries, orthonormal over the sphere, smooth at the pole."""

import casadi as ca
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ehar.viewpoint import cartesian
from planners.value.view_basis import BASIS_SIZE, PAPER_RANGE, basis_at, field_value, mean_direction, turned, view_basis

viewpoints = st.tuples(st.floats(5, 15), st.floats(-20, 20), st.floats(0, np.pi / 2)).map(np.array)


def test_it_has_as_many_functions_as_it_says() -> None:
    assert basis_at(np.ones((4, 2, 3)), PAPER_RANGE).shape == (4, 2, BASIS_SIZE)


@given(viewpoints)
def test_numpy_and_casadi_agree(viewpoint: np.ndarray) -> None:
    expected = basis_at(viewpoint, PAPER_RANGE)
    symbols = ca.SX.sym("viewpoint", 3)
    function = ca.Function("basis", [symbols], [ca.vertcat(*view_basis(*ca.vertsplit(symbols), PAPER_RANGE, ca))])
    np.testing.assert_allclose(np.array(function(viewpoint)).ravel(), expected, atol=1e-12)


def test_a_field_is_its_weights_times_the_basis_and_broadcasts() -> None:
    rng = np.random.default_rng(0)
    weights, viewpoint = rng.normal(size=(5, 1, BASIS_SIZE)), rng.uniform(1, 5, size=(7, 3))
    value = field_value(weights, viewpoint, PAPER_RANGE)
    assert value.shape == (5, 7)
    np.testing.assert_allclose(value, weights[:, 0] @ basis_at(viewpoint, PAPER_RANGE).T, atol=1e-12)


def test_the_harmonics_are_orthonormal_over_the_sphere() -> None:
    # Gauss-Legendre in cos(polar) and equal steps in azimuth are exact for these polynomials.
    heights, height_weights = np.polynomial.legendre.leggauss(8)
    azimuths = np.arange(8) * np.pi / 4
    polar, azimuth = np.meshgrid(np.arccos(heights), azimuths, indexing="ij")
    harmonics = basis_at(np.stack([np.full_like(polar, 10.0), azimuth, polar], axis=-1), PAPER_RANGE)[..., :16]
    gram = np.einsum("pai,paj,p->ij", harmonics, harmonics, height_weights / 2) / len(azimuths)
    np.testing.assert_allclose(gram, np.eye(16), atol=1e-12)


@given(viewpoints)
def test_it_is_periodic_in_the_azimuth(viewpoint: np.ndarray) -> None:
    np.testing.assert_allclose(
        basis_at(viewpoint + np.array([0, 2 * np.pi, 0]), PAPER_RANGE), basis_at(viewpoint, PAPER_RANGE), atol=1e-10
    )


@given(viewpoints, st.floats(-4, 4))
def test_straight_above_the_azimuth_does_not_matter(viewpoint: np.ndarray, azimuth: float) -> None:
    distance = viewpoint[0]
    np.testing.assert_allclose(
        basis_at(np.array([distance, viewpoint[1], 0.0]), PAPER_RANGE),
        basis_at(np.array([distance, azimuth, 0.0]), PAPER_RANGE),
        atol=1e-12,
    )


def test_the_distance_terms_span_the_workspace() -> None:
    near, middle, far = basis_at(np.array([[5.0, 0.3, 0.9], [10.0, 0.3, 0.9], [15.0, 0.3, 0.9]]), PAPER_RANGE)
    np.testing.assert_allclose(middle[16:], 0, atol=1e-15)
    np.testing.assert_allclose(far[[16, 18, 19, 20]], -near[[16, 18, 19, 20]], atol=1e-15)
    np.testing.assert_allclose([near[16], near[17], far[16], far[17]], [-1, 1, 1, 1])
    np.testing.assert_allclose(far[18:], far[[3, 1, 2]] / np.sqrt(3), atol=1e-15)
    np.testing.assert_allclose(near[:16], far[:16])


@given(st.integers(0, 2**32 - 1), viewpoints, st.floats(-20, 20))
def test_turning_counts_azimuths_from_elsewhere(seed: int, viewpoint: np.ndarray, angle: float) -> None:
    less = viewpoint - np.array([0, angle, 0])
    turned_basis = turned(basis_at(viewpoint, PAPER_RANGE), np.array(angle))
    np.testing.assert_allclose(turned_basis, basis_at(less, PAPER_RANGE), atol=1e-9)
    # A turned field has at a viewpoint the value that the field has at it turned back.
    weights = np.random.default_rng(seed).normal(size=BASIS_SIZE)
    np.testing.assert_allclose(
        turned(weights, np.array(-angle)) @ basis_at(viewpoint, PAPER_RANGE),
        weights @ basis_at(less, PAPER_RANGE),
        atol=1e-8,
    )


def test_sums_turn_as_their_terms_and_turning_leaves_its_argument() -> None:
    rng = np.random.default_rng(0)
    along = basis_at(rng.uniform(0, 6, (4, 7, 3)), PAPER_RANGE)
    before, angle = along.copy(), rng.normal(size=4)
    np.testing.assert_allclose(turned(along, angle[:, None]).sum(axis=1), turned(along.sum(axis=1), angle), atol=1e-9)
    np.testing.assert_array_equal(along, before)
    np.testing.assert_allclose(turned(turned(along, angle[:, None]), -angle[:, None]), along, atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.integers(1, 5))
def test_the_mean_direction_is_that_of_the_unit_vectors(seed: int, frames: int) -> None:
    rng = np.random.default_rng(seed)
    viewpoint = rng.uniform([5, -7, 0], [15, 7, np.pi / 2], (2, frames, 3))
    directions = cartesian(viewpoint) / viewpoint[..., :1]
    np.testing.assert_allclose(
        mean_direction(basis_at(viewpoint, PAPER_RANGE).mean(axis=1)), directions.mean(axis=1), atol=1e-12
    )
