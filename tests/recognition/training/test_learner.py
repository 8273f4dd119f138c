"""A learner's recorded steps on a GPU; where there is no GPU this is skipped."""

import numpy as np
import pytest
import torch

from recognition.networks.spec import build_network
from recognition.training.clips import Clips
from recognition.training.learner import Learner
from tests.helpers.fakes import tiny_data

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no GPU here")


def learner() -> Learner:
    data = tiny_data()
    network = build_network(
        "causal",
        "small",
        classes=3,
        channels=10,
        skeleton=data.skeleton,
        persons=data.persons,
        dropout=0.2,
        seed=0,
    )
    return Learner(
        network.to("cuda"),
        optimiser="adamw",
        learning_rate=3e-3,
        weight_decay=0.02,
        batch=4,
        class_weights=np.array([1.0, 2.0, 0.5]),
    )


def clips(seed: int) -> Clips:
    rng = np.random.default_rng(seed)
    data = tiny_data()
    features = rng.normal(size=(4, 12, data.persons, len(data.skeleton.joint_names), 10)).astype(np.float32)
    labels = rng.integers(3, size=4)
    return Clips(torch.from_numpy(features), torch.from_numpy(labels), np.zeros(4, np.int64), np.zeros((4, 12, 3)))


def test_a_gpu_learns_from_recorded_steps_as_it_does_from_steps_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    recorded, plain = learner(), learner()

    def one_by_one(batch: Clips, rng: np.random.Generator) -> float:
        return float(plain._backward(batch.features.to("cuda"), batch.frame_labels.to("cuda")))

    monkeypatch.setattr(plain, "_find_gradients", one_by_one)
    losses = np.array(
        [
            [one.learn(clips(step), np.random.default_rng(step), step=step, steps=1) for one in (recorded, plain)]
            for step in range(12)
        ]
    )
    np.testing.assert_allclose(losses[:, 0], losses[:, 1], rtol=1e-3)
    assert losses[-1, 0] != losses[0, 0]
