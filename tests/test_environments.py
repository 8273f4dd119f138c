"""`ehar/Grid-v0` by its name, with a network of random weights."""

import warnings
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from fakes import tiny_data
from gymnasium.utils.env_checker import check_env

from ehar.env import GridVectorEnv
from ehar.errors import DataError, ModelError, UsageError
from ehar.motion_file import load_motion, save_motion
from recognition.calibration import Temperature
from recognition.environments import grid_env
from recognition.networks import NetworkSpec
from recognition.storage import recogniser_path, save_recogniser

LENGTH = 10


@pytest.fixture(scope="module")
def chosen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Write tiny data and an untrained recogniser of it, and return what the environment is told."""
    torch.set_num_threads(1)
    folder = tmp_path_factory.mktemp("grid")
    save_motion(folder / "tiny.npz", tiny_data(sequences=24))
    spec = NetworkSpec.of(load_motion(folder / "tiny.npz"), form="causal", size="small", length=LENGTH)
    path = recogniser_path(folder, form="causal", sensor="perfect", views="moving")
    save_recogniser(path, spec.build(), spec, Temperature(), {})
    return {"data": str(folder / "tiny.npz"), "models": str(folder), "length": LENGTH}


def test_the_single_environment_by_its_name(chosen: dict[str, Any]) -> None:
    env = gym.make("ehar/Grid-v0", **chosen)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of embeddings without bounds
        check_env(env.unwrapped)
    env.reset(seed=0)
    for _ in range(LENGTH - 1):
        _, _, terminated, _, _ = env.step(env.action_space.sample())
    assert terminated


def test_the_batched_environment_by_its_name(chosen: dict[str, Any]) -> None:
    env = gym.make_vec("ehar/Grid-v0", num_envs=8, vectorization_mode="vector_entry_point", **chosen)
    assert isinstance(env.unwrapped, GridVectorEnv)
    observations, _ = env.reset(seed=0)
    assert observations in env.observation_space
    for _ in range(LENGTH + 3):
        observations, _, _, _, _ = env.step(env.action_space.sample())
        assert observations in env.observation_space
    np.testing.assert_allclose(observations["ratio"], 4 / LENGTH)


def test_what_is_unknown_or_missing(chosen: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="unknown part 'train'; expected one of: recogniser, policy, validation, test"):
        grid_env(**chosen, part="train")
    with pytest.raises(DataError, match=r"absent\.npz"):
        grid_env(**chosen | {"data": tmp_path / "absent.npz"})
    with pytest.raises(ModelError, match="estimator"):
        grid_env(**chosen, sensor="estimator")
    with pytest.raises(UsageError, match="expected at least one scenario of 500 frames"):
        grid_env(**chosen | {"length": 500})
