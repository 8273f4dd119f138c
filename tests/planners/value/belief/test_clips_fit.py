import numpy as np
import pytest
from scipy.special import log_softmax

from ehar.errors import DataError
from planners.value.belief.clips import readout
from planners.value.belief.clips_fit import ABLATIONS, BeliefParts, ablate_belief, fit_belief
from recognition.calibration import fit_temperature


def simulated(*, episodes, seed, temperature=1.0, correlation=0.0, drift=0.0, blind=0.0, length=20, classes=4):
    """Return rollouts of a recogniser that averages noisy frames: log_probs, viewpoints, labels, groups.

    Args:
        episodes: N, each a sequence of its own.
        seed: of everything.
        temperature: times which the recogniser's calibrated logits are too large.
        correlation: of neighbouring frames' noise.
        drift: how much of the activity unfolds over the episode.
        blind: log-variance that a view from above adds.
        length: L.
        classes: K.
    """
    rng = np.random.default_rng(seed)
    labels = np.arange(episodes) % classes
    viewpoints = np.broadcast_to(rng.uniform((5, 0, 0), (15, 6.2, 1.57), (episodes, 1, 3)), (episodes, length, 3))
    strength = 1 - drift + drift * np.linspace(0, 2, length)[:, None]
    noise = rng.standard_normal((episodes, length, classes))
    for frame in range(1, length):
        noise[:, frame] = correlation * noise[:, frame - 1] + np.sqrt(1 - correlation**2) * noise[:, frame]
    noise = noise * np.exp(0.5 * blind * np.cos(viewpoints[..., 2:]))
    frames = strength * np.eye(classes)[labels][:, None] + 1.5 * noise
    mean = frames.cumsum(axis=1) / np.arange(1, length + 1)[:, None]
    calibrated = mean / fit_temperature(mean, labels).at(np.arange(1, length + 1) / length)[:, None]
    return log_softmax(temperature * calibrated, axis=-1), viewpoints, labels, np.arange(episodes)


def nll_by_frame(log_probs, labels):
    return -np.take_along_axis(log_probs, labels[:, None, None], axis=-1)[..., 0].mean(axis=0)


def improvement(model, **how):
    """Return by how much the belief's NLL is lower than the recogniser's on other episodes, frame by frame."""
    log_probs, viewpoints, labels, _ = simulated(episodes=2000, seed=99, **how)
    return nll_by_frame(log_probs, labels) - nll_by_frame(readout(model, log_probs, viewpoints), labels)


@pytest.mark.parametrize("temperature", [0.6, 1.0, 1.8])
def test_the_belief_is_never_worse_than_the_recogniser_and_mends_its_confidence(temperature):
    model = fit_belief(*simulated(episodes=300, seed=1, temperature=temperature))
    better = improvement(model, temperature=temperature)
    assert better.min() > -0.01
    assert better.mean() > (0.001 if temperature == 1 else 0.01)


def test_a_fit_is_the_same_every_time():
    rollouts = simulated(episodes=40, seed=2)
    assert fit_belief(*rollouts) == fit_belief(*rollouts)


def test_process_noise_pays_where_an_activity_unfolds():
    how = {"drift": 1.0, "temperature": 2.0}
    rollouts = simulated(episodes=400, seed=3, **how)
    unfolding = fit_belief(*rollouts, BeliefParts(whitening=False, viewpoint=False))
    still = fit_belief(*rollouts, BeliefParts(whitening=False, process_noise=False, viewpoint=False))
    assert unfolding.process_noise > 0 == still.process_noise
    assert improvement(unfolding, **how).mean() > improvement(still, **how).mean() + 0.01


def test_noise_that_depends_on_the_viewpoint_is_found():
    how = {"blind": 4.0}
    model = fit_belief(*simulated(episodes=600, seed=4, **how))
    by_height = model.noise_weights[2] + model.noise_weights[3]
    assert by_height > 0.3
    blind = fit_belief(*simulated(episodes=600, seed=4, **how), BeliefParts(viewpoint=False))
    assert blind.noise_weights[1:] == (0.0,) * 4
    assert improvement(model, **how).mean() > improvement(blind, **how).mean()


def test_parts_that_are_not_fitted_are_off():
    model = fit_belief(*simulated(episodes=30, seed=5), ABLATIONS["accumulated"])
    assert (model.evidence, model.correlation, model.process_noise) == ("accumulated", 0.0, 0.0)
    assert model.noise_weights[1:] == (0.0,) * 4


def test_scarce_data_is_not_taken_for_more_than_it_is():
    log_probs, viewpoints, labels, groups = simulated(episodes=2, seed=6)
    one = fit_belief(log_probs, viewpoints, labels, groups)
    believed = readout(one, log_probs, viewpoints)
    assert np.abs(np.exp(believed) - np.exp(log_probs)).mean() < 0.02
    # The same rollouts cut from more sequences weigh more.
    many = fit_belief(*(np.repeat(array, 100, axis=0) for array in (log_probs, viewpoints, labels)), np.arange(200))
    assert np.abs(many.log_gain).max() > np.abs(one.log_gain).max()


def test_an_ablation_is_scored_on_sequences_it_was_not_fitted_to():
    log_probs, viewpoints, labels, _ = simulated(episodes=40, seed=7)
    groups = np.arange(40) // 4
    ablation = ablate_belief(log_probs, viewpoints, labels, groups, np.random.default_rng(0))
    assert tuple(ablation.log_probs) == ("recogniser", *ABLATIONS)
    assert {len(believed) for believed in ablation.log_probs.values()} == {20} == {len(ablation.labels)}
    held = np.array([(log_probs == row).all(axis=(1, 2)).argmax() for row in ablation.log_probs["recogniser"]])
    assert all(np.isin(np.flatnonzero(groups == group), held).all() for group in np.unique(groups[held]))
    np.testing.assert_array_equal(labels[held], ablation.labels)
    full = fit_belief(*(np.delete(array, held, axis=0) for array in (log_probs, viewpoints, labels, groups)))
    np.testing.assert_allclose(ablation.log_probs["full"], readout(full, log_probs[held], viewpoints[held]))


def test_rollouts_that_do_not_match_are_refused():
    log_probs, viewpoints, labels, groups = simulated(episodes=4, seed=8)
    with pytest.raises(DataError, match="got 4, 4, 3, 4"):
        fit_belief(log_probs, viewpoints, labels[:3], groups)
    with pytest.raises(DataError, match="at least 2 sequences"):
        ablate_belief(log_probs, viewpoints, labels, np.zeros(4), np.random.default_rng(0))
