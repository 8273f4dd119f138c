"""`ehar/Grid-v0` and `ehar/Flight-v0` by their names, with a network of random weights."""

import json
import warnings
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env

from ehar.conditions import Conditions
from ehar.envs.controls import FlightControls, GridControls
from ehar.envs.environment import EpisodeVectorEnv
from ehar.errors import DataError, ModelError, UsageError
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion
from recognition.environments import TRAINED_ON, make_env
from tests.helpers.random_networks import save_random_world
from tests.helpers.settings import tiny_conditions

LENGTH = 10


@pytest.fixture(scope="module")
def conditions(tmp_path_factory: pytest.TempPathFactory) -> Conditions:
    """Write tiny data and an untrained recogniser of it, and return what the environment is told."""
    torch.set_num_threads(1)
    folder = tmp_path_factory.mktemp("grid")
    save_random_world(folder, LENGTH)
    return tiny_conditions(folder, length=LENGTH, part="policy")


@pytest.mark.parametrize("name", ["ehar/Grid-v0", "ehar/Flight-v0"])
def test_the_single_environment_by_its_name(conditions: Conditions, name: str) -> None:
    env = gym.make(name, conditions=conditions)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of embeddings without bounds
        check_env(env.unwrapped)
    env.reset(seed=0)
    for _ in range(LENGTH - 1):
        _, _, terminated, _, _ = env.step(env.action_space.sample())
    assert terminated


@pytest.mark.parametrize(("name", "controls"), [("ehar/Grid-v0", GridControls), ("ehar/Flight-v0", FlightControls)])
def test_the_batched_environment_by_its_name(conditions: Conditions, name: str, controls: type) -> None:
    env = gym.make_vec(name, num_envs=8, vectorization_mode="vector_entry_point", conditions=conditions)
    assert isinstance(env.unwrapped, EpisodeVectorEnv)
    assert isinstance(env.unwrapped.episodes.controls, controls)
    observations, _ = env.reset(seed=0)
    assert observations in env.observation_space
    for _ in range(LENGTH + 3):
        observations, _, _, _, _ = env.step(env.action_space.sample())
        assert observations in env.observation_space
    np.testing.assert_allclose(observations["ratio"], 4 / LENGTH)


def test_what_is_unknown_or_missing(conditions: Conditions, tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"absent\.npz"):
        make_env(conditions=replace(conditions, data=tmp_path / "absent.npz"))
    with pytest.raises(ModelError, match="estimator"):
        make_env(conditions=replace(conditions, sensor="estimator"))
    with pytest.raises(UsageError, match="expected at least one scenario of 500 frames"):
        make_env(conditions=replace(conditions, length=500))
    with pytest.raises(UsageError, match="unknown track 'kite'; expected ideal, px4-auto, "):
        make_env(conditions=conditions, track="kite")


def test_the_usual_conditions_are_those_that_agents_train_on() -> None:
    assert replace(Conditions(), part="policy") == TRAINED_ON


def test_a_vehicle_file_flies(conditions: Conditions, tmp_path: Path) -> None:
    limits = {"speed": 2, "acceleration": 1, "jerk": 5, "climb_speed": 1, "descent_speed": 1, "yaw_rate_deg": 30}
    (tmp_path / "kite.json").write_text(json.dumps(limits), encoding="utf-8")
    kite = tmp_path / "kite.json"
    for env in (make_env(conditions=conditions, track=str(kite)), make_env(conditions=replace(conditions, track=kite))):
        assert isinstance(env.episodes.controls, FlightControls)
        env.reset(seed=0)
        observation = env.step(np.ones(4, dtype=np.float32))[0]
        assert observation in env.observation_space


def test_the_conditions_track_comes_before_that_of_the_name(conditions: Conditions) -> None:
    env = gym.make("ehar/Flight-v0", conditions=replace(conditions, track="tracking-drone"))
    controls = env.unwrapped.episodes.controls  # type: ignore[attr-defined]
    assert controls.motion.vehicle == VEHICLES["tracking-drone"]


def test_a_motion_of_a_user_s_own_is_not_taken_for_the_grid(conditions: Conditions) -> None:
    with pytest.raises(UsageError, match="track GridMotion: expected ideal or a vehicle"):
        make_env(conditions=replace(conditions, track=GridMotion()))
