"""The Gymnasium environments in flight: checkers, what actions mean, and the batch against the loop."""

import warnings
from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_env_sb3

from ehar.arrays import FloatArray
from ehar.envs.controls import FlightControls
from ehar.envs.environment import EpisodeEnv, EpisodeVectorEnv
from ehar.envs.task import EpisodeTask
from ehar.errors import EpisodeError
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.sensors.registry import make_sensor
from ehar.viewpoint import AZIMUTH, wrap_difference
from tests.helpers.fakes import FakeRecogniser, tiny_scenarios

LENGTH = 60
VEHICLE = VEHICLES["tracking-drone"]


def parts(sensor: str = "perfect", *, length: int = LENGTH) -> dict[str, Any]:
    scenarios = tiny_scenarios(length=length)
    return {
        "scenarios": scenarios,
        "recogniser": FakeRecogniser(),
        "sensor": make_sensor(sensor, scenarios.data),
        "controls": FlightControls(vehicle=VEHICLE),
    }


def action_to(target: FloatArray) -> FloatArray:
    """Return the actions (B, 4) that stand for target viewpoints (B, 3) within the default workspace."""
    distance, azimuth, polar = target.T
    return np.stack([distance / 5 - 2, np.sin(azimuth), np.cos(azimuth), polar * 4 / np.pi - 1], axis=1)


@pytest.mark.parametrize("sensor", ["perfect", "estimator"])
def test_gymnasium_s_and_stable_baselines_checkers(sensor: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of embeddings without bounds
        check_env(EpisodeEnv(EpisodeTask(**parts(sensor, length=10))))
        check_env_sb3(EpisodeEnv(EpisodeTask(**parts(sensor, length=10))))


def test_an_action_is_a_target() -> None:
    rng = np.random.default_rng(0)
    controls = FlightControls(vehicle=VEHICLE)
    target = rng.uniform([5, 0, 0], [15, 2 * np.pi, np.pi / 2], (20, 3))
    found = controls.targets(action_to(target), target + 0.1, "here")
    np.testing.assert_allclose(wrap_difference(found - target), 0, atol=1e-12)


def test_the_length_of_the_direction_does_not_matter_but_none_keeps_the_azimuth() -> None:
    controls = FlightControls(vehicle=VEHICLE)
    viewpoint = np.array([[8.0, 1.2, 0.5]] * 3)
    actions = np.array([[0, 1, 1, 0], [0, 0.1, 0.1, 0], [0, 0, 0, 0]], dtype=np.float32)
    azimuths = controls.targets(actions, viewpoint, "here")[:, AZIMUTH]
    np.testing.assert_allclose(azimuths, [np.pi / 4, np.pi / 4, 1.2], atol=1e-6)


def test_a_camera_flies_to_the_target_at_the_frame_rate_of_the_data() -> None:
    env = EpisodeVectorEnv(4, EpisodeTask(**parts()))
    env.reset(seed=0)
    alone = FlightMotion(vehicle=VEHICLE)
    alone.reset(env.episodes.viewpoint, 1 / 25)
    target = env.episodes.workspace.clip(env.episodes.viewpoint + np.array([0.5, 0.1, 0.1]))
    for _ in range(LENGTH - 1):
        observations = env.step(action_to(target))[0]
        alone.advance(target)
        assert observations in env.observation_space
        np.testing.assert_allclose(env.episodes.controls.motion.velocity, alone.velocity, atol=1e-9)
    np.testing.assert_allclose(observations["velocity"], 0, atol=1e-6)
    np.testing.assert_allclose(env.episodes.viewpoint, target, atol=1e-6)


def test_velocity_is_observed_and_begins_at_rest() -> None:
    env = EpisodeEnv(EpisodeTask(**parts()))
    observation, _ = env.reset(seed=0)
    assert not observation["velocity"].any()
    distance = env.episodes.viewpoint[0, 0]
    outwards = 1.0 if distance < 10 else -1.0
    for _ in range(20):
        observation = env.step(np.array([outwards, 0, 0, -1], dtype=np.float32))[0]
    assert observation["velocity"][0] * outwards > 0.05
    assert env.reset(seed=1)[0]["velocity"].tolist() == [0, 0, 0]


def test_a_batch_of_one_is_the_single_environment() -> None:
    single, batched = (
        EpisodeEnv(EpisodeTask(**parts("estimator"))),
        EpisodeVectorEnv(1, EpisodeTask(**parts("estimator"))),
    )
    (observation, _), (observations, _) = single.reset(seed=5), batched.reset(seed=5)
    rng = np.random.default_rng(0)
    for _ in range(LENGTH - 1):
        for key, value in observation.items():
            np.testing.assert_array_equal(value, observations[key][0])
        action = rng.uniform(-1, 1, (1, 4)).astype(np.float32)
        observation, one, terminated, _, _ = single.step(action[0])
        observations, rewards, terminations, _, _ = batched.step(action)
        assert (one, terminated) == (rewards[0], terminations[0])


def test_the_batch_begins_anew_and_at_rest_with_the_step_after_the_last() -> None:
    env = EpisodeVectorEnv(3, EpisodeTask(**parts(length=10)))
    env.reset(seed=0)
    for _ in range(9):
        _, _, terminated, _, _ = env.step(env.action_space.sample())
    assert terminated.all()
    observations, rewards, terminated, _, _ = env.step(np.full((3, 4), np.nan))  # these actions are ignored
    assert not observations["velocity"].any() and not rewards.any() and not terminated.any()


@pytest.mark.parametrize("action", [[0, 0, 0], [0, 0, 0, np.nan], [0, np.inf, 0, 0]])
def test_an_action_that_is_none(action: list[float]) -> None:
    env = EpisodeEnv(EpisodeTask(**parts()))
    env.reset(seed=0)
    with pytest.raises(EpisodeError, match="frame 1: expected 1 times 4 finite numbers, got "):
        env.step(np.array(action, dtype=np.float32))
