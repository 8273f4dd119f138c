"""Trained agents on disk: safetensors for the weights, JSON for their description."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from ehar.conditions import Conditions
from ehar.data.recordings import Recordings
from ehar.errors import ModelError
from ehar.files import read_json
from ehar.world import LATER, PAPER, World
from planners.agents.agent import Agent
from planners.agents.network import AgentNetwork, AgentSpec
from planners.value.model import SHIPPED
from recognition.weight_files import (
    check_files,
    check_world,
    description_path,
    files_sha256,
    load_tensors,
    network_bytes,
    save_weights,
)


@dataclass(frozen=True)
class AgentDescription:
    """The JSON beside an agent's weights.

    Args:
        spec: the inputs that the network was built for.
        recogniser_sha256: hash of the recogniser that it was trained with.
        data_sha256: hash of the data that it was trained on.
        skeleton: names of the data's joints.
        classes: names of the data's classes.
        training: how it was trained; kept for people, and to tell one run from another.
        world: the world of the training.
    """

    spec: AgentSpec
    recogniser_sha256: str
    data_sha256: str
    skeleton: tuple[str, ...]
    classes: tuple[str, ...]
    training: dict[str, Any]
    world: World = PAPER

    @property
    def length(self) -> int | None:
        """The number of frames of the training's episodes; None if it is not recorded."""
        run = self.training.get("run")
        length = run.get("length") if isinstance(run, dict) else None
        return length if isinstance(length, int) else None


def agent_name(stage: str, without: str = "none") -> str:
    """Return the name of a training stage's agent; the name says what is left out, if anything."""
    return stage if without == "none" else f"{stage}-no-{without}"


def agent_path(directory: Path, name: str, conditions: Conditions, seed: int) -> Path:
    """Return the path of an agent's weights in a models directory; the JSON lies beside them."""
    form = "" if conditions.form == "causal" else f"{conditions.form}-"
    return directory / f"agent-{name}-{form}{conditions.seen}-seed{seed}.safetensors"


def agent_seeds(conditions: Conditions, data: Recordings, name: str) -> tuple[int, ...]:
    """Return the training seeds for which there is an agent of that name, in order."""
    folder = conditions.directory or SHIPPED / data.name
    first = agent_path(folder, name, conditions, seed=0).stem
    form = re.compile(re.escape(first.removesuffix("0")) + r"(0|[1-9][0-9]*)")
    found = (form.fullmatch(path.stem) for path in folder.glob("agent-*.safetensors"))
    return tuple(sorted(int(match[1]) for match in found if match))


def save_agent(
    path: Path,
    network: AgentNetwork,
    data: Recordings,
    *,
    recogniser_sha256: str,
    history: dict[str, Any],
    world: World = PAPER,
) -> None:
    """Save an agent, and beside it a description of its data, its recogniser and its training.

    Args:
        path: the safetensors file.
        network: the trained network.
        data: the data that it was trained on.
        recogniser_sha256: hash of the recogniser that it was trained with.
        history: how it was trained; only the length is read back with the agent.
        world: the world that it was trained in.
    """
    description = AgentDescription(
        spec=network.spec,
        recogniser_sha256=recogniser_sha256,
        data_sha256=data.sha256,
        skeleton=data.skeleton.joint_names,
        classes=data.class_names,
        training=history,
        world=world,
    )
    save_weights(path, network_bytes(network), description)


def load_agent(conditions: Conditions, data: Recordings, name: str, *, recogniser_sha256: str, seed: int) -> Agent:
    """Load an agent and check that it belongs to the data and the recogniser.

    Args:
        conditions: conditions of the training: folder, sensor, views and world.
        data: the data that it will be used on.
        name: name of the agent, as from `agent_name`.
        recogniser_sha256: hash of the recogniser that it will work with.
        seed: seed of its training.

    Raises:
        ModelError: the files are missing or malformed, or belong to another data set, recogniser or world.
    """
    path = agent_path(conditions.directory or SHIPPED / data.name, name, conditions, seed)
    check_files(
        path,
        f"an agent, as made by `ehar train agent {conditions.options} {conditions.models_option}`",
    )
    what = "an agent, as `ehar train agent` writes it"
    held = read_json(description_path(path), AgentDescription, what, wrong=ModelError, optional=LATER)
    check_world(path, held.world, conditions)
    _check_fit(path, held, data, recogniser_sha256)
    return Agent(name=name, network=_load_network(path, held), sha256=files_sha256(path), length=held.length)


def _check_fit(path: Path, held: AgentDescription, data: Recordings, recogniser_sha256: str) -> None:
    """Raise a ModelError that names what differs; names come before hashes, as they say more."""
    for what, trained, given in (
        ("skeleton", held.skeleton, data.skeleton.joint_names),
        ("set of classes", held.classes, data.class_names),
    ):
        if trained != given:
            raise ModelError(f"{path}: trained for another {what}: {trained}, {data.name} has {given}")
    for what, sha256, given_sha256 in (
        ("data set", held.data_sha256, data.sha256),
        ("recogniser", held.recogniser_sha256, recogniser_sha256),
    ):
        if sha256 != given_sha256:
            raise ModelError(
                f"{path}: trained for another {what}: its sha256 was {sha256[:12]}..., "
                f"this one's is {given_sha256[:12]}...; train the agent again"
            )


def _load_network(path: Path, held: AgentDescription) -> AgentNetwork:
    """Build a network and load its weights."""
    try:
        with torch.device("meta"):  # no memory is taken for sizes that the weights may not have
            network = AgentNetwork(held.spec, classes=len(held.classes))
    except (RuntimeError, TypeError) as error:
        raise ModelError(f"{path}: expected the weights of an agent, got {error}".splitlines()[0]) from error
    network.load_state_dict(load_tensors(path, network, "an agent"), assign=True)
    return network
