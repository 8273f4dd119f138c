"""Behaviour cloning: its losses by hand, and that it imitates an oracle that is known."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ehar.arrays import FloatArray
from ehar.errors import ModelError
from planners.agents.config import ImitationSetting, Labels
from planners.agents.demonstrations import Demonstrations
from planners.agents.imitation import clone, expected_loss
from planners.agents.inputs import POSITION, RECOGNITION, VISION
from planners.agents.network import AgentNetwork
from tests.helpers.agent_worlds import weights
from tests.helpers.made_demonstrations import LEVEL, demonstrated, fresh

SETTING = ImitationSetting(epochs=8, batch=64, learning_rate=3e-3)


def best_moves(network: AgentNetwork, demonstrations: Demonstrations) -> FloatArray:
    inputs = {name: torch.from_numpy(values).float() for name, values in demonstrations.inputs.items()}
    with torch.no_grad():
        moves: FloatArray = network.logits(network.state(inputs)).argmax(dim=1).numpy()
    return moves


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("labels", ["best", "soft"])
def test_it_imitates_an_oracle_that_is_known(labels: Labels, seed: int) -> None:
    """On frames that it was not shown, but for those where the oracle itself hardly cares."""
    network = fresh(seed=seed)
    history = clone(network, demonstrated(), replace(SETTING, labels=labels, entropy=0.3), seed=seed)
    unseen = demonstrated(seed=1)
    cares = np.abs(unseen.position[:, 3] - LEVEL) > 0.1
    agreement = (best_moves(network, unseen) == unseen.values.argmax(axis=1))[cares].mean()
    assert agreement > 0.97
    assert (best_moves(fresh(), unseen) == unseen.values.argmax(axis=1))[cares].mean() < 0.7
    assert len(history) == SETTING.epochs
    assert history[-1]["agreement"] > 0.9
    assert history[-1]["loss"] < history[0]["loss"]


def test_the_first_loss_with_best_moves_is_that_of_a_uniform_policy() -> None:
    history = clone(fresh(), demonstrated(), replace(SETTING, labels="best", learning_rate=0.0, epochs=1), seed=0)
    assert history[0]["loss"] == pytest.approx(np.log(7), abs=0.01)


def test_the_expected_loss_by_hand() -> None:
    policy = np.array([[0.5, 0.2, 0.1, 0.1, 0.05, 0.03, 0.02], [1 / 7] * 7])
    advantage = np.array([[1.0, -1.0, 0.5, 0, 0, 0, -0.5], [3.0, 0, 0, 0, 0, 0, -3.0]])
    # the first expects 0.5 - 0.2 + 0.05 - 0.01 = 0.34, the second nothing; the entropies are weighted by 0.1
    entropy = [-sum(p * np.log(p) for p in row) for row in policy]
    expected = np.mean([-0.34 - 0.1 * entropy[0], -0.1 * entropy[1]])
    loss = expected_loss(torch.from_numpy(np.log(policy) + 2.0), torch.from_numpy(advantage), 0.1)
    assert float(loss) == pytest.approx(expected)


@pytest.mark.parametrize("entropy", [0.1, 1.0])
def test_the_expected_loss_is_least_at_a_softmax(entropy: float) -> None:
    """Where teachers disagree in what cannot be seen, of the mean of what they say."""
    rng = np.random.default_rng(0)
    advantage = torch.from_numpy(rng.normal(size=(4, 7)))  # four teachers of one frame
    best = (advantage.mean(dim=0) / entropy).repeat(4, 1).requires_grad_()
    least = expected_loss(best, advantage, entropy)
    (gradient,) = torch.autograd.grad(least, best)
    np.testing.assert_allclose(gradient.sum(dim=0), 0, atol=1e-12)
    for _ in range(100):
        other = best.detach() + torch.from_numpy(rng.normal(size=7, scale=rng.uniform(0.1, 3)))
        assert float(expected_loss(other, advantage, entropy)) > float(least.detach())


def test_soft_labels_weigh_a_frame_by_how_much_is_at_stake() -> None:
    """Nine frames like one move a little, the tenth, which looks alike, dislikes it a lot."""
    same = demonstrated(1)
    values = np.zeros((10, 7))
    values[:9, 2] = 0.1
    values[9, 2] = -5.0
    values[9, 3] = 1.0
    alike = {name: seen.repeat(100, axis=0) for name, seen in same.inputs.items()}
    ten = Demonstrations(**alike, values=np.tile(values, (10, 1)))
    chosen = {}
    labels: Labels
    for labels in ("best", "soft"):
        network = fresh()
        clone(network, ten, replace(SETTING, labels=labels, epochs=60), seed=0)
        chosen[labels] = int(best_moves(network, same)[0])
    assert chosen == {"best": 2, "soft": 3}


def test_the_scale_of_what_moves_are_worth_does_not_matter_nor_what_they_share() -> None:
    shown = demonstrated(256)
    other = replace(shown, values=8 * shown.values + np.arange(256)[:, None])
    cloned = []
    for demonstrations in (shown, other):
        network = fresh()
        history = clone(network, demonstrations, replace(SETTING, epochs=2), seed=0)
        cloned.append(history[-1]["loss"])
    assert cloned[0] == pytest.approx(cloned[1], rel=1e-3)


def test_the_critic_is_left_as_it_is() -> None:
    network = fresh(hindsight=5)
    before = {name: values.clone() for name, values in network.state_dict().items()}
    clone(network, demonstrated(256), SETTING, seed=0)
    for name, values in network.state_dict().items():
        assert torch.equal(values, before[name]) == name.startswith("critic."), name


@pytest.mark.parametrize("labels", ["best", "soft"])
def test_the_seed_decides(labels: Labels) -> None:
    cloned = []
    for seed in (0, 0, 1):
        network = fresh()
        torch.rand(3)
        clone(network, demonstrated(500), replace(SETTING, labels=labels, epochs=2), seed=seed)
        cloned.append(weights(network))
    assert cloned[0] == cloned[1] != cloned[2]


def test_fewer_frames_than_a_batch() -> None:
    network = fresh()
    history = clone(network, demonstrated(5), replace(SETTING, epochs=3), seed=0)
    assert len(history) == 3
    assert weights(network) != weights(fresh())


@pytest.mark.parametrize("labels", ["best", "soft"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_worth_that_is_not_finite(labels: Labels, bad: float) -> None:
    shown = demonstrated(200)
    shown.values[123, 3] = bad
    first = np.random.default_rng(0).permutation(200)
    step = next(i for i, rows in enumerate(np.array_split(first, 3)) if 123 in rows)
    named = step if labels == "best" else 0  # soft labels are scaled by all of them
    with pytest.raises(ModelError, match=rf"^imitation: .*at step {named}\b"):
        clone(fresh(), shown, replace(SETTING, labels=labels), seed=0)


@pytest.mark.parametrize("name", [RECOGNITION, VISION, POSITION])
def test_inputs_that_are_not_finite(name: str) -> None:
    shown = demonstrated(200)
    shown.inputs[name][:, 1] = np.nan
    with pytest.raises(ModelError, match="imitation: the loss is nan at step 0: expected a finite one"):
        clone(fresh(), shown, SETTING, seed=0)
