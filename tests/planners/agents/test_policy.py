"""The agent's network as stable-baselines3 trains it: advantages and returns against a slow loop, moves and values."""

from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from torch import Tensor

from ehar.errors import ModelError
from planners.agents.episode_groups import HINDSIGHT
from planners.agents.inputs import ENCODED
from planners.agents.network import AgentNetwork
from planners.agents.policy import AgentPolicy
from planners.agents.vector_env import AgentVecEnv
from tests.helpers.agent_worlds import LENGTH, tiny_maker
from tests.helpers.agents import untrained_network

HINTS = 5  # 3 classes, the label's probability, and whether it is on top


def policy_of(network: AgentNetwork, *, seed: int = 0) -> AgentPolicy:
    env = AgentVecEnv(tiny_maker(), num_envs=2, seed=0)
    generator = torch.Generator().manual_seed(seed)
    return AgentPolicy(env.observation_space, spaces.Discrete(7), lambda _: 1e-3, network=network, generator=generator)


def observed(episodes: int = 64) -> dict[str, Tensor]:
    shown: Any = AgentVecEnv(tiny_maker(), num_envs=episodes, seed=1).reset()
    return {name: torch.from_numpy(values) for name, values in shown.items()}


class Watch(BaseCallback):
    """Keeps what was rewarded, and what ended."""

    def __init__(self) -> None:
        super().__init__()
        self.rewards: list[Any] = []
        self.dones: list[Any] = []

    def _on_step(self) -> bool:
        self.rewards.append(self.locals["rewards"].copy())
        self.dones.append(self.locals["dones"].copy())
        return True


@pytest.mark.parametrize("steps", [LENGTH - 1, LENGTH + 3, 5])
@pytest.mark.parametrize("hindsight", [0, HINTS])
def test_advantages_and_returns_by_a_slow_loop(steps: int, hindsight: int) -> None:
    """Rollouts of one episode, of one and a part of the next, and of a part: nothing flows past an episode's end."""
    gamma, trace, num_envs = 0.9, 0.7, 4
    env = AgentVecEnv(tiny_maker(), num_envs=num_envs, seed=2)
    model = PPO(
        AgentPolicy,
        env,
        n_steps=steps,
        batch_size=steps,
        gamma=gamma,
        gae_lambda=trace,
        policy_kwargs={
            "network": untrained_network(hindsight=hindsight),
            "generator": torch.Generator().manual_seed(4),
        },
        device="cpu",
    )
    watch = Watch()
    _, callback = model._setup_learn(steps * num_envs, watch)
    assert model.collect_rollouts(env, callback, model.rollout_buffer, steps)
    buffer = model.rollout_buffer
    with torch.no_grad():
        after = {name: torch.from_numpy(values) for name, values in model._last_obs.items()}  # type: ignore[union-attr]
        values = np.concatenate([buffer.values, model.policy.predict_values(after).numpy().T])
    rewards, dones = np.stack(watch.rewards), np.stack(watch.dones)
    assert dones.any() == (steps >= LENGTH - 1)
    for i in range(num_envs):
        for t in range(steps):
            advantage, weight = 0.0, 1.0
            for later in range(t, steps):
                beyond = 0.0 if dones[later, i] else values[later + 1, i]
                advantage += weight * (rewards[later, i] + gamma * beyond - values[later, i])
                weight *= gamma * trace
                if dones[later, i]:
                    break
            assert buffer.advantages[t, i] == pytest.approx(advantage, abs=1e-5)
            assert buffer.returns[t, i] == pytest.approx(advantage + values[t, i], abs=1e-5)
    # What is learned from is what was seen, and what was drawn there.
    seen = {name: torch.from_numpy(kept.reshape(steps * num_envs, -1)) for name, kept in buffer.observations.items()}  # type: ignore[attr-defined]
    moves = torch.from_numpy(buffer.actions.reshape(-1))
    with torch.no_grad():
        again, log_probs, _ = model.policy.evaluate_actions(seen, moves)
    np.testing.assert_allclose(again[:, 0], buffer.values.ravel(), atol=1e-5)
    np.testing.assert_allclose(log_probs, buffer.log_probs.ravel(), atol=1e-5)


