"""The batched environment of tiny episodes in which being level decides, and what agents are trained on in it."""

import hashlib
from functools import partial

import numpy as np
import torch

from ehar.arrays import FloatArray, IntArray
from ehar.envs.controls import GridControls
from ehar.envs.environment import EpisodeVectorEnv
from ehar.envs.task import EpisodeTask
from ehar.sensors.registry import make_sensor
from ehar.viewpoint import POLAR
from planners.agents.episode_groups import MakeEnv
from planners.agents.network import AgentNetwork
from planners.agents.vector_env import AgentVecEnv
from tests.helpers.fakes import FakeRecogniser, tiny_scenarios

LENGTH = 10
UP, DOWN = 4, 5  # the moves towards level, and away


def steep_quality(viewpoint: FloatArray) -> FloatArray:
    """Return evidence that misleads from above 45 degrees, and the more informs the nearer to level."""
    quality: FloatArray = np.expm1(5 * (viewpoint[..., POLAR] - np.pi / 4)) / 20
    return quality


def tiny_env(
    episodes: int, *, copies: int = 1, length: int = LENGTH, sensor: str = "estimator", broken: bool = False
) -> EpisodeVectorEnv:
    """Return the environment; one that is broken does not survive its first recognised frame."""
    scenarios = tiny_scenarios(length=length)
    task = EpisodeTask(
        scenarios=scenarios,
        recogniser=FakeRecogniser(quality=_fail if broken else steep_quality),
        sensor=make_sensor(sensor, scenarios.data),
        controls=GridControls(),
        copies=copies,
    )
    return EpisodeVectorEnv(episodes, task)


def tiny_maker(**chosen: object) -> MakeEnv:
    """Return what makes the environment."""
    return partial(tiny_env, **chosen)  # type: ignore[arg-type]


def mean_return(network: AgentNetwork | None, *, episodes: int = 256, length: int = 20, seed: int = 77) -> float:
    """Return the mean return of a network's best moves over episodes it was not trained in; without one, of random."""
    env = AgentVecEnv(
        tiny_maker(length=length, sensor="perfect"), num_envs=episodes, seed=seed, first=0, hold=1, workers=0
    )
    inputs, rng, total = env.reset(), np.random.default_rng(0), 0.0
    for _ in range(length - 1):
        moves: IntArray = rng.integers(0, 7, episodes)
        if network is not None:
            assert isinstance(inputs, dict)
            with torch.no_grad():
                shown = {name: torch.from_numpy(values) for name, values in inputs.items()}
                moves = network.logits(network.state(shown)).argmax(dim=1).numpy()
        inputs, rewards, _, _ = env.step(moves)
        total += float(rewards.mean())
    return total


def weights(network: AgentNetwork) -> str:
    """Return a digest of all weights, to be compared bit for bit."""
    content = b"".join(tensor.detach().numpy().tobytes() for tensor in network.state_dict().values())
    return hashlib.sha256(content).hexdigest()


def _fail(viewpoint: FloatArray) -> FloatArray:
    raise ValueError(f"no evidence at {viewpoint.shape}")
