"""Groups of episodes that PPO learns from: whole batches, one after another, shown as inputs of the agent.

Each group has its own random numbers, so results do not depend on the number of processes.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.envs.environment import EpisodeVectorEnv
from ehar.envs.observations import Observations
from planners.agents.inputs import AgentInputs, Inputs

HINDSIGHT = "hindsight"  # extra input of the critic in training: label, its probability, whether it is recognised
GROUP = 32  # episodes that share random numbers and a recogniser's batch

MakeEnv = Callable[[int], EpisodeVectorEnv]  # makes an environment of so many episodes


class GroupSetting(NamedTuple):
    """The settings of a group."""

    size: int  # number of episodes
    seed: tuple[int, ...]  # seed of all random numbers, beside the number of the batch of episodes
    first: int  # the number of the first batch, for a resumed run
    hold: int  # number of frames for which a move is repeated


class GroupStep(NamedTuple):
    """The result of one step of a group."""

    inputs: Inputs
    rewards: FloatArray  # (B,), the rewards of Eq. 1
    relative: FloatArray  # (B,), the rewards relative to those of the copies
    over: bool  # whether the episodes have ended
    last: Inputs | None  # the inputs after the last frame, if the episodes have ended
    cut: bool = False  # whether they have ended only here: a stream goes on


class Group:
    """A part of the environments: one natively batched environment, and the agent's inputs from its episodes.

    Args:
        make_env: makes the environment.
        setting: the settings of the group.
    """

    def __init__(self, make_env: MakeEnv, setting: GroupSetting) -> None:
        """Create the group; nothing is drawn before `reset`."""
        self._env = make_env(setting.size)
        self._seed, self._next, self._hold = setting.seed, setting.first, setting.hold

    def reset(self) -> Inputs:
        """Begin the next batch of episodes."""
        entropy = np.random.SeedSequence([*self._seed, self._next]).generate_state(1)[0]
        self._next += 1
        task = self._env.episodes
        self._inputs = AgentInputs(1 / task.scenarios.data.fps if task.in_streams else None)
        observations, info = self._env.reset(seed=int(entropy))
        return self._see(observations, info)

    def step(self, moves: IntArray) -> GroupStep:
        """Carry out moves (B,); if the episodes are over, begin the next ones at once."""
        rewards: FloatArray = np.zeros(len(moves))
        over = False
        for _ in range(self._hold):
            observations, reward, terminated, truncated, info = self._env.step(moves)
            inputs = self._see(observations, info)
            rewards += reward
            over = bool(terminated[0] or truncated[0])
            if over:
                break
        relative = relative_rewards(rewards, self._env.episodes.copies)
        if over:
            return GroupStep(self.reset(), rewards, relative, over, inputs, bool(truncated[0]))
        return GroupStep(inputs, rewards, relative, over, None)

    def _see(self, observations: Observations, info: dict[str, Any]) -> Inputs:
        return self._inputs.see(observations) | {HINDSIGHT: hindsight(observations["probabilities"], info)}


def relative_rewards(rewards: FloatArray, copies: int) -> FloatArray:
    """Return how far rewards (B,) exceed the mean of the other copies of their episode; without copies, the rewards.

    The rewards of the other copies do not depend on the moves of this one. So their mean is a baseline that leaves the
    policy gradient unbiased (Kool et al. 2019). The copies share the people and the noise, so only the paths of the
    cameras make a difference.
    """
    if copies == 1:
        return rewards
    together = rewards.reshape(-1, copies)
    relative: FloatArray = (together - together.mean(axis=1, keepdims=True)) * copies / (copies - 1)
    return relative.ravel()


def hindsight(probabilities: FloatArray, info: dict[str, Any]) -> FloatArray:
    """Return the critic's extra input (B, K + 2): the one-hot label, its probability, and whether it is on top.

    Args:
        probabilities: (B, K), the recogniser's probabilities.
        info: the info of the environment.
    """
    label, correct = info["label"], info["correct"]
    probability = np.take_along_axis(probabilities, label[:, None], axis=1)
    one_hot = np.eye(probabilities.shape[1])[label]
    return np.concatenate([one_hot, probability, correct[:, None]], axis=1).astype(np.float32)
