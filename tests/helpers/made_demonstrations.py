"""Demonstrations that never ran: frames from all over the workspace, and an oracle that is known."""

import numpy as np

from ehar.arrays import FloatArray
from planners.agents.demonstrations import Demonstrations
from planners.agents.network import AgentNetwork
from tests.helpers.agent_worlds import DOWN, UP
from tests.helpers.agents import untrained_network

LEVEL = 0.6  # the scaled polar angle that this oracle likes best


def worth(position: FloatArray) -> FloatArray:
    """Return what an oracle that likes a polar angle finds the 7 moves worth, (N, 7)."""
    values = np.zeros((len(position), 7))
    values[:, UP] = LEVEL - position[:, 3]
    values[:, DOWN] = position[:, 3] - LEVEL
    return values


def demonstrated(frames: int = 2000, *, seed: int = 0) -> Demonstrations:
    """Return frames from all over the workspace, with what that oracle says of them."""
    rng = np.random.default_rng(seed)
    sizes = untrained_network().spec.sizes
    position = rng.uniform(-1, 1, (frames, 4))
    position[:, 3] = rng.uniform(0, 1, frames)
    return Demonstrations(
        recognition=rng.standard_normal((frames, sizes.recognition)).astype(np.float16),
        vision=rng.standard_normal((frames, sizes.vision)).astype(np.float16),
        position=position.astype(np.float16),
        values=worth(position),
    )


def fresh(*, seed: int = 0, hindsight: int = 0) -> AgentNetwork:
    return AgentNetwork(untrained_network(hindsight=hindsight).spec, seed=seed)
