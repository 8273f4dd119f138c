import json
from dataclasses import asdict, replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import log_softmax

from ehar.errors import DataError, ModelError
from ehar.files import parse_json
from planners.value.belief.clips import Belief, BeliefModel, knot_weights, noise_basis, readout
from planners.value.view_basis import PAPER_RANGE
from recognition.calibration import KNOTS
from tests.helpers.examples import share_of_examples

FITTED = BeliefModel(
    log_scale=(0.2, 0.1, 0.0, -0.1, -0.2),
    log_gain=(-0.2, -0.1, 0.0, 0.1, 0.3),
    noise_weights=(-1.0, 0.3, -0.5, 0.4, 0.6),
    process_noise=0.02,
    correlation=0.7,
    prior_variance=5.0,
)


def rollouts(*, episodes=4, length=12, classes=5, seed=0):
    """Return log-probabilities (B, L, K) and viewpoints (B, L, 3) of nothing in particular."""
    rng = np.random.default_rng(seed)
    log_probs = log_softmax(2 * rng.standard_normal((episodes, length, classes)), axis=-1)
    low, high = (5.0, 0.0, 0.0), (15.0, 6.2, 1.57)
    return log_probs, rng.uniform(low, high, size=(episodes, length, 3))


@pytest.mark.parametrize(
    "model",
    [
        FITTED,
        replace(FITTED, correlation=0.0),
        replace(FITTED, process_noise=0.0),
        replace(FITTED, evidence="accumulated"),
    ],
    ids=["fitted", "white", "still", "accumulated"],
)
def test_one_variance_an_episode_equals_filterpy_with_full_matrices(model):
    log_probs, viewpoints = rollouts()
    episodes, length, classes = log_probs.shape
    belief = Belief(model)
    belief.start(episodes, classes)
    identity = np.eye(classes)
    singles = []
    for _ in range(episodes):
        single = KalmanFilter(classes, classes)
        single.P, single.Q = model.prior_variance * identity, model.process_noise * identity
        singles.append(single)
    before, evidence = np.zeros((episodes, classes)), np.zeros((episodes, classes))
    rho = model.correlation
    for frame in range(length):
        ratio = (frame + 1) / length
        belief.update(log_probs[:, frame], viewpoints[:, frame], ratio, frame)
        centred = log_probs[:, frame] - log_probs[:, frame].mean(axis=1, keepdims=True)
        logits = np.exp(np.interp(ratio, KNOTS, model.log_scale)) * centred
        new = logits if model.evidence == "accumulated" else (frame + 1) * logits - frame * before
        noise = np.exp(noise_basis(viewpoints[:, frame], ratio, PAPER_RANGE) @ model.noise_weights)
        for episode, single in enumerate(singles):
            if frame == 0:
                single.update(new[episode][:, None], noise[episode] / (1 - rho**2) * identity, identity)
                continue
            single.predict()
            single.M = rho * model.process_noise * identity
            single.update_correlated(
                (new[episode] - rho * evidence[episode])[:, None],
                (noise[episode] + rho**2 * model.process_noise) * identity,
                (1 - rho) * identity,
            )
        before, evidence = logits, new
        for episode, single in enumerate(singles):
            np.testing.assert_allclose(belief.mean[episode], single.x[:, 0], atol=1e-9, rtol=0)
            np.testing.assert_allclose(belief.variance[episode] * identity, single.P, atol=1e-9, rtol=0)


def test_the_default_believes_the_recogniser():
    log_probs, viewpoints = rollouts(length=30)
    np.testing.assert_allclose(readout(BeliefModel(), log_probs, viewpoints), log_probs, atol=5e-3)


@share_of_examples(0.3)
@given(seed=st.integers(0, 1000), noise=st.floats(-3, 3))
def test_independent_evidence_under_a_wide_prior_averages_to_the_recogniser(seed, noise):
    log_probs, viewpoints = rollouts(seed=seed)
    weights = (noise, 0.0, 0.0, 0.0, 0.0)
    belief = Belief(BeliefModel(noise_weights=weights, prior_variance=1e9))
    belief.start(4, 5)
    for frame in range(12):
        belief.update(log_probs[:, frame], viewpoints[:, frame], (frame + 1) / 12, frame)
        expected = log_probs[:, frame] - log_probs[:, frame].mean(axis=-1, keepdims=True)
        np.testing.assert_allclose(belief.mean, expected, atol=1e-6)
        np.testing.assert_allclose(belief.variance, np.exp(noise) / (frame + 1), rtol=1e-6)


@share_of_examples(0.5)
@given(
    seed=st.integers(0, 1000),
    correlation=st.floats(0, 0.98),
    process_noise=st.floats(0, 100),
    prior_variance=st.floats(1e-3, 1e3),
)
def test_every_filter_gives_probabilities_and_positive_variances(seed, correlation, process_noise, prior_variance):
    log_probs, viewpoints = rollouts(seed=seed)
    model = replace(FITTED, correlation=correlation, process_noise=process_noise, prior_variance=prior_variance)
    believed = readout(model, log_probs, viewpoints)
    np.testing.assert_allclose(np.exp(believed).sum(axis=-1), 1.0)
    belief = Belief(model)
    belief.start(4, 5)
    for frame in range(12):
        belief.update(log_probs[:, frame], viewpoints[:, frame], (frame + 1) / 12, frame)
        assert (belief.variance > 0).all()
        np.testing.assert_allclose(belief.mean.sum(axis=-1), 0.0, atol=1e-8)


