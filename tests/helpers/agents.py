"""Agents that nobody trained, but whose every weight matters: what they see decides where they go."""

from pathlib import Path

import numpy as np
import torch

from ehar.conditions import Conditions, Form
from ehar.data.motion_data import MotionData
from ehar.planner import Observation
from ehar.viewpoint import HOVER
from planners.agents.agent import Agent
from planners.agents.inputs import InputSizes
from planners.agents.network import AgentNetwork, AgentSpec
from planners.agents.storage import agent_path, save_agent
from tests.helpers.fakes import CLASS_NAMES, SKELETON, FakeRecogniser
from tests.helpers.random_networks import randomised


def untrained_network(
    *, without: tuple[str, ...] = (), persons: int = 1, hindsight: int = 0, seed: int = 0
) -> AgentNetwork:
    """Return a network for the tiny data and the fake recogniser."""
    sizes = InputSizes.of(
        persons=persons,
        joints=len(SKELETON.joint_names),
        classes=len(CLASS_NAMES),
        embedding=FakeRecogniser.embedding_size,
    )
    network = AgentNetwork(AgentSpec(sizes, without, hindsight), classes=len(CLASS_NAMES))
    randomised(network, seed)
    with torch.no_grad():
        network.actor.bias[HOVER] -= 2  # so that it goes somewhere
    return network


def untrained_agent(spec: str = "il", *, persons: int = 1) -> Agent:
    """Return the agent of a name such as il, il-ppo/1 or il-no-vision; one name, one agent."""
    _, _, left = spec.partition("/")[0].partition("-no-")
    network = untrained_network(without=(left,) if left else (), persons=persons, seed=sum(spec.encode()))
    return Agent(name=spec, network=network, sha256=f"of {spec}")


def save_untrained(
    directory: Path,
    data: MotionData,
    name: str,
    *,
    seed: int = 0,
    recogniser: str = "fake",
    like: str = "",
    form: Form = "causal",
) -> Path:
    """Save such an agent, or one with the weights of another name, where it belongs; return the weights' path."""
    path = agent_path(directory, name, Conditions(form=form), seed)
    save_agent(path, untrained_agent(like or f"{name}/{seed}").network, data, recogniser_sha256=recogniser, history={})
    return path


def random_observation(
    rng: np.random.Generator, *, frame: int = 0, length: int = 10, episodes: int = 5, persons: int = 1
) -> Observation:
    """Return what an episode of the tiny data might show, some of its joints missing."""
    joints = len(SKELETON.joint_names)
    logits = rng.normal(size=(episodes, len(CLASS_NAMES)), scale=3)
    return Observation(
        frame=frame,
        length=length,
        joints_2d=rng.uniform(100, 900, (episodes, persons, joints, 2)),
        confidence=rng.choice([0.0, 0.3, 1.0], (episodes, persons, joints)),
        viewpoint=rng.uniform([5, 0, 0], [15, 6.28, 1.57], (episodes, 3)),
        log_probs=logits - np.log(np.exp(logits).sum(axis=1, keepdims=True)),
        embedding=rng.normal(size=(episodes, FakeRecogniser.embedding_size)),
        velocity=np.zeros((episodes, 3)),
        acceleration=np.zeros((episodes, 3)),
    )
