"""Gain models whose fields are known, for tests of everything that values views."""

from typing import Any

import numpy as np

from ehar.arrays import FloatArray
from ehar.viewpoint import DISTANCE, cartesian
from planners.value.belief.clips import BeliefModel
from planners.value.field import GainField
from planners.value.model import FULL, GainModel
from planners.value.situation import PARTS, Situation
from planners.value.view_basis import BASIS_SIZE, PAPER_RANGE
from tests.helpers.fakes import SKELETON

PAIRS = np.array([[1, 2]])  # the shoulders of `fakes.SKELETON`
assert SKELETON.joint_names[1:3] == ("left_shoulder", "right_shoulder")


def peak_weights(viewpoint: FloatArray, strength: float = 1.0) -> FloatArray:
    """Return the weights (21,) of a field whose only maximum is at a viewpoint (3,)."""
    distance = (viewpoint[DISTANCE] - PAPER_RANGE.middle) / PAPER_RANGE.half
    weights = np.zeros(BASIS_SIZE)
    weights[[3, 1, 2]] = cartesian(viewpoint) / viewpoint[DISTANCE]
    weights[[16, 17]] = 2 * distance, -1.0  # -(s - distance)^2 and a constant
    return strength * weights


def model_of(weights: FloatArray, *, spread: float = 0.0) -> GainModel:
    """Return a model whose field has these weights (21,) whatever is known."""
    field = GainField((), weights[None], np.zeros((1, BASIS_SIZE)), spread)
    return GainModel({FULL: field}, BeliefModel(), PAIRS)


def random_situation(rng: np.random.Generator, *, episodes: int = 5, persons: int = 2, **known: Any) -> Situation:
    """Return a situation of 3 classes and an embedding of 4 numbers, drawn but for what is known."""
    drawn: dict[str, Any] = {
        "ratio": rng.random(episodes),
        "belief": rng.dirichlet(np.ones(3), episodes),
        "embedding": rng.normal(size=(episodes, 4)),
        "facing": rng.uniform(-np.pi, np.pi, (episodes, persons)),
        "facing_std": rng.uniform(0, 1.5, (episodes, persons)),
        "position": rng.normal(size=(episodes, persons, 3)),
        "seen": rng.normal(size=(episodes, BASIS_SIZE)),
    }
    return Situation(**{**drawn, **known})


def random_field(rng: np.random.Generator, *, persons: int = 2, parts: tuple[str, ...] = PARTS) -> GainField:
    """Return a field for `random_situation`."""
    sizes = {"ratio": 1, "history": 9, "belief": 3, "embedding": 4, "facing": 5 * persons}
    shape = (1 + sum(sizes[part] for part in parts), BASIS_SIZE)
    relative = rng.normal(size=shape) if "facing" in parts else np.zeros(shape)
    return GainField(parts, rng.normal(size=shape), relative, float(rng.random()))
