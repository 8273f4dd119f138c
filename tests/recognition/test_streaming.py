"""The numpy contract of both recognisers: what `ehar.recogniser` promises, and the network behind it."""

from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from ehar.camera import Camera
from ehar.data.skeleton_tree import parents
from ehar.recogniser import Recognition
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.sensor import Sensed, SensorNoise, draw_noise
from ehar.world import PAPER
from recognition.calibration import KNOTS, Temperature
from recognition.networks.causal import CausalCTRGCN
from recognition.networks.ctrgcn import CTRGCN
from recognition.networks.features import features, with_view
from recognition.networks.spec import NetworkSpec
from recognition.streaming import PrefixRecogniser, StreamingRecogniser
from tests.helpers.fakes import POSE, tiny_batch, tiny_data
from tests.helpers.random_networks import randomised

EPISODES, LENGTH, FORKS, PERSONS = 3, 8, 7, 2
TEMPERATURE = Temperature((1.0, 0.5, 0.0, -0.2, 0.3))
TrainedRecogniser = StreamingRecogniser | PrefixRecogniser


@pytest.fixture(scope="module", params=["causal", "ctrgcn"])
def recogniser(request: pytest.FixtureRequest) -> TrainedRecogniser:
    spec = NetworkSpec.of(tiny_data(persons=PERSONS), form=request.param, size="small", length=LENGTH)
    network = spec.build()
    randomised(network)
    if isinstance(network, CausalCTRGCN):
        return StreamingRecogniser(network=network, spec=spec, temperature=TEMPERATURE, sha256="0")
    return PrefixRecogniser(network=network, spec=spec, temperature=TEMPERATURE, sha256="0")


@pytest.fixture(scope="module")
def frames() -> list[tuple[Sensed, np.ndarray]]:
    """Return LENGTH frames of what a camera that jumps about senses."""
    rng = np.random.default_rng(0)
    batch = tiny_batch(episodes=EPISODES, length=LENGTH, persons=PERSONS)
    viewpoints = PAPER.sample_starts(rng, EPISODES * LENGTH).reshape(LENGTH, EPISODES, 3)
    sensor = PerfectSensor()
    return [
        (sensor.sense(batch.positions[:, t], viewpoints[t], batch.noise.frame(t)), viewpoints[t]) for t in range(LENGTH)
    ]


@pytest.fixture(scope="module")
def candidates() -> list[tuple[Sensed, np.ndarray]]:
    """Return 3 frames from FORKS viewpoints an episode."""
    rng = np.random.default_rng(1)
    positions = POSE + 0.1 * rng.standard_normal((3, EPISODES, 1, PERSONS, len(POSE), 3)).astype(np.float32)
    viewpoints = PAPER.sample_starts(rng, 3 * EPISODES * FORKS).reshape(3, EPISODES, FORKS, 3)
    noise: SensorNoise = draw_noise(rng, (EPISODES, 1), PERSONS, len(POSE))
    return [(PerfectSensor().sense(positions[t], viewpoints[t], noise), viewpoints[t]) for t in range(3)]


def take(recogniser: TrainedRecogniser, state: Any, frames: list[tuple[Sensed, np.ndarray]]) -> tuple[Recognition, Any]:
    for sensed, viewpoint in frames:
        recognition, state = recogniser.step(state, sensed, viewpoint)
    return recognition, state


def alternative(frames: list[tuple[Sensed, np.ndarray]], choice: np.ndarray) -> list[tuple[Sensed, np.ndarray]]:
    """Return what the chosen forks (B,) saw."""
    rows = np.arange(EPISODES)
    return [(Sensed(*(array[rows, choice] for array in sensed)), view[rows, choice]) for sensed, view in frames]


def assert_same(actual: Recognition, expected: Recognition) -> None:
    for mine, theirs in zip(actual, expected, strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-5, rtol=1e-5)


def seen(frames: list[tuple[Sensed, np.ndarray]]) -> Tensor:
    """Return the features (B, T, P, J, C) of frames."""
    joint_parents = torch.from_numpy(parents(tiny_data().skeleton))
    return torch.stack(
        [
            features(
                torch.from_numpy(sensed.joints_2d),
                torch.from_numpy(sensed.confidence),
                torch.from_numpy(viewpoint[:, 0]).float(),
                joint_parents,
                Camera(),
            )
            for sensed, viewpoint in frames
        ],
        dim=1,
    )


def test_probabilities_and_embeddings_at_every_frame(recogniser: TrainedRecogniser, frames: Any) -> None:
    assert recogniser.class_names == tiny_data().class_names
    state = recogniser.start(EPISODES)
    for sensed, viewpoint in frames:
        recognition, state = recogniser.step(state, sensed, viewpoint)
        assert recognition.log_probs.shape == (EPISODES, len(recogniser.class_names))
        assert recognition.embedding.shape == (EPISODES, recogniser.embedding_size)
        assert recognition.log_probs.dtype == recognition.embedding.dtype == np.float32
        np.testing.assert_allclose(np.exp(recognition.log_probs).sum(axis=-1), 1, atol=1e-5)


def test_every_step_is_the_calibrated_network_on_the_prefix(recogniser: TrainedRecogniser, frames: Any) -> None:
    state = recogniser.start(EPISODES)
    network = randomised(recogniser.spec.build())
    for count in range(1, LENGTH + 1):
        recognition, state = recogniser.step(state, *frames[count - 1])
        prefix = seen(frames[:count])
        with torch.inference_mode():
            if isinstance(network, CTRGCN):
                logits = network(prefix.permute(0, 4, 1, 3, 2))
            else:
                viewpoints = torch.stack(
                    [torch.from_numpy(viewpoint).float() for _, viewpoint in frames[:count]], dim=1
                )
                logits = network(with_view(prefix, viewpoints))[:, -1]
        temperature = np.exp(np.interp(count / LENGTH, KNOTS, TEMPERATURE.log_temperatures))
        expected = torch.log_softmax(logits / temperature, dim=-1).numpy()
        np.testing.assert_allclose(recognition.log_probs, expected, atol=1e-5)
        assert (
            np.ptp(recognition.log_probs, axis=0).max() > 1e-3
        )  # the episodes differ: there is something to get wrong


