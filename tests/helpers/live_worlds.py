"""Streams and a recogniser of them that learned nothing, at 30 frames a second; and frames for a live loop."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ehar.arrays import FloatArray
from ehar.conditions import Conditions
from ehar.data.streams.file import save_streams
from ehar.track import IDEAL
from ehar.viewpoint import HOVER, cartesian
from ehar.world import PAPER, World
from planners.agents.inputs import InputSizes
from planners.agents.network import AgentNetwork, AgentSpec
from planners.agents.storage import agent_path, save_agent
from planners.value.belief.streams import StreamBeliefModel
from planners.value.model import gain_model_path, save_gain_model
from recognition.calibration import Temperature
from recognition.networks.spec import NetworkSpec
from recognition.storage import recogniser_path, recogniser_sha256, save_recogniser
from tests.helpers.fixed_places import save_place
from tests.helpers.gain_models import model_of, peak_weights
from tests.helpers.random_networks import randomised
from tests.helpers.streams import raising_streams

FPS = 30.0
START = np.array([8.0, 1.0, 1.2])  # a viewpoint
PEAK = np.array([7.0, 2.5, 1.4])
HEIGHTS = (-0.9, 0.4, 0.4, 0.0, 0.9, 0.9)  # of the joints of a frame's person; y points down


def save_live_world(folder: Path, *, fps: float = FPS, world: World = PAPER) -> Path:
    """Write raising.npz, and models for it as seen through the perfect sensor; return the folder.

    The gain field is best at `PEAK`, whatever is seen. Of agents, `il` was trained on the grid, with seeds 2 and 10,
    and `dagger` there with seed 0, and on px4-auto with seed 1.
    """
    data = raising_streams(people=8, seconds=12, fps=fps)
    folder.mkdir(exist_ok=True)
    save_streams(folder / "raising.npz", data)
    told = Conditions()
    spec = NetworkSpec.of(data, form="causal", size="small", length=30, world=world)
    network = spec.build()
    randomised(network)
    path, temperature = recogniser_path(folder / "models", told), Temperature((2.0,) * 5)
    save_recogniser(path, network, spec, temperature, {"run": {"size": "small"}})
    sha256 = recogniser_sha256(path, temperature)
    model = replace(model_of(peak_weights(PEAK)), belief=StreamBeliefModel.believing((0.25,) * 4))
    save_gain_model(gain_model_path(folder / "models", told), model, recogniser_sha256=sha256, history={}, world=world)
    save_place(folder / "models", recogniser_sha256=sha256, world=world)
    for name, track, seed in (("il", IDEAL, 2), ("il", IDEAL, 10), ("dagger", IDEAL, 0), ("dagger", "px4-auto", 1)):
        agent = _agent_network(spec, network.embedding_size, flown=track != IDEAL, seed=seed)
        weights = agent_path(folder / "models", name, Conditions(track=track), seed)
        save_agent(weights, agent, data, recogniser_sha256=sha256, history={}, world=world)
    return folder


def _agent_network(spec: NetworkSpec, embedding: int, *, flown: bool, seed: int) -> AgentNetwork:
    """Return an agent that learned nothing, and whose target moves with what it sees."""
    sizes = InputSizes.of(
        persons=spec.persons,
        joints=len(spec.skeleton.joint_names),
        classes=len(spec.class_names),
        embedding=embedding,
        streams=True,
        flown=flown,
    )
    network = AgentNetwork(AgentSpec(sizes, streams=True))
    randomised(network, seed)
    with torch.no_grad():
        network.actor.bias[HOVER] -= 2  # so that it goes somewhere
    return network


def person(x: float = 640.0, y: float = 360.0, *, size: float = 100.0) -> dict[str, Any]:
    """Return a person of six joints, in the recogniser's order, around a place in the image [px]."""
    keypoints = [[x + 10.0 * joint, y + size * height, 0.9] for joint, height in enumerate(HEIGHTS)]
    return {"keypoints": keypoints}


def frame(time: float, *people: dict[str, Any], viewpoint: FloatArray | None = START, **more: Any) -> dict[str, Any]:
    """Return a frame in the recogniser's order of joints; without a viewpoint, the camera's pose is missing."""
    held: dict[str, Any] = {"time": time, "joints": "own", "people": people, **more}
    if viewpoint is not None:
        held["camera"] = {"position": cartesian(viewpoint).tolist()}
    return held