def test_log_probabilities_entropies_and_values_are_the_network_s() -> None:
    network, seen = untrained_network(), observed()
    policy = policy_of(network)
    with torch.no_grad():
        moves, values, log_probs = policy(seen)
        state = network.state(seen)
        probabilities = torch.softmax(network.logits(state), dim=1)
        again, judged, entropy = policy.evaluate_actions(seen, moves.float())
    np.testing.assert_allclose(log_probs, np.log([p[m] for p, m in zip(probabilities, moves, strict=True)]), atol=1e-5)
    np.testing.assert_allclose(judged, log_probs, atol=1e-6)
    assert entropy is not None
    np.testing.assert_allclose(entropy, -(probabilities * probabilities.log()).sum(dim=1), atol=1e-5)
    np.testing.assert_allclose(values[:, 0], network.value(state).detach(), atol=1e-6)
    np.testing.assert_allclose(again, values, atol=1e-6)
    np.testing.assert_allclose(policy.predict_values(seen).detach(), values, atol=1e-6)
    distribution: Any = policy.get_distribution(seen).distribution
    np.testing.assert_allclose(distribution.probs.detach(), probabilities, atol=1e-6)


def test_moves_are_drawn_as_probable_as_they_are() -> None:
    network, seen = untrained_network(), observed(1)
    many = {name: values.repeat(20_000, 1) for name, values in seen.items()}
    with torch.no_grad():
        moves = policy_of(network)(many)[0]
        probabilities = torch.softmax(network.logits(network.state(seen)), dim=1)[0]
    shares = np.bincount(moves, minlength=7) / len(moves)
    np.testing.assert_allclose(shares, probabilities, atol=0.015)  # 4 standard errors of a half


def test_the_generator_alone_decides_what_is_drawn() -> None:
    seen = observed()
    with torch.no_grad():
        drawn = []
        for seed in (0, 0, 1):
            torch.rand(1)  # another global state
            drawn.append(policy_of(untrained_network(), seed=seed)(seen)[0])
    assert torch.equal(drawn[0], drawn[1])
    assert not torch.equal(drawn[0], drawn[2])


def test_the_best_moves() -> None:
    network, seen = untrained_network(), observed()
    with torch.no_grad():
        best = network.logits(network.state(seen)).argmax(dim=1)
    policy = policy_of(network)
    assert torch.equal(policy(seen, deterministic=True)[0], best)
    as_arrays = {name: values.numpy() for name, values in seen.items()}
    np.testing.assert_array_equal(policy.predict(as_arrays, deterministic=True)[0], best)


def test_what_is_trained_is_the_network_that_was_given() -> None:
    network = untrained_network(hindsight=HINTS)
    policy = policy_of(network)
    trained = {id(weight) for group in policy.optimizer.param_groups for weight in group["params"]}
    assert trained == {id(weight) for weight in network.parameters()}
    assert {id(weight) for weight in policy.parameters()} == trained


def test_a_critic_with_hindsight_teaches_the_state_nothing_and_one_without_does() -> None:
    seen = observed()
    for hindsight in (0, HINTS):
        network = untrained_network(hindsight=hindsight)
        policy_of(network).predict_values(seen).sum().backward()  # type: ignore[no-untyped-call]
        of_critic = [weight.grad for weight in network.critic.parameters()]
        assert all(gradient is not None and bool(gradient.any()) for gradient in of_critic)
        taught = any(weight.grad is not None for weight in network.encoders.parameters())
        assert taught == (hindsight == 0)


def test_the_actor_is_shown_no_hindsight() -> None:
    network, seen = untrained_network(hindsight=HINTS), observed()
    policy = policy_of(network)
    other = seen | {HINDSIGHT: torch.rand(64, HINTS)}
    with torch.no_grad():
        assert torch.equal(policy(seen, deterministic=True)[2], policy(other, deterministic=True)[2])
        assert not torch.equal(policy.predict_values(seen), policy.predict_values(other))
        for name in ENCODED:
            blind = seen | {name: torch.zeros_like(seen[name])}
            assert not torch.equal(policy(seen, deterministic=True)[2], policy(blind, deterministic=True)[2])


def test_probabilities_that_are_not_finite() -> None:
    network = untrained_network()
    with torch.no_grad():
        network.actor.bias[3] = torch.nan
        with pytest.raises(ModelError, match="policy: expected finite probabilities of the moves"):
            policy_of(network)(observed())
