"""The gain field: what its weights are by definition, in three libraries, wherever the azimuth is counted from."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.errors import ModelError
from planners.value.field import GainField, feature_matrix
from planners.value.situation import PARTS
from planners.value.view_basis import BASIS_SIZE, PAPER_RANGE, basis_at, field_value, view_basis
from tests.helpers.gain_models import random_field, random_situation

seeds = st.integers(0, 2**32 - 1)
viewpoints = st.tuples(st.floats(5, 15), st.floats(-7, 7), st.floats(0, np.pi / 2)).map(np.array)


@given(seeds, viewpoints, st.integers(1, 3))
def test_weights_are_those_of_the_definition(seed: int, viewpoint: np.ndarray, persons: int) -> None:
    rng = np.random.default_rng(seed)
    situation, field = random_situation(rng, persons=persons), random_field(rng, persons=persons)
    relative = viewpoint - situation.reference[:, None] * np.array([0, 1, 0])  # as seen from the reference
    features = feature_matrix(situation, PARTS)
    expected = features @ field.absolute @ basis_at(viewpoint, PAPER_RANGE) + np.einsum(
        "bf,fk,bk->b", features, field.relative, basis_at(relative, PAPER_RANGE)
    )
    np.testing.assert_allclose(field_value(field.weights(situation), viewpoint, PAPER_RANGE), expected, atol=1e-9)


@pytest.mark.parametrize(
    "viewpoint", [[9.0, 1.0, 0.7], [5.0, 0.0, 0.0], [15.0, 2.0, 0.0], [7.0, -1e-9, 1.2], [7.0, 2 * np.pi, np.pi / 2]]
)
def test_numpy_and_casadi_give_the_same_value(viewpoint: list[float]) -> None:
    rng = np.random.default_rng(3)
    weights = random_field(rng).weights(random_situation(rng))
    value = field_value(weights, np.array(viewpoint), PAPER_RANGE)
    symbols, symbolic = ca.SX.sym("viewpoint", 3), ca.SX.sym("weights", BASIS_SIZE)
    function = ca.Function(
        "value",
        [symbolic, symbols],
        [ca.dot(symbolic, ca.vertcat(*view_basis(*ca.vertsplit(symbols), PAPER_RANGE, ca)))],
    )
    np.testing.assert_allclose([float(function(row, viewpoint)) for row in weights], value, atol=1e-6)


def test_straight_above_and_across_azimuth_0_it_is_one_smooth_function() -> None:
    rng = np.random.default_rng(4)
    weights = random_field(rng).weights(random_situation(rng))[:, None]
    around = np.linspace(0, 2 * np.pi, 9)
    above = field_value(weights, np.stack([np.full(9, 8.0), around, np.zeros(9)], axis=-1), PAPER_RANGE)
    np.testing.assert_allclose(above, np.repeat(above[:, :1], 9, axis=1), atol=1e-9)
    sides = field_value(weights, np.array([[8.0, 1e-7, 1.0], [8.0, 2 * np.pi - 1e-7, 1.0]]), PAPER_RANGE)
    np.testing.assert_allclose(sides[:, 0], sides[:, 1], atol=1e-4)


@given(seeds, st.floats(-7, 7))
def test_what_is_relative_turns_with_the_people_and_what_is_absolute_does_not(seed: int, angle: float) -> None:
    rng = np.random.default_rng(seed)
    situation, field = random_situation(rng, persons=1), random_field(rng, persons=1, parts=("ratio", "facing"))
    turned = replace(situation, facing=situation.facing + angle)
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    turned = replace(turned, position=situation.position @ turn)
    viewpoint = np.array([9.0, 1.0, 0.8])
    relative = replace(field, absolute=np.zeros_like(field.absolute))
    np.testing.assert_allclose(
        field_value(relative.weights(turned), viewpoint + np.array([0, angle, 0]), PAPER_RANGE),
        field_value(relative.weights(situation), viewpoint, PAPER_RANGE),
        atol=1e-8,
    )
    absolute = replace(field, relative=np.zeros_like(field.relative))
    np.testing.assert_allclose(absolute.weights(turned), absolute.weights(situation), atol=1e-8)


@pytest.mark.parametrize("without", [None, *PARTS])
def test_a_field_depends_on_its_parts_only(without: str | None) -> None:
    rng = np.random.default_rng(5)
    parts = tuple(part for part in PARTS if part != without)
    situation, field = random_situation(rng), random_field(rng, parts=parts)
    other = random_situation(rng)
    same_reference = {"facing": situation.facing, "position": situation.position}
    changes = {
        "ratio": {"ratio": other.ratio},
        "history": {"seen": other.seen},
        "belief": {"belief": other.belief},
        "embedding": {"embedding": other.embedding},
        "facing": {"facing": other.facing, "position": other.position, "facing_std": other.facing_std},
    }
    for part, change in changes.items():
        moved = np.abs(field.weights(replace(situation, **same_reference | change)) - field.weights(situation)).max()
        assert (moved > 1e-3) == (part != without), part


def test_a_situation_with_other_features_is_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ModelError, match="expected 27 features of ratio, history, belief, embedding, facing, got 22"):
        random_field(rng).weights(random_situation(rng, persons=1))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"parts": ("ratio", "mood")}, "got mood"),
        ({"absolute": np.zeros((3, 20))}, r"got \(3, 20\) and"),
        ({"relative": np.zeros((2, BASIS_SIZE))}, r"and \(2, 21\)"),
        ({"absolute": np.zeros((0, BASIS_SIZE)), "relative": np.zeros((0, BASIS_SIZE))}, r"got \(0, 21\)"),
        ({"absolute": np.array(1.0)}, r"got \(\) and"),
        ({"absolute": np.full((3, BASIS_SIZE), np.nan)}, "finite weights, got nan"),
        ({"relative": np.full((3, BASIS_SIZE), np.inf)}, "finite weights, got inf"),
        ({"spread": -0.1}, "spread of at least 0, got -0.1"),
        ({"spread": float("nan")}, "spread of at least 0, got nan"),
        ({"spread": float("inf")}, "spread of at least 0, got inf"),
    ],
)
def test_what_is_no_field_is_refused(changes: dict[str, object], message: str) -> None:
    field = GainField(("ratio",), np.zeros((3, BASIS_SIZE)), np.zeros((3, BASIS_SIZE)), 0.0)
    with pytest.raises(ModelError, match=message):
        replace(field, **changes)  # type: ignore[arg-type]
