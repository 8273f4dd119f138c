"""The agent's inputs, by hand."""

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.envs.observations import Observations
from planners.agents.inputs import ENCODED, LEAST_LOG_PROB, AgentInputs, InputSizes


def frame(**parts: FloatArray) -> Observations:
    """Return what is shown of one episode of 2 persons with 3 joints, 2 classes and an embedding of 2 numbers."""
    plain = {
        "joints": np.zeros((1, 2, 3, 2)),
        "confidence": np.ones((1, 2, 3)),
        "viewpoint": np.array([[0.5, 0.0, 1.0, 0.25]]),
        "probabilities": np.array([[0.5, 0.5]]),
        "embedding": np.array([[1.0, 2.0]]),
        "ratio": np.array([[0.1]]),
    }
    return {name: np.asarray(value, dtype=np.float32) for name, value in {**plain, **parts}.items()}


def vision(joints: object, confidence: object = ((1, 1, 1), (1, 1, 1))) -> FloatArray:
    seen = AgentInputs().see(frame(joints=np.array([joints]), confidence=np.array([confidence])))
    return seen["vision"][0]


SQUARE = [[0.1, 0.2], [0.3, 0.2], [0.2, 0.5]]  # its mean is (0.2, 0.3)


def test_recognition_is_the_embedding_its_mean_so_far_log_probabilities_and_the_ratio() -> None:
    inputs = AgentInputs()
    inputs.see(frame())
    inputs.see(frame(embedding=np.array([[3.0, 8.0]])))
    third = inputs.see(
        frame(embedding=np.array([[-1.0, -1.0]]), probabilities=np.array([[0.9, 0.1]]), ratio=np.array([[0.3]]))
    )
    expected = [-1, -1, 1, 3, np.log(0.9), np.log(0.1), 0.3]
    np.testing.assert_allclose(third["recognition"], [expected], rtol=1e-6)


def test_what_is_very_improbable_is_as_improbable_as_anything() -> None:
    seen = AgentInputs().see(frame(probabilities=np.array([[1.0, 0.0]])))["recognition"]
    np.testing.assert_allclose(seen[0, 4:6], [0, LEAST_LOG_PROB], atol=1e-6)
    assert LEAST_LOG_PROB == -8


def test_position_is_the_viewpoint_as_shown() -> None:
    np.testing.assert_array_equal(AgentInputs().see(frame())["position"], [[0.5, 0, 1, 0.25]])


def test_a_body_is_its_shape_its_confidence_and_where_and_how_large_it_is() -> None:
    other = [[0.0, 0.0], [0.0, 0.0], [0.0, 0.3]]
    seen = vision([SQUARE, other], [[1, 1, 1], [0.3, 1, 1]])
    within = np.array([[-0.1, -0.1], [0.1, -0.1], [0.0, 0.2]])
    size = np.sqrt((0.02 + 0.02 + 0.04) / 3) + 1e-3
    other_size = np.sqrt((0.01 + 0.01 + 0.04) / 3) + 1e-3
    other_within = np.array([[0.0, -0.1], [0.0, -0.1], [0.0, 0.2]])
    expected = [
        *(within / size).ravel(),  # shapes of all persons, then their confidence, and so on
        *(other_within / other_size).ravel(),
        *(1, 1, 1, 0.3, 1, 1),
        *(0.2, 0.3, 0.0, 0.1),  # places
        *np.log([size, other_size]),
        *(1, 1),  # the share of joints that are seen
    ]
    np.testing.assert_allclose(seen, expected, rtol=1e-4, atol=1e-6)


def test_missing_joints_are_nowhere() -> None:
    half = [SQUARE[0], SQUARE[1], [0.0, 0.0]]
    seen = vision([half, SQUARE], [[1, 0.3, 0], [0, 0, 0]])
    elsewhere = vision([[*half[:2], [7.0, -3.0]], np.ones((3, 2)).tolist()], [[1, 0.3, 0], [0, 0, 0]])
    np.testing.assert_array_equal(seen, elsewhere)
    size = 0.1 + 1e-3  # of two joints, each 0.1 from the middle
    np.testing.assert_allclose(seen[:6], [-0.1 / size, 0, 0.1 / size, 0, 0, 0], atol=1e-6)
    np.testing.assert_allclose(seen[6:12], 0)  # a person of whom nothing is seen
    np.testing.assert_allclose(seen[18:], [0.2, 0.2, 0, 0, np.log(size), np.log(1e-3), 2 / 3, 0], atol=1e-6)


def test_a_shape_is_free_of_place_and_size() -> None:
    shape = np.array([SQUARE, SQUARE])
    near, far = vision(2 * shape + [0.3, -0.1]), vision(shape)
    np.testing.assert_allclose(near[:12], far[:12], rtol=0.01, atol=1e-6)  # but for what keeps sizes from 0
    np.testing.assert_allclose(near[22:24] - far[22:24], np.log(2), atol=0.01)
    np.testing.assert_allclose(near[18:20], [0.7, 0.5], atol=1e-6)


@pytest.mark.parametrize(("persons", "joints", "classes", "embedding"), [(1, 6, 3, 3), (2, 17, 10, 128)])
def test_sizes_are_those_of_the_inputs(persons: int, joints: int, classes: int, embedding: int) -> None:
    rng = np.random.default_rng(0)
    shown = {
        "joints": rng.normal(size=(4, persons, joints, 2)),
        "confidence": rng.random((4, persons, joints)),
        "viewpoint": rng.random((4, 4)),
        "probabilities": rng.random((4, classes)),
        "embedding": rng.normal(size=(4, embedding)),
        "ratio": rng.random((4, 1)),
    }
    inputs = AgentInputs().see({name: value.astype(np.float32) for name, value in shown.items()})
    sizes = InputSizes.of(persons=persons, joints=joints, classes=classes, embedding=embedding)
    assert tuple(inputs) == ENCODED
    assert {name: values.shape for name, values in inputs.items()} == {
        name: (4, getattr(sizes, name)) for name in ENCODED
    }
    assert {values.dtype for values in inputs.values()} == {np.dtype(np.float32)}


def test_a_long_episode_s_mean_keeps_its_digits() -> None:
    # In float32 the sum of 20,000 embeddings of 1000.1 would be off in the fourth digit.
    inputs, embedding = AgentInputs(), np.full((1, 2), 1000.1)
    for _ in range(20_000):
        last = inputs.see(frame(embedding=embedding))
    np.testing.assert_array_equal(last["recognition"][0, 2:4], np.float32([1000.1, 1000.1]))
