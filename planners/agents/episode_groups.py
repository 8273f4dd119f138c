"""Groups of episodes that PPO learns from: whole batches, one after another, and what the agent is given of them.

Each group has random numbers of its own, so that results do not depend on how many processes groups are spread over.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.envs.environment import EpisodeVectorEnv
from ehar.envs.observations import Observations
from planners.agents.inputs import AgentInputs, Inputs

HINDSIGHT = "hindsight"  # what a critic may be shown in training: label, its probability, whether it is recognised
GROUP = 32  # episodes that share random numbers and a recogniser's batch

MakeEnv = Callable[[int], EpisodeVectorEnv]  # of a number of episodes


class GroupSetting(NamedTuple):
    """How a group is made."""

    size: int  # episodes
    seed: tuple[int, ...]  # of all that is drawn, beside the number of the batch of episodes
    first: int  # the number of the first batch, for a run that goes on
    hold: int  # frames for which a move is made again and again


class Seen(NamedTuple):
    """What one step of a group shows."""

    inputs: Inputs
    rewards: FloatArray  # (B,), of Eq. 1
    relative: FloatArray  # (B,), what they are above those of the copies
    over: bool
    last: Inputs | None  # the inputs after the last frame, where a new episode has begun in its place


class Group:
    """Some of the environments: one natively batched environment, and the inputs that its episodes give.

    Args:
        make_env: makes the environment.
        setting: how.
    """

    def __init__(self, make_env: MakeEnv, setting: GroupSetting) -> None:
        """Create the group; nothing is drawn before `reset`."""
        self._env = make_env(setting.size)
        self._seed, self._next, self._hold = setting.seed, setting.first, setting.hold

    def reset(self) -> Inputs:
        """Begin the next batch of episodes."""
        entropy = np.random.SeedSequence([*self._seed, self._next]).generate_state(1)[0]
        self._next += 1
        self._inputs = AgentInputs()
        observations, info = self._env.reset(seed=int(entropy))
        return self._see(observations, info)

    def step(self, moves: IntArray) -> Seen:
        """Carry out moves (B,), and begin the next episodes at once where these are over."""
        rewards: FloatArray = np.zeros(len(moves))
        over = False
        for _ in range(self._hold):
            observations, reward, terminated, _, info = self._env.step(moves)
            inputs = self._see(observations, info)
            rewards += reward
            over = bool(terminated[0])
            if over:
                break
        relative = relative_rewards(rewards, self._env.episodes.copies)
        if over:
            return Seen(self.reset(), rewards, relative, over, inputs)
        return Seen(inputs, rewards, relative, over, None)

    def _see(self, observations: Observations, info: dict[str, Any]) -> Inputs:
        return self._inputs.see(observations) | {HINDSIGHT: hindsight(observations["probabilities"], info)}


def relative_rewards(rewards: FloatArray, copies: int) -> FloatArray:
    """Return by how much rewards (B,) exceed the mean of the other copies of their episode; without copies, them.

    What the others were rewarded does not depend on one's own moves, so it is a baseline that leaves the policy
    gradient unbiased (Kool et al. 2019), and one that knows the people and the noise: all that is left is where the
    cameras went.
    """
    if copies == 1:
        return rewards
    together = rewards.reshape(-1, copies)
    relative: FloatArray = (together - together.mean(axis=1, keepdims=True)) * copies / (copies - 1)
    return relative.ravel()


def hindsight(probabilities: FloatArray, info: dict[str, Any]) -> FloatArray:
    """Return what only a critic is shown (B, K + 2): the label as one of K, its probability, and whether it is on top.

    Args:
        probabilities: (B, K), the recogniser's.
        info: of the environment.
    """
    label, correct = info["label"], info["correct"]
    of_label = np.take_along_axis(probabilities, label[:, None], axis=1)
    one_hot = np.eye(probabilities.shape[1])[label]
    return np.concatenate([one_hot, of_label, correct[:, None]], axis=1).astype(np.float32)
