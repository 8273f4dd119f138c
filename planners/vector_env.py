"""The natively batched environment as stable-baselines3 wants it: a VecEnv that shows the agent's inputs.

Episodes run in groups, each with its own random numbers, so that results do not depend on how many processes the
groups are spread over.
"""

import multiprocessing
import pickle
import signal
from collections.abc import Callable, Iterable, Sequence
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

import cloudpickle
import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.env import EpisodeVectorEnv
from ehar.errors import EpisodeError, UsageError
from ehar.observations import Observations
from planners.agent_inputs import AgentInputs, Inputs, InputSizes

HINDSIGHT = "hindsight"  # what a critic may be shown in training: label, its probability, whether it is recognised
GROUP = 32  # episodes that share random numbers and a recogniser's batch

MakeEnv = Callable[[int], EpisodeVectorEnv]  # of a number of episodes


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
        env: the environment.
        seed: of all that is drawn, beside the number of the batch of episodes.
        first: the number of the first batch, for a run that goes on.
        hold: frames for which a move is made again and again.
    """

    def __init__(self, env: EpisodeVectorEnv, *, seed: Sequence[int], first: int, hold: int) -> None:
        """Create the group; nothing is drawn before `reset`."""
        self._env, self._seed, self._next, self._hold = env, tuple(seed), first, hold

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


class AgentVecEnv(VecEnv):
    """Groups of environments in lockstep, here or in worker processes.

    Rewards are those of Eq. 1, relative to an episode's copies where there are any; the returns in `infos` are not.
    As stable-baselines3 expects, an episode's end is followed by the next one's first frame in the same step; the
    last frame's inputs are in `terminal_observation`. Nothing is ever truncated.

    Args:
        make_env: makes a natively batched environment of so many episodes.
        num_envs: episodes at a time, 1 to `GROUP` or a multiple of it.
        seed: of all that is drawn.
        first: the number of the first batch of episodes: what follows does not depend on those before.
        hold: frames for which each move is made again and again.
        workers: processes beside this one; 0 runs everything here.

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
        groups = [(size, (seed, group), first, hold) for group in range(num_envs // size)]
        probe = make_env(1)
        super().__init__(num_envs, _input_space(probe), probe.single_action_space)
        parts = np.array_split(np.arange(len(groups)), max(1, min(workers, len(groups))))
        shares = [[groups[group] for group in part] for part in parts]
        self._shares = [_Remote(make_env, share) if workers else _Here(make_env, share) for share in shares]
        self._ends = np.cumsum([len(share) * size for share in shares])[:-1]
        self._returns = np.zeros(num_envs)
        self._frames = 0

    def reset(self) -> VecEnvObs:
        """Begin episodes."""
        self._returns[:], self._frames = 0, 0
        for share in self._shares:
            share.send(None)
        return _joined([seen for share in self._shares for seen in share.receive()])

    def step_async(self, actions: IntArray) -> None:
        """Send moves (num_envs,) out."""
        for share, moves in zip(self._shares, np.split(np.asarray(actions), self._ends), strict=True):
            share.send(moves)

    def step_wait(self) -> VecEnvStepReturn:
        """Wait for the next frame of all environments."""
        seen: list[Seen] = [one for share in self._shares for one in share.receive()]
        rewards = np.concatenate([one.relative for one in seen])
        self._returns += np.concatenate([one.rewards for one in seen])
        self._frames += 1
        over = seen[0].over
        dones: BoolArray = np.full(self.num_envs, over)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if over:
            last = _joined([one.last for one in seen if one.last is not None])
            for i, info in enumerate(infos):
                info["terminal_observation"] = {name: values[i] for name, values in last.items()}
                info["episode"] = {"r": float(self._returns[i]), "l": self._frames}
            self._returns[:], self._frames = 0, 0
        return _joined([one.inputs for one in seen]), rewards.astype(np.float32), dones, infos

    def close(self) -> None:
        """End the worker processes."""
        for share in self._shares:
            share.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of this object for each environment; there are no objects behind them.

        Raises:
            AttributeError: there is none of that name, as `has_attr` wants to know.
        """
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Refuse: environments have no objects of their own."""
        raise UsageError(f"set_attr {attr_name!r}: environments of a batch cannot be changed one by one")

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Refuse: environments have no objects of their own."""
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
    sizes = InputSizes.of(persons=persons, joints=joints, classes=classes, embedding=embedding)
    return spaces.Dict(
        {
            name: spaces.Box(-np.inf, np.inf, (size,), np.float32)
            for name, size in (*vars(sizes).items(), (HINDSIGHT, classes + 2))
        }
    )


class _Here:
    """Groups in this process."""

    def __init__(self, make_env: MakeEnv, groups: Iterable[tuple[int, tuple[int, int], int, int]]) -> None:
        self._groups = [Group(make_env(size), seed=seed, first=first, hold=hold) for size, seed, first, hold in groups]

    def send(self, moves: IntArray | None) -> None:
        if moves is None:
            self._answer: list[Any] = [group.reset() for group in self._groups]
        else:
            pieces = np.split(moves, len(self._groups))
            self._answer = [group.step(piece) for group, piece in zip(self._groups, pieces, strict=True)]

    def receive(self) -> list[Any]:
        return self._answer

    def close(self) -> None:
        pass


class _Remote:
    """Groups in a process of their own, behind the same calls."""

    def __init__(self, make_env: MakeEnv, groups: Iterable[tuple[int, tuple[int, int], int, int]]) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, cloudpickle.dumps((make_env, list(groups)))))
        self._process.daemon = True
        self._process.start()
        theirs.close()  # so that only the process holds it, and its end is noticed here

    def send(self, moves: IntArray | None) -> None:
        try:
            self._pipe.send(moves)
        except OSError as error:
            raise self._ended() from error

    def receive(self) -> list[Any]:
        try:
            answer = self._pipe.recv()
        except (EOFError, OSError) as error:
            raise self._ended() from error
        if isinstance(answer, Exception):
            raise answer
        return list(answer)

    def close(self) -> None:
        self._pipe.close()  # which ends the loop over there
        self._process.join()

    def _ended(self) -> EpisodeError:
        self._process.join(timeout=1)  # a killed process needs a moment to have an exit code
        return EpisodeError(
            f"environments: a worker process has ended, with exit code {self._process.exitcode}: expected an answer"
        )


def _serve(pipe: Connection, payload: bytes) -> None:
    """Answer calls until the other end is closed, or its process is gone; an error answers all calls after it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent hears Ctrl-C too, and closes the pipe
    torch.set_num_threads(1)
    failed: Exception | None = None
    try:
        here = _Here(*cloudpickle.loads(payload))
    except Exception as error:
        failed = _sendable(error)
    while True:
        try:
            moves = pipe.recv()
        except (EOFError, OSError):
            return
        answer: Any = failed
        if failed is None:
            try:
                here.send(moves)
                answer = here.receive()
            except Exception as error:
                answer = failed = _sendable(error)
        try:
            pipe.send(answer)
        except OSError:
            return


def _sendable(error: Exception) -> Exception:
    """Return the error, or where a pipe would not carry it over what it says."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return EpisodeError(f"environments: {type(error).__name__}: {error}")
    return error