def test_beyond_the_trained_length_the_last_temperature_holds(recogniser: TrainedRecogniser, frames: Any) -> None:
    recognition, _ = take(recogniser, recogniser.start(EPISODES), [*frames, *frames[:3]])
    np.testing.assert_allclose(np.exp(recognition.log_probs).sum(axis=-1), 1, atol=1e-5)


def test_forked_arrays_and_the_chosen_alternative(
    recogniser: TrainedRecogniser, frames: Any, candidates: list[tuple[Sensed, np.ndarray]]
) -> None:
    choice = np.array([6, 0, 2])
    _, state = take(recogniser, recogniser.start(EPISODES), frames[:2])
    forked, after = take(recogniser, state.fork(FORKS), candidates)  # several forked frames
    assert forked.log_probs.shape == (EPISODES, FORKS, len(recogniser.class_names))
    assert forked.embedding.shape == (EPISODES, FORKS, recogniser.embedding_size)
    np.testing.assert_allclose(np.exp(forked.log_probs).sum(axis=-1), 1, atol=1e-5)
    alone, alone_after = take(recogniser, state, alternative(candidates, choice))
    assert_same(Recognition(*(array[np.arange(EPISODES), choice] for array in forked)), alone)
    assert_same(
        take(recogniser, after.select(choice), frames[2:])[0],
        take(recogniser, alone_after, frames[2:])[0],
    )


def test_one_alternative_is_a_fork_too(recogniser: TrainedRecogniser, frames: Any) -> None:
    _, state = take(recogniser, recogniser.start(EPISODES), frames[:2])
    alone, alone_after = take(recogniser, state, frames[2:4])
    one = [(Sensed(*(array[:, None] for array in sensed)), view[:, None]) for sensed, view in frames[2:4]]
    forked, after = take(recogniser, state.fork(1), one)
    assert_same(Recognition(*(array[:, 0] for array in forked)), alone)
    selected = after.select(np.zeros(EPISODES, dtype=np.int64))
    assert_same(take(recogniser, selected, frames[4:])[0], take(recogniser, alone_after, frames[4:])[0])


def test_a_fork_that_took_no_frame_selects_to_what_it_was(recogniser: TrainedRecogniser, frames: Any) -> None:
    _, state = take(recogniser, recogniser.start(EPISODES), frames[:3])
    selected = state.fork(FORKS).select(np.array([0, 3, 6]))
    assert_same(take(recogniser, selected, frames[3:])[0], take(recogniser, state, frames[3:])[0])


def test_reset_episodes_begin_anew_and_the_others_go_on(recogniser: TrainedRecogniser, frames: Any) -> None:
    mask = np.array([True, False, True])
    _, before = take(recogniser, recogniser.start(EPISODES), frames[:3])
    state = before.reset(mask)
    fresh = recogniser.start(EPISODES)
    for frame in frames[3:]:
        recognition, state = recogniser.step(state, *frame)
        anew, fresh = recogniser.step(fresh, *frame)
        onwards, before = recogniser.step(before, *frame)
        for mine, new, old in zip(recognition, anew, onwards, strict=True):
            np.testing.assert_allclose(mine[mask], new[mask], atol=1e-5)
            np.testing.assert_allclose(mine[~mask], old[~mask], atol=1e-5)


def test_forks_after_a_reset(recogniser: TrainedRecogniser, frames: Any, candidates: Any) -> None:
    choice = np.array([1, 5, 3])
    _, before = take(recogniser, recogniser.start(EPISODES), frames[:3])
    state = before.reset(np.array([False, True, False]))
    forked, _ = take(recogniser, state.fork(FORKS), candidates[:2])
    alone, _ = take(recogniser, state, alternative(candidates[:2], choice))
    assert_same(Recognition(*(array[np.arange(EPISODES), choice] for array in forked)), alone)


def test_a_state_stays_valid(recogniser: TrainedRecogniser, frames: Any) -> None:
    _, state = take(recogniser, recogniser.start(EPISODES), frames[:4])
    first, _ = recogniser.step(state, *frames[4])
    take(recogniser, state.reset(np.ones(EPISODES, dtype=bool)), frames[:4])
    again, _ = recogniser.step(state, *frames[4])
    np.testing.assert_array_equal(first.log_probs, again.log_probs)


def test_the_size_of_pieces_changes_nothing(frames: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = NetworkSpec.of(tiny_data(persons=PERSONS), form="ctrgcn", size="half", length=LENGTH)
    network = spec.build()
    randomised(network)
    assert isinstance(network, CTRGCN)
    half = PrefixRecogniser(network=network, spec=spec, temperature=TEMPERATURE, sha256="0")
    found = []
    for frames_at_once in (1, 10**9):  # clip by clip, and all clips at once
        monkeypatch.setattr("recognition.streaming.FRAMES_AT_ONCE", frames_at_once)
        state, seen = half.start(EPISODES), []
        for sensed, viewpoint in frames:
            recognition, state = half.step(state, sensed, viewpoint)
            seen.append(np.concatenate(recognition, axis=-1))
        found.append(np.stack(seen))
    np.testing.assert_allclose(found[0], found[1], atol=1e-4)
    assert found[0].shape == (LENGTH, EPISODES, len(half.class_names) + 128)
