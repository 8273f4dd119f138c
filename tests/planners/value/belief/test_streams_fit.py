"""What the belief in streams learns from segments, and what it is worth on streams that follow its own chain."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import log_softmax

from ehar.data.scenario import split_parts
from ehar.data.streams.data import NO_ACTIVITY
from ehar.data.streams.file import load_streams
from ehar.errors import DataError
from planners.value.belief.chain import begin, classes_of_states, transition_matrix
from planners.value.belief.filters import read_streams
from planners.value.belief.streams import StreamBeliefModel
from planners.value.belief.streams_fit import (
    fit_evidence,
    learn_chain,
    likeliest_phases,
    likeliest_smoothing,
    spans_of,
)
from recognition.training.frame_weights import frame_weights
from tests.helpers.places import SHARED
from tests.helpers.streams import tiny_streams

FPS = 10.0
TRUE = StreamBeliefModel(
    follows=((0.0, 0.9, 0.1), (0.1, 0.0, 0.9), (0.9, 0.1, 0.0)),
    rates=(0.25, 0.5, 0.33),
    gap_share=(0.9, 0.9, 0.9),
    gap_rate=1.0,
    share=(0.35, 0.2, 0.25, 0.2),
    phases=6,
    gap_phases=3,
)


def watched(*, streams: int = 6, frames: int = 400, seed: int = 0):
    """Return log-probabilities (B, T, 4), viewpoints and labels (B, T) of a leaky, noisy recogniser of TRUE."""
    rng = np.random.default_rng(seed)
    matrix, of_state = transition_matrix(TRUE, 1 / FPS), classes_of_states(TRUE)
    first = np.concatenate([part.ravel() for part in begin(TRUE, 1)])
    labels = np.empty((streams, frames), dtype=np.int64)
    for stream in range(streams):
        state = rng.choice(len(first), p=first)
        for frame in range(frames):
            labels[stream, frame] = of_state[state]
            state = rng.choice(len(first), p=matrix[state])
    viewpoints = rng.uniform((5.0, 0.0, 0.0), (15.0, 6.2, 1.57), size=(streams, 1, 3)).repeat(frames, axis=1)
    said = np.zeros((streams, frames, 4))
    pooled = np.zeros((streams, 4))
    for frame in range(frames):
        pooled = 0.9 * pooled + 0.35 * np.eye(4)[labels[:, frame]] + 0.45 * rng.standard_normal((streams, 4))
        said[:, frame] = log_softmax(pooled + np.log(TRUE.share), axis=-1)
    return said, viewpoints, np.where(labels == 3, NO_ACTIVITY, labels)


def nll(probabilities: np.ndarray, labels: np.ndarray) -> float:
    true = np.where(labels == NO_ACTIVITY, 3, labels)[..., None]
    return float(-np.log(np.take_along_axis(probabilities, true, axis=-1)).mean())


def test_segments_and_gaps_are_counted_within_streams() -> None:
    """By hand, of the two later streams: 40 to 70 with 1 and 0; 70 to 120 with 0, 2 and 1."""
    spans = spans_of(tiny_streams(), np.array([1, 2]))
    assert spans.classes.tolist() == [1, 0, 0, 2, 1]
    assert spans.seconds.tolist() == [1.5, 1.0, 0.4, 1.5, 2.0]
    assert spans.followed.tolist() == [[1, 0], [0, 2], [2, 1]]
    assert spans.gap_after.tolist() == [1, 1, 1]
    assert sorted(spans.gaps.tolist()) == [0.1, 0.5, 1.0]


def test_a_chain_is_counted_and_smoothed() -> None:
    learned = learn_chain(tiny_streams(), np.array([1, 2]), np.array([0]))
    pooled = 6.4 / 5
    assert 1 / learned.rates[0] == pytest.approx((1.4 + pooled) / 3)
    assert 1 / learned.rates[2] == pytest.approx((1.5 + pooled) / 2)
    # Three transitions of three kinds say nothing of what follows: all that is left is how often each activity comes.
    assert learned.follows[0] == pytest.approx((0.4, 0.4, 0.2), abs=1e-3)
    assert learned.gap_share[1] == pytest.approx((1 + 3.5 / 4) / 2)
    assert 1 / learned.gap_rate == pytest.approx((1.6 + 1) / 4)
    assert learned.share[3] == pytest.approx((1.6 + pooled / 4) / (6.4 + 1.6 + pooled))


def test_the_recogniser_expects_what_it_met_as_often_as_it_counted() -> None:
    streams = tiny_streams()
    one, two = (learn_chain(streams, np.array([1, 2]), np.array(known)) for known in ([0], [1, 2]))
    assert two.learned is not None and two.prior == two.learned
    weights = frame_weights(streams, np.array([1, 2]))
    counted = np.array(two.share) * (1.0 if weights is None else weights)
    assert two.learned == pytest.approx((counted / counted.sum()).tolist())
    assert one.share == two.share and one.learned != two.learned
    assert replace(two, learned=None).prior == two.share


@pytest.mark.parametrize("order", [0.9, 0.0])
def test_transitions_are_smoothed_as_much_as_they_are_worth(order: float) -> None:
    usual = np.full(10, 0.1)
    rows = order * np.roll(np.eye(10), 1, axis=1) + (1 - order) * usual
    pairs = np.random.default_rng(0).multinomial(40, rows).astype(float)
    smoothing = likeliest_smoothing(pairs, usual)
    assert smoothing <= 10 if order else smoothing >= 100


@pytest.mark.skipif(not (SHARED / "utkinect.npz").is_file(), reason="needs ../shared/data/utkinect.npz")
def test_the_order_of_real_recordings_is_learned() -> None:
    """Everybody in UTKinect performs the ten activities in the same order, with pauses between them."""
    streams = load_streams(SHARED / "utkinect.npz")
    learned = learn_chain(streams, np.flatnonzero(~streams.is_test), split_parts(streams).recogniser)
    assert np.argmax(learned.follows[:6], axis=1).tolist() == [1, 2, 3, 4, 5, 6]
    assert min(learned.gap_share) > 0.7
    assert learned.phases > 1  # durations are no geometric ones


def test_durations_that_come_twice_each_do_not_seem_to_vary_less_than_they_do() -> None:
    """Durations without a memory have one phase; beside means that they are half of, they seem to have more."""
    classes = np.tile(np.arange(20), 2)
    frames = np.ceil(np.random.default_rng(2).exponential(20, len(classes))).astype(int)
    ends = np.cumsum(frames)
    tiny = tiny_streams()
    streams = replace(
        tiny,
        class_names=tuple(f"class {number}" for number in range(20)),
        positions=np.resize(tiny.positions, (ends[-1], *tiny.positions.shape[1:])),
        missing=np.zeros(ends[-1], dtype=bool),
        offsets=np.array([0, ends[-1]]),
        segments=np.column_stack([ends - frames, ends, classes]),
        sequence_names=tiny.sequence_names[:1],
        subjects=tiny.subjects[:1],
        is_test=None,
    )
    learned = learn_chain(streams, np.array([0]), np.array([0]))
    spans = spans_of(streams, np.array([0]))
    assert likeliest_phases(spans.seconds, 1 / np.array(learned.rates)[spans.classes], streams.fps) > 1
    assert learned.phases == 1


def test_a_class_that_never_comes_is_refused() -> None:
    with pytest.raises(
        DataError, match=r"tiny: expected segments of every class in the 1 streams .* got none of 'c', 'd'"
    ):
        learn_chain(replace(tiny_streams(), class_names=("a", "b", "c", "d")), np.array([1]), np.array([0]))


def test_streams_without_a_gap_are_learned_from() -> None:
    streams = tiny_streams()
    whole = replace(streams, segments=np.array([[40, 50, 0], [50, 60, 1], [60, 70, 2]]))
    learned = learn_chain(whole, np.array([1]), np.array([1]))
    assert learned.gap_rate == 1.0 and learned.gap_phases == 1
    assert max(learned.gap_share) < 0.3


@pytest.mark.parametrize("phases", [1, 3, 8])
def test_the_number_of_phases_is_found(phases: int) -> None:
    means = np.random.default_rng(1).uniform(1, 5, 3000)
    drawn = np.random.default_rng(0).gamma(phases, means / phases)
    assert likeliest_phases(drawn, means, 1000.0) == phases


@pytest.mark.parametrize("fps", [8.0, 15.0, 25.0])
def test_phases_are_those_of_the_chain_at_its_frame_rate(fps: float) -> None:
    """A phase is left at frames alone, so that few phases of a few frames each vary as little as many would."""
    rng, mean = np.random.default_rng(0), 0.53
    frames = 4 + rng.negative_binomial(4, 4 / (mean * fps), 3000)  # 4 phases, each left with this probability
    assert likeliest_phases(frames / fps, np.full(3000, mean), fps) == 4


def test_a_phase_is_no_shorter_than_a_frame() -> None:
    assert likeliest_phases(np.full(100, 0.5), np.full(100, 0.5), 8.0) == 3  # 4 of 4 frames could not vary


def test_each_part_is_worth_something_where_it_is_true() -> None:
    fitted = fit_evidence(TRUE, *watched(), fps=FPS)
    log_probs, viewpoints, labels = watched(seed=1)

    def score(model: StreamBeliefModel) -> float:
        return nll(read_streams(model, log_probs, viewpoints, fps=FPS), labels)

    full, recogniser = score(fitted), nll(np.exp(log_probs), labels)
    assert full < recogniser - 0.1
    for part in (fitted.without_transitions(), fitted.without_durations()):
        again = fit_evidence(part, *watched(), fps=FPS)
        assert full < score(again) - 0.01
    outputs_as_evidence = score(replace(fitted, kept=0.0))
    assert full < outputs_as_evidence - 0.1


def test_the_fit_is_the_same_twice_and_leaves_the_viewpoint_out_when_told() -> None:
    held = watched(streams=2, frames=60)
    once, again = (fit_evidence(TRUE, *held, fps=FPS, viewpoint=False) for _ in range(2))
    assert once == again
    assert once.view_weights[1:] == (0.0, 0.0, 0.0) and once.view_weights[0] != 0
    assert once.follows == TRUE.follows and once.rates == TRUE.rates


def test_what_does_not_fit_together_is_refused() -> None:
    log_probs, viewpoints, labels = watched(streams=2, frames=5)
    with pytest.raises(DataError, match=r"expected at least one stream, log_probs \(2, 5, 4\) .* got \(2, 5, 3\)"):
        fit_evidence(TRUE, log_probs[..., :3], viewpoints, labels, fps=FPS)
