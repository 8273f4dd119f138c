"""Temperatures that depend on the observation ratio."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.special import log_softmax, softmax

from recognition.calibration import KNOTS, Temperature, fit_temperature
from tests.helpers.examples import share_of_examples

LENGTH = 20
RATIO = np.arange(1, LENGTH + 1) / LENGTH


def nll(logits: np.ndarray, labels: np.ndarray, temperature: np.ndarray) -> float:
    log_probs = log_softmax(logits / temperature[:, None], axis=-1)
    return float(-np.take_along_axis(log_probs, labels[:, None, None], axis=-1).mean())


def test_interpolates_between_its_knots_and_holds_beyond_the_last() -> None:
    temperature = Temperature((0.0, 1.0, 2.0, 1.0, -1.0))
    np.testing.assert_allclose(temperature.at(np.array(KNOTS)), np.exp([0.0, 1.0, 2.0, 1.0, -1.0]))
    np.testing.assert_allclose(temperature.at(np.array([0.125, 0.875, 1.7])), np.exp([0.5, 0.0, -1.0]))
    np.testing.assert_array_equal(Temperature().at(RATIO), np.ones(LENGTH))


@pytest.mark.parametrize("true", [(0.8, 0.6, 0.4, 0.2, 0.0), (-0.5, -0.5, -0.5, -0.5, -0.5), (0.0, 0.0, 0.3, 0.6, 0.9)])
def test_recovers_a_known_temperature_at_every_ratio(true: tuple[float, ...]) -> None:
    # One label a clip, drawn from what the well-calibrated logits of a ratio say of it.
    rng = np.random.default_rng(0)
    clips = 1000
    labels = np.tile(np.arange(5), clips // 5)
    exact = np.zeros((clips, LENGTH, 5))
    for frame in range(LENGTH):
        drawn = rng.normal(0, 2, (clips, 5))
        probabilities = softmax(drawn, axis=-1)
        # Relabel the classes of each clip so that the drawn one is the clip's label.
        drawn_label = (probabilities.cumsum(axis=-1) > rng.random((clips, 1))).argmax(axis=-1)
        shift = (np.arange(5) - labels[:, None] + drawn_label[:, None]) % 5
        exact[:, frame] = np.take_along_axis(drawn, shift, axis=-1)
    known = Temperature(true).at(RATIO)
    logits = exact * known[:, None]
    fitted = fit_temperature(logits.astype(np.float32), labels)
    np.testing.assert_allclose(np.log(fitted.at(RATIO)), np.log(known), atol=0.12)
    assert nll(logits, labels, fitted.at(RATIO)) < nll(logits, labels, np.ones(LENGTH))


@share_of_examples(0.15)
@given(
    logits=arrays(np.float64, (4, 5, 3), elements=st.floats(-8, 8)),
    labels=arrays(np.int64, 4, elements=st.integers(0, 2)),
)
def test_never_makes_the_fitted_likelihood_worse(logits: np.ndarray, labels: np.ndarray) -> None:
    fitted = fit_temperature(logits, labels)
    ratio = np.arange(1, 6) / 5
    assert nll(logits, labels, fitted.at(ratio)) <= nll(logits, labels, np.ones(5)) + 1e-9


def test_stays_finite_on_clips_that_are_all_right() -> None:
    labels = np.arange(3)
    logits = np.repeat(50.0 * np.eye(3)[:, None], LENGTH, axis=1)
    assert np.isfinite(fit_temperature(logits, labels).at(RATIO)).all()


def test_what_counts_little_in_training_counts_little_in_calibration() -> None:
    logits, labels = np.zeros((40, 6, 2), dtype=np.float32), np.arange(40) % 2
    logits[..., 0] = 2.0
    sure = fit_temperature(logits, labels, np.array([1.0, 0.01])).at(np.array([0.5]))[0]
    assert sure < fit_temperature(logits, labels).at(np.array([0.5]))[0]
