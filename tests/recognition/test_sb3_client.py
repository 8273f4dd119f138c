"""A client with nothing of ours: stable-baselines3's A2C and DQN train on `ehar/Grid-v0` with `gym.make` alone."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import A2C, DQN
from stable_baselines3.common.evaluation import evaluate_policy

import ehar  # noqa: F401  which makes the environments known to Gymnasium
from ehar.data.motion_file import load_motion, save_motion
from recognition.calibration import Temperature
from recognition.networks.spec import NetworkSpec
from recognition.storage import recogniser_path, save_recogniser
from tests.helpers.fakes import tiny_data

LENGTH = 8


@pytest.fixture(scope="module")
def chosen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Write tiny data and an untrained recogniser of it, and return what the environment is told."""
    folder = tmp_path_factory.mktemp("client")
    save_motion(folder / "tiny.npz", tiny_data(sequences=24))
    spec = NetworkSpec.of(load_motion(folder / "tiny.npz"), form="causal", size="small", length=LENGTH)
    path = recogniser_path(folder, form="causal", sensor="perfect", views="moving")
    save_recogniser(path, spec.build(), spec, Temperature(), {})
    return {"data": str(folder / "tiny.npz"), "models": str(folder), "length": LENGTH}


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


def test_a2c(chosen: dict[str, Any]) -> None:
    env = gym.make("ehar/Grid-v0", **chosen)
    learnt(A2C("MultiInputPolicy", env, n_steps=5, seed=0, device="cpu"), 300)


def test_dqn(chosen: dict[str, Any]) -> None:
    env = gym.make("ehar/Grid-v0", **chosen)
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
