"""Gymnasium environments of the task, on the grid and in flight: one episode at a time, and a batch in lockstep."""

from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from ehar.arrays import BoolArray, FloatArray
from ehar.envs.task import EpisodeTask, Observations
from ehar.envs.task import reward as reward


class EpisodeEnv(gym.Env[dict[str, Any], Any]):
    """One episode at a time of the task that `EpisodeTask` describes.

    The last frame of a clip terminates an episode and does not truncate it. The task ends there by definition, and
    `ratio` tells the agent when, so there is no later value to bootstrap from. A stream goes on: its episode is
    truncated, and nothing that the agent sees tells it when.

    Args:
        episodes: the task.
    """

    metadata = {"render_modes": []}  # noqa: RUF012  as gym.Env declares it

    def __init__(self, episodes: EpisodeTask) -> None:
        """Create the environment."""
        self.episodes = episodes
        self.observation_space = episodes.observation_space
        self.action_space = episodes.controls.action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin an episode and return frame 1; there are no options."""
        super().reset(seed=seed)
        observations = self.episodes.begin(1, self.np_random)
        return _only(observations), _only(self.episodes.info)

    def step(self, action: Any) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Carry out an action and see the next frame."""
        observations, rewards = self.episodes.step(np.asarray(action)[None])
        ends = self.episodes.over
        terminated, truncated = (False, ends) if self.episodes.in_streams else (ends, False)
        return _only(observations), float(rewards[0]), terminated, truncated, _only(self.episodes.info)


class EpisodeVectorEnv(gym.vector.VectorEnv[Observations, npt.NDArray[Any], npt.NDArray[Any]]):
    """A batch of episodes in lockstep: one call of the sensor and one of the recogniser per step.

    All episodes have L frames, so all end at the same step. Autoreset happens in the next step, as is Gymnasium's
    default: the step after the last one ignores its actions, begins new episodes and returns rewards of 0.

    Args:
        num_envs: episodes at a time, B.
        episodes: the task.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012  as VectorEnv's

    def __init__(self, num_envs: int, episodes: EpisodeTask) -> None:
        """Create the environments."""
        self.num_envs = num_envs
        self.episodes = episodes
        self.single_observation_space = episodes.observation_space
        self.single_action_space = episodes.controls.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin B episodes and return frame 1 of each; there are no options."""
        super().reset(seed=seed)
        return self.episodes.begin(self.num_envs, self.np_random), self._masked_info()

    def step(self, actions: npt.NDArray[Any]) -> tuple[Observations, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Carry out actions (B, ...) and see the next frame of each episode."""
        rewards: FloatArray = np.zeros(self.num_envs)
        if self.episodes.frame == self.episodes.scenarios.length - 1:
            observations = self.episodes.begin(self.num_envs, self.np_random)
        else:
            observations, rewards = self.episodes.step(np.asarray(actions))
        ends, not_yet = np.full(self.num_envs, self.episodes.over), np.zeros(self.num_envs, dtype=bool)
        terminated, truncated = (not_yet, ends) if self.episodes.in_streams else (ends, not_yet)
        return observations, rewards, terminated, truncated, self._masked_info()

    def _masked_info(self) -> dict[str, Any]:
        """Return the info with the mask that Gymnasium keeps beside each key."""
        info = self.episodes.info
        return info | {f"_{key}": np.ones(self.num_envs, dtype=bool) for key in info}


def _only(batched: dict[str, Any]) -> dict[str, Any]:
    """Return the first entry of every array."""
    return {key: array[0] for key, array in batched.items()}