@share_of_examples(0.2)
@given(seed=st.integers(0, 1000))
def test_classes_in_another_order_are_believed_in_that_order(seed):
    log_probs, viewpoints = rollouts(seed=seed)
    order = np.random.default_rng(seed).permutation(5)
    believed = readout(FITTED, log_probs, viewpoints)
    again = readout(FITTED, log_probs[..., order], viewpoints)
    # The logarithm of a probability of nearly 1 is nearly 0, and keeps few of its digits.
    np.testing.assert_allclose(again, believed[..., order], atol=1e-12)


def test_a_belief_does_not_know_the_future_or_the_episodes_beside_it():
    log_probs, viewpoints = rollouts()
    believed = readout(FITTED, log_probs, viewpoints)
    changed = log_probs.copy()
    changed[:, 6:] = log_probs[::-1, 6:]
    changed[1:] = log_probs[:-1]
    np.testing.assert_array_equal(readout(FITTED, changed, viewpoints)[0, :6], believed[0, :6])


def test_a_new_episode_begins_anew():
    log_probs, viewpoints = rollouts()
    belief = Belief(FITTED)
    means = []
    for _ in range(2):
        belief.start(4, 5)
        for frame in range(3):
            belief.update(log_probs[:, frame], viewpoints[:, frame], (frame + 1) / 12, frame)
        means.append(belief.mean)
    np.testing.assert_array_equal(*means)


def test_a_viewpoint_with_less_noise_moves_the_belief_more():
    log_probs, _ = rollouts(episodes=1)
    sure = []
    for polar in (0.0, np.pi / 2):
        belief = Belief(BeliefModel(noise_weights=(0.0, 0.0, 2.0, 0.0, 0.0)))
        belief.start(1, 5)
        belief.update(log_probs[:, 0], np.array([[10.0, 0.0, polar]]), 0.1, 0)
        sure.append((np.linalg.norm(belief.mean), -belief.variance[0]))
    assert sure[0] < sure[1]


def test_an_uncertain_mean_is_moderated():
    log_probs, viewpoints = rollouts()
    noisy = BeliefModel(noise_weights=(3.0, 0.0, 0.0, 0.0, 0.0), prior_variance=1e6)
    believed = readout(noisy, log_probs, viewpoints)
    assert (believed.max(axis=-1) < log_probs.max(axis=-1)).all()
    np.testing.assert_array_equal(believed.argmax(axis=-1), log_probs.argmax(axis=-1))


@given(st.floats(0, 1))
def test_knots_interpolate(ratio):
    values = np.array([3.0, -1.0, 0.5, 2.0, 7.0])
    np.testing.assert_allclose(knot_weights(np.array(ratio)) @ values, np.interp(ratio, KNOTS, values), atol=1e-12)


def read(content):
    return parse_json(json.dumps(content), BeliefModel, "model.json", "a belief")


def test_a_model_survives_json():
    assert read(asdict(FITTED)) == FITTED


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"log_scale": (0.0,) * 4}, "log_scale: expected 5 finite numbers"),
        ({"log_gain": (0.0, 0.0, float("nan"), 0.0, 0.0)}, "log_gain: expected 5 finite numbers"),
        ({"noise_weights": ()}, "noise_weights: expected 5 finite numbers"),
        ({"process_noise": -1.0}, "process_noise: expected a finite number of at least 0"),
        ({"process_noise": float("inf")}, "process_noise: expected a finite number of at least 0"),
        ({"correlation": 1.0}, "correlation: expected a number in"),
        ({"prior_variance": 0.0}, "prior_variance: expected a finite number above 0"),
        ({"evidence": "hearsay"}, "evidence: expected difference or accumulated, got 'hearsay'"),
    ],
)
def test_a_parameter_that_no_filter_can_have_is_named(change, message):
    with pytest.raises(ModelError, match=f"belief: {message}"):
        replace(FITTED, **change)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"log_scale": [0.0] * 4}, "belief: log_scale: expected 5 finite numbers"),
        ({"log_gain": [0.0, 0.0, float("nan"), 0.0, 0.0]}, r"log_gain\[2\]: expected a finite number, got nan"),
        ({"noise_weights": "much"}, "noise_weights: expected a list, got 'much'"),
        ({"process_noise": -1.0}, "belief: process_noise: expected a finite number of at least 0"),
        ({"process_noise": [1.0]}, r"process_noise: expected a number, got \[1.0\]"),
        ({"evidence": "hearsay"}, "evidence: expected 'difference' or 'accumulated', got 'hearsay'"),
        ({"mood": 1.0}, "unknown mood; expected log_scale, "),
    ],
)
def test_a_malformed_model_is_named(content, message):
    with pytest.raises(DataError, match=f"model.json: {message}"):
        read({**asdict(FITTED), **content})


def test_a_parameter_that_is_missing_is_named_though_it_has_a_default():
    content = asdict(FITTED)
    del content["process_noise"]
    with pytest.raises(DataError, match="missing process_noise; expected log_scale, "):
        read(content)
