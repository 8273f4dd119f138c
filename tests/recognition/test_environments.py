"""`ehar/Grid-v0` and `ehar/Flight-v0` by their names, with a network of random weights."""

import json
import warnings
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env

from ehar.data.motion_file import load_motion, save_motion
from ehar.envs.controls import FlightControls, GridControls
from ehar.envs.environment import EpisodeVectorEnv
from ehar.errors import DataError, ModelError, UsageError
from recognition.calibration import Temperature
from recognition.environments import make_env
from recognition.networks.spec import NetworkSpec
from recognition.storage import recogniser_path, save_recogniser
from tests.helpers.fakes import tiny_data

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


@pytest.mark.parametrize("name", ["ehar/Grid-v0", "ehar/Flight-v0"])
def test_the_single_environment_by_its_name(chosen: dict[str, Any], name: str) -> None:
    env = gym.make(name, **chosen)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of embeddings without bounds
        check_env(env.unwrapped)
    env.reset(seed=0)
    for _ in range(LENGTH - 1):
        _, _, terminated, _, _ = env.step(env.action_space.sample())
    assert terminated


@pytest.mark.parametrize(("name", "controls"), [("ehar/Grid-v0", GridControls), ("ehar/Flight-v0", FlightControls)])
def test_the_batched_environment_by_its_name(chosen: dict[str, Any], name: str, controls: type) -> None:
    env = gym.make_vec(name, num_envs=8, vectorization_mode="vector_entry_point", **chosen)
    assert isinstance(env.unwrapped, EpisodeVectorEnv)
    assert isinstance(env.unwrapped.episodes.controls, controls)
    observations, _ = env.reset(seed=0)
    assert observations in env.observation_space
    for _ in range(LENGTH + 3):
        observations, _, _, _, _ = env.step(env.action_space.sample())
        assert observations in env.observation_space
    np.testing.assert_allclose(observations["ratio"], 4 / LENGTH)


def test_what_is_unknown_or_missing(chosen: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="unknown part 'train'; expected one of: recogniser, policy, validation, test"):
        make_env(**chosen, part="train")
    with pytest.raises(DataError, match=r"absent\.npz"):
        make_env(**chosen | {"data": tmp_path / "absent.npz"})
    with pytest.raises(ModelError, match="estimator"):
        make_env(**chosen, sensor="estimator")
    with pytest.raises(UsageError, match="expected at least one scenario of 500 frames"):
        make_env(**chosen | {"length": 500})
    with pytest.raises(UsageError, match="unknown vehicle 'kite'; expected one of: px4-auto, "):
        make_env(**chosen, vehicle="kite")


def test_a_vehicle_file_flies(chosen: dict[str, Any], tmp_path: Path) -> None:
    limits = {"speed": 2, "acceleration": 1, "jerk": 5, "climb_speed": 1, "descent_speed": 1, "yaw_rate_deg": 30}
    (tmp_path / "kite.json").write_text(json.dumps(limits), encoding="utf-8")
    env = make_env(**chosen, vehicle=tmp_path / "kite.json")
    env.reset(seed=0)
    observation = env.step(np.ones(4, dtype=np.float32))[0]
    assert observation in env.observation_space
