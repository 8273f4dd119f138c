"""The natively batched environment as a VecEnv of stable-baselines3, which shows the agent's inputs."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

from ehar.arrays import BoolArray, IntArray
from ehar.envs.environment import EpisodeVectorEnv
from ehar.errors import UsageError
from ehar.processes import thread_share
from planners.agents.episode_groups import GROUP, HINDSIGHT, GroupSetting, GroupStep, MakeEnv
from planners.agents.group_workers import GroupsHere, GroupsThere
from planners.agents.inputs import Inputs, InputSizes


class AgentVecEnv(VecEnv):
    """Groups of environments in lockstep, here or in worker processes.

    Rewards are those of Eq. 1. If an episode has copies, rewards are relative to them; the returns in `infos` are not.
    As stable-baselines3 expects, the step that ends an episode returns the first frame of the next one. The inputs of
    the last frame are in `terminal_observation`. A clip is never truncated. An episode of a stream always is, and its
    `infos` say so: what the critic expects of the rest is added to the last reward.

    Args:
        make_env: makes a natively batched environment of so many episodes.
        num_envs: number of episodes at a time, 1 to `GROUP` or a multiple of it.
        seed: seed of all random numbers.
        first: number of the first batch of episodes; a batch does not depend on earlier ones.
        hold: number of frames for which each move is repeated.
        workers: number of processes beside this one; 0 runs everything here.

    Raises:
        UsageError: the number of environments is not as described.
        EpisodeError: a worker process has ended; any error in one is raised here.
    """

    render_mode = None

    def __init__(
        self, make_env: MakeEnv, *, num_envs: int, seed: int, first: int = 0, hold: int = 1, workers: int = 0
    ) -> None:
        """Create the environments."""
        size = min(GROUP, num_envs)
        if num_envs < 1 or num_envs % size:
            raise UsageError(f"environments: expected 1 to {GROUP}, or a multiple of {GROUP}, got {num_envs}")
        groups = [GroupSetting(size, (seed, group), first, hold) for group in range(num_envs // size)]
        probe = make_env(1)
        super().__init__(num_envs, _input_space(probe), probe.single_action_space)
        parts = np.array_split(np.arange(len(groups)), max(1, min(workers, len(groups))))
        shares = [[groups[group] for group in part] for part in parts]
        with thread_share(len(shares)):
            self._shares = [GroupsThere(make_env, one) if workers else GroupsHere(make_env, one) for one in shares]
        self._ends = np.cumsum([len(share) * size for share in shares])[:-1]
        self._returns = np.zeros(num_envs)
        self._steps = 0

    def reset(self) -> VecEnvObs:
        """Begin episodes."""
        self._returns[:], self._steps = 0, 0
        for share in self._shares:
            share.send(None)
        return _joined([seen for share in self._shares for seen in share.receive()])

    def step_async(self, actions: IntArray) -> None:
        """Send moves (num_envs,) out."""
        for share, moves in zip(self._shares, np.split(np.asarray(actions), self._ends), strict=True):
            share.send(moves)

    def step_wait(self) -> VecEnvStepReturn:
        """Wait for the next step of all environments."""
        seen: list[GroupStep] = [one for share in self._shares for one in share.receive()]
        rewards = np.concatenate([one.relative for one in seen])
        self._returns += np.concatenate([one.rewards for one in seen])
        self._steps += 1
        over = seen[0].over
        dones: BoolArray = np.full(self.num_envs, over)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if over:
            last = _joined([one.last for one in seen if one.last is not None])
            for i, info in enumerate(infos):
                if seen[0].cut:
                    info["TimeLimit.truncated"] = True
                info["terminal_observation"] = {name: values[i] for name, values in last.items()}
                info["episode"] = {"r": float(self._returns[i]), "l": self._steps}
            self._returns[:], self._steps = 0, 0
        return _joined([one.inputs for one in seen]), rewards.astype(np.float32), dones, infos

    def close(self) -> None:
        """End the worker processes."""
        for share in self._shares:
            share.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of this object for each environment; there are no objects behind them.

        Raises:
            AttributeError: there is no such attribute; `has_attr` relies on this error.
        """
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Refuse: a single environment is not an object."""
        raise UsageError(f"set_attr {attr_name!r}: environments of a batch cannot be changed one by one")

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Refuse: a single environment is not an object."""
        raise UsageError(f"env_method {method_name!r}: environments of a batch cannot be called one by one")

    def env_is_wrapped(self, wrapper_class: Any, indices: VecEnvIndices = None) -> list[bool]:
        """Return False for each environment."""
        return [False] * len(list(self._get_indices(indices)))


def _joined(pieces: Sequence[Inputs]) -> Inputs:
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}


def _input_space(env: EpisodeVectorEnv) -> spaces.Dict:
    """Return the space of one environment's inputs."""
    shown = env.single_observation_space
    assert isinstance(shown, spaces.Dict)
    persons, joints = shown["confidence"].shape or (0, 0)
    (classes,), (embedding,) = shown["probabilities"].shape or (0,), shown["embedding"].shape or (0,)
    sizes = InputSizes.of(
        persons=persons,
        joints=joints,
        classes=classes,
        embedding=embedding,
        streams=env.episodes.in_streams,
        flown="velocity" in shown.spaces,
        distances="distances" in shown.spaces,
    )
    return spaces.Dict(
        {
            name: spaces.Box(-np.inf, np.inf, (size,), np.float32)
            for name, size in (*vars(sizes).items(), (HINDSIGHT, classes + 2))
        }
    )
