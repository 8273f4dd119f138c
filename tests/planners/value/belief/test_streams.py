"""The belief in streams is the Bayes filter of its chain: against filterpy, by hand, and against the recogniser."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest
from filterpy.discrete_bayes import update
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import log_softmax

from ehar.errors import ModelError
from ehar.files import parse_json
from planners.value.belief.chain import Chain, advance, begin, classes_of_states, coming_shares, transition_matrix
from planners.value.belief.filters import OneStreamBelief, StreamBelief, read_streams
from planners.value.belief.streams import StreamBeliefModel
from tests.helpers.examples import share_of_examples

FPS = 10.0
LEARNED = StreamBeliefModel(
    follows=((0.1, 0.7, 0.2), (0.3, 0.3, 0.4), (0.6, 0.3, 0.1)),
    rates=(0.5, 1.0, 0.25),
    gap_share=(0.9, 0.2, 0.5),
    gap_rate=1.25,
    share=(0.3, 0.2, 0.4, 0.1),
    phases=3,
    gap_phases=2,
    view_weights=(-0.3, 0.2, 0.4, -0.5),
    kept=0.8,
)


def recognised(*, streams: int = 4, frames: int = 50, classes: int = 3, seed: int = 0):
    """Return log-probabilities (B, T, K + 1) and viewpoints (B, T, 3) of nothing in particular."""
    rng = np.random.default_rng(seed)
    log_probs = log_softmax(3 * rng.standard_normal((streams, frames, classes + 1)), axis=-1)
    return log_probs, rng.uniform((5.0, 0.0, 0.0), (15.0, 6.2, 1.57), size=(streams, frames, 3))


def handwritten(model: StreamBeliefModel, seconds: float) -> np.ndarray:
    """Return the transitions state by state, as one would write them down."""
    count, n, m = model.classes, model.phases, model.gap_phases

    def activity(k: int, phase: int = 0) -> int:
        return k * n + phase

    def gap(k: int, phase: int = 0) -> int:
        return count * n + k * m + phase

    matrix = np.zeros((count * (n + m), count * (n + m)))
    for k in range(count):
        for phase in range(n):
            leave = min(n * model.rates[k] * seconds, 1.0)
            matrix[activity(k, phase), activity(k, phase)] += 1 - leave
            if phase + 1 < n:
                matrix[activity(k, phase), activity(k, phase + 1)] += leave
                continue
            matrix[activity(k, phase), gap(k)] += leave * model.gap_share[k]
            for j in range(count):
                matrix[activity(k, phase), activity(j)] += leave * (1 - model.gap_share[k]) * model.follows[k][j]
        for phase in range(m):
            leave = min(m * model.gap_rate * seconds, 1.0)
            matrix[gap(k, phase), gap(k, phase)] += 1 - leave
            if phase + 1 < m:
                matrix[gap(k, phase), gap(k, phase + 1)] += leave
                continue
            for j in range(count):
                matrix[gap(k, phase), activity(j)] += leave * model.follows[k][j]
    return matrix


@pytest.mark.parametrize(
    "model",
    [
        LEARNED,
        LEARNED.without_transitions(),
        LEARNED.without_durations(),
        StreamBeliefModel.believing(LEARNED.share),
        replace(LEARNED, kept=0.0, rates=(20.0, 1.0, 1.0)),
    ],
    ids=["learned", "no transitions", "no durations", "believing", "shorter than a frame"],
)
def test_the_batch_equals_filterpy_on_each_stream(model: StreamBeliefModel) -> None:
    log_probs, viewpoints = recognised()
    believed = read_streams(model, log_probs, viewpoints, fps=FPS)
    single = OneStreamBelief(model, fps=FPS)
    for stream, (said, seen) in enumerate(zip(log_probs, viewpoints, strict=True)):
        single.start()
        for frame in range(len(said)):
            single.update(said[frame], seen[frame])
            np.testing.assert_allclose(single.probabilities, believed[stream, frame], rtol=0, atol=1e-9)


def test_filterpy_with_a_matrix_written_by_hand_says_the_same() -> None:
    log_probs, viewpoints = recognised(streams=1)
    believed = read_streams(LEARNED, log_probs, viewpoints, fps=FPS)[0]
    matrix, of_state = handwritten(LEARNED, 1 / FPS), classes_of_states(LEARNED)
    states = np.concatenate([part.ravel() for part in begin(LEARNED, 1)])
    before = np.zeros(4)
    for frame in range(log_probs.shape[1]):
        distance, polar = (viewpoints[0, frame, 0] - 10) / 5, np.cos(viewpoints[0, frame, 2])
        weight = np.exp(np.dot(LEARNED.view_weights, [1, distance, polar, polar**2]))
        said = log_probs[0, frame] - np.log(LEARNED.share)
        likelihood = np.exp(weight * (said - LEARNED.kept * before))
        states = update(likelihood[of_state], states @ matrix if frame else states)
        before = said
        np.testing.assert_allclose(np.bincount(of_state, weights=states), believed[frame], rtol=0, atol=1e-9)


def test_transitions_are_those_written_by_hand() -> None:
    matrix = transition_matrix(LEARNED, 1 / FPS)
    np.testing.assert_allclose(matrix, handwritten(LEARNED, 1 / FPS), atol=1e-12)
    np.testing.assert_allclose(matrix.sum(axis=1), 1)


def test_durations_have_the_mean_and_the_spread_of_their_phases() -> None:
    """One activity is followed until it ends: the survival gives mean and standard deviation of its duration."""
    model = replace(LEARNED, rates=(0.5, 0.0, 0.0), follows=((0.0, 1.0, 0.0),) * 3, gap_share=(0.0, 0.0, 0.0))
    fps = 200.0
    chain = begin(model, 1)
    chain = Chain(np.zeros_like(chain.activity), np.zeros_like(chain.gap))
    chain.activity[0, 0, 0] = 1
    alive = []
    for _ in range(int(20 * fps)):
        alive.append(chain.activity[0, 0].sum())
        chain = advance(model, chain, 1 / fps)
    ended = -np.diff([*alive, 0.0])
    seconds = np.arange(1, len(ended) + 1) / fps
    mean = ended @ seconds
    assert mean == pytest.approx(2.0, rel=1e-3)
    assert np.sqrt(ended @ (seconds - mean) ** 2) == pytest.approx(2.0 / np.sqrt(3), rel=0.01)


def test_the_default_believes_the_recogniser() -> None:
    log_probs, viewpoints = recognised()
    believed = read_streams(StreamBeliefModel.believing(LEARNED.share), log_probs, viewpoints, fps=FPS)
    np.testing.assert_allclose(believed, np.exp(log_probs), atol=1e-9)


def test_what_usually_follows_is_expected_through_a_gap() -> None:
    """After the first activity and a gap, the second is far likelier than the third, though nothing was seen of it."""
    model = replace(LEARNED, follows=((0.0, 0.9, 0.1), (0.5, 0.0, 0.5), (0.5, 0.5, 0.0)), gap_share=(1.0, 1.0, 1.0))
    model = replace(model, view_weights=(0.0,) * 4, kept=1.0)
    belief = StreamBelief(model, fps=FPS)
    belief.start(1)
    share = np.log(np.array(model.share))
    for said in (share + 8.0 * np.eye(4)[0], share + 8.0 * np.eye(4)[3]):
        belief.update(log_softmax(said)[None], np.array([[10.0, 0.0, 1.0]]))
    assert belief.probabilities[0, 3] > 0.9
    for _ in range(6):  # increments of nothing
        belief.update(log_softmax(share + 8.0 * np.eye(4)[3])[None], np.array([[10.0, 0.0, 1.0]]))
    believed = belief.probabilities[0]
    assert believed[1] > 3 * believed[2]
    assert believed[3] < 0.9  # the gap has lasted for a while


@given(seed=st.integers(0, 2**16), sharp=st.floats(0.1, 1e3))
@share_of_examples(0.5)
def test_probabilities_stay_probabilities(seed: int, sharp: float) -> None:
    log_probs, viewpoints = recognised(seed=seed, frames=20)
    believed = read_streams(LEARNED, log_softmax(sharp * log_probs, axis=-1), viewpoints, fps=FPS)
    np.testing.assert_allclose(believed.sum(axis=-1), 1, atol=1e-9)
    assert (believed >= 0).all()


def test_certainty_is_no_end() -> None:
    """A recogniser that excludes classes entirely, and then others, gives a finite belief that follows it."""
    sure = np.full((1, 20, 4), -np.inf)
    sure[0, :10, 0] = sure[0, 10:, 2] = 0.0
    viewpoints = np.tile([10.0, 0.0, 1.0], (1, 20, 1))
    believed = read_streams(LEARNED, sure, viewpoints, fps=FPS)
    assert np.isfinite(believed).all()
    assert believed[0, 9].argmax() == 0 and believed[0, -1].argmax() == 2
    single = OneStreamBelief(LEARNED, fps=FPS)
    for said in sure[0]:
        single.update(said, viewpoints[0, 0])
    np.testing.assert_allclose(single.probabilities, believed[0, -1], atol=1e-9)


def test_streams_do_not_depend_on_each_other_nor_on_the_future() -> None:
    log_probs, viewpoints = recognised()
    believed = read_streams(LEARNED, log_probs, viewpoints, fps=FPS)
    alone = read_streams(LEARNED, log_probs[2:3, :30], viewpoints[2:3, :30], fps=FPS)
    np.testing.assert_allclose(alone[0], believed[2, :30], atol=1e-12)


def test_the_model_is_json() -> None:
    back = parse_json(json.dumps(asdict(LEARNED)), StreamBeliefModel, "here", "a belief in streams")
    assert back == LEARNED


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rates": (1.0, -1.0, 1.0)}, "rates: expected 3 finite numbers from 0 to inf"),
        ({"gap_share": (0.5, 0.5)}, "gap_share: expected 3 finite numbers from 0 to 1"),
        ({"gap_rate": float("nan")}, "gap_rate: expected 1 finite numbers"),
        ({"share": (0.5, 0.5, 0.0, 0.0)}, "share: expected 4 shares above 0 that sum to 1"),
        ({"learned": (0.5, 0.5)}, "learned: expected 4 shares above 0 that sum to 1"),
        ({"follows": ((1.0, 0.0, 0.0),) * 2}, r"3 rows of 3 shares that sum to 1, got \(\(1.0, 0.0, 0.0\), \(1.0"),
        ({"follows": ((1.0, 0.5, 0.0),) * 3}, r"follows: .* that sum to 1, got \(\(1.0, 0.5, 0.0\), \(1.0"),
        ({"kept": 1.5}, "kept: expected 1 finite numbers from 0 to 1"),
        ({"phases": 0}, "phases: expected at least 1, got 0"),
        ({"view_weights": (0.0,)}, "view_weights: expected 4 finite numbers"),
        ({"distances": (10.0, 0.0)}, "distances: expected a half above 0"),
    ],
)
def test_parameters_out_of_range_are_named(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        replace(LEARNED, **changes)


@pytest.mark.parametrize("frames", [1, 7])
def test_what_is_expected_to_come_is_the_mean_of_all_predictions(frames: int) -> None:
    log_probs, viewpoints = recognised()
    belief = StreamBelief(LEARNED, fps=FPS)
    belief.start(len(log_probs))
    for frame in range(log_probs.shape[1]):
        belief.update(log_probs[:, frame], viewpoints[:, frame])
    later, predicted = belief._chain, []
    for _ in range(frames):
        later = advance(LEARNED, later, 1 / FPS)
        predicted.append(later.classes)
    expected = belief.expected(coming_shares(LEARNED, fps=FPS, ends=[frames])[0])
    np.testing.assert_allclose(expected, np.mean(predicted, axis=0), atol=1e-12)
    np.testing.assert_allclose(expected.sum(axis=1), 1)


def test_far_ahead_the_present_activity_says_nothing() -> None:
    shares = coming_shares(LEARNED, fps=FPS, ends=[5000])[0]
    np.testing.assert_allclose(shares, np.broadcast_to(shares[0], shares.shape), atol=0.01)
