"""A client with nothing of ours: stable-baselines3's A2C and DQN train on `ehar/Grid-v0` with `gym.make` alone."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import A2C, DQN
from stable_baselines3.common.evaluation import evaluate_policy

import recognition  # noqa: F401  which makes the environments known to Gymnasium
from ehar.conditions import Conditions
from tests.helpers.random_networks import save_random_world
from tests.helpers.settings import tiny_conditions

LENGTH = 8


@pytest.fixture(scope="module")
def conditions(tmp_path_factory: pytest.TempPathFactory) -> Conditions:
    """Write tiny data and an untrained recogniser of it, and return what the environment is told."""
    folder = tmp_path_factory.mktemp("client")
    save_random_world(folder, LENGTH)
    return tiny_conditions(folder, length=LENGTH, part="policy")


def learnt(model: Any, steps: int) -> None:
    """Let it learn, and check that it did: every step was taken, weights changed, and all are finite."""
    before = {name: values.clone() for name, values in model.policy.state_dict().items()}
    model.learn(steps)
    assert model.num_timesteps == steps
    after = model.policy.state_dict()
    assert all(bool(values.isfinite().all()) for values in after.values())
    assert any(not torch.equal(values, before[name]) for name, values in after.items())
    episodes = model.ep_info_buffer
    assert len(episodes) == steps // (LENGTH - 1)
    assert {episode["l"] for episode in episodes} == {LENGTH - 1}
    returns, lengths = evaluate_policy(model, model.get_env(), n_eval_episodes=3, return_episode_rewards=True)
    assert lengths == [LENGTH - 1] * 3
    assert np.isfinite(returns).all()


def test_a2c(conditions: Conditions) -> None:
    env = gym.make("ehar/Grid-v0", conditions=conditions)
    learnt(A2C("MultiInputPolicy", env, n_steps=5, seed=0, device="cpu"), 300)


def test_dqn(conditions: Conditions) -> None:
    env = gym.make("ehar/Grid-v0", conditions=conditions)
    model = DQN("MultiInputPolicy", env, learning_starts=50, buffer_size=300, seed=0, device="cpu")
    learnt(model, 300)


@pytest.mark.slow
def test_with_no_argument_at_all() -> None:
    """The default is the shipped data and recogniser, in episodes of 60 frames."""
    model = A2C("MultiInputPolicy", gym.make("ehar/Grid-v0"), seed=0, device="cpu")
    model.learn(120)
    assert model.num_timesteps == 120
    assert model.ep_info_buffer is not None
    assert [episode["l"] for episode in model.ep_info_buffer] == [59, 59]
    assert all(bool(values.isfinite().all()) for values in model.policy.state_dict().values())
