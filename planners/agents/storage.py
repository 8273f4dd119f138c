"""Trained agents on disk: safetensors for the weights, JSON for their description."""

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch

from ehar.conditions import Conditions
from ehar.data.recordings import Recordings
from ehar.data.streams.data import StreamData
from ehar.errors import ModelError
from ehar.files import read_json
from ehar.flight.vehicle import Vehicle
from ehar.track import IDEAL
from ehar.world import LATER as OBSTACLES
from ehar.world import PAPER, World
from planners.agents.agent import Agent
from planners.agents.network import AgentNetwork, AgentSpec
from planners.shipped import weights_folder
from recognition.weight_files import (
    check_files,
    check_trained_for,
    check_vehicle,
    check_world,
    description_path,
    files_sha256,
    load_tensors,
    network_bytes,
    save_weights,
)

LATER = ("streams", "vehicle", *OBSTACLES)  # fields that older descriptions do not have


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
        vehicle: the vehicle that flew; None on the grid.
    """

    spec: AgentSpec
    recogniser_sha256: str
    data_sha256: str
    skeleton: tuple[str, ...]
    classes: tuple[str, ...]
    training: dict[str, Any]
    world: World = PAPER
    vehicle: Vehicle | None = None

    @property
    def length(self) -> int | None:
        """The number of frames of the clips that it was trained on; None in streams, or if it is not recorded."""
        run = self.training.get("run")
        length = run.get("length") if isinstance(run, dict) else None
        return length if isinstance(length, int) and not self.spec.streams else None


def agent_name(stage: str, without: str = "none") -> str:
    """Return the name of a training stage's agent; the name says what is left out, if anything."""
    return stage if without == "none" else f"{stage}-no-{without}"


def agent_path(directory: Path, name: str, conditions: Conditions, seed: int) -> Path:
    """Return the path of an agent's weights in a models directory; the JSON lies beside them.

    The name tells the vehicle of an agent that was trained in flight.
    """
    form = "" if conditions.form == "causal" else f"{conditions.form}-"
    return directory / f"agent-{name}-{form}{conditions.seen}{conditions.flown_suffix}-seed{seed}.safetensors"


def agent_seeds(conditions: Conditions, data: Recordings, name: str) -> tuple[int, ...]:
    """Return the training seeds for which there is an agent of that name, in order.

    In flight they are those of agents that were trained on this track; where there are none, those of the grid's.
    """
    folder = weights_folder(conditions, data)
    return _seeds(folder, name, _trained_on(folder, name, conditions))


def _seeds(folder: Path, name: str, conditions: Conditions) -> tuple[int, ...]:
    first = agent_path(folder, name, conditions, seed=0).stem
    form = re.compile(re.escape(first.removesuffix("0")) + r"(0|[1-9][0-9]*)")
    found = (form.fullmatch(path.stem) for path in folder.glob("agent-*.safetensors"))
    return tuple(sorted(int(match[1]) for match in found if match))


def _trained_on(folder: Path, name: str, conditions: Conditions) -> Conditions:
    """Return conditions whose track is that of the training: the grid's, if no such agent has learned on theirs."""
    return conditions if _seeds(folder, name, conditions) else replace(conditions, track=IDEAL)


def save_agent(
    path: Path,
    network: AgentNetwork,
    data: Recordings,
    *,
    recogniser_sha256: str,
    history: dict[str, Any],
    world: World = PAPER,
    vehicle: Vehicle | None = None,
) -> None:
    """Save an agent, and beside it a description of its data, its recogniser and its training.

    Args:
        path: the safetensors file.
        network: the trained network.
        data: the data that it was trained on.
        recogniser_sha256: hash of the recogniser that it was trained with.
        history: how it was trained; only the length is read back with the agent.
        world: the world that it was trained in.
        vehicle: the vehicle that flew; None on the grid.
    """
    description = AgentDescription(
        spec=network.spec,
        recogniser_sha256=recogniser_sha256,
        data_sha256=data.sha256,
        skeleton=data.skeleton.joint_names,
        classes=data.class_names,
        training=history,
        world=world,
        vehicle=vehicle,
    )
    save_weights(path, network_bytes(network), description)


def load_agent(conditions: Conditions, data: Recordings, name: str, *, recogniser_sha256: str, seed: int) -> Agent:
    """Load an agent and check that it belongs to the data and the recogniser.

    Args:
        conditions: conditions of the training: folder, sensor, views and world; on a track that no such agent was
            trained on, it is one that was trained on the grid.
        data: the data that it will be used on.
        name: name of the agent, as from `agent_name`.
        recogniser_sha256: hash of the recogniser that it will work with.
        seed: seed of its training.

    Raises:
        ModelError: the files are missing or malformed, or belong to another data set, recogniser, world or
            vehicle, or to clips and not streams.
    """
    folder = weights_folder(conditions, data)
    path = agent_path(folder, name, _trained_on(folder, name, conditions), seed)
    held = _description(path, conditions)
    _check_fit(path, held, data, recogniser_sha256)
    return _agent(path, name, held)


def open_stream_agent(
    folder: Path, conditions: Conditions, name: str, *, recogniser_sha256: str, seed: int | None
) -> Agent:
    """Load an agent of streams without the data that it will be used on.

    Args:
        folder: the models directory.
        conditions: conditions of the training, as in `load_agent`.
        name: name of the agent, as from `agent_name`.
        recogniser_sha256: hash of the recogniser that it will work with; it stands for joints and classes too.
        seed: seed of its training; None means the first that is there.

    Raises:
        ModelError: the files are missing or malformed, or belong to clips, or to another recogniser, world or
            vehicle.
    """
    trained = _trained_on(folder, name, conditions)
    chosen = next(iter(_seeds(folder, name, trained)), 0) if seed is None else seed
    path = agent_path(folder, name, trained, chosen)
    held = _description(path, conditions)
    if not held.spec.streams:
        raise ModelError(f"{path}: trained on clips, expected an agent of streams: train it on streams")
    check_trained_for(path, "recogniser", held.recogniser_sha256, recogniser_sha256, "train the agent again")
    return _agent(path, name, held)


def _description(path: Path, conditions: Conditions) -> AgentDescription:
    """Read what lies beside an agent's weights, and check that it is of the conditions' world and vehicle."""
    check_files(
        path,
        f"an agent, as made by `ehar train agent {conditions.options} {conditions.models_option}`",
    )
    what = "an agent, as `ehar train agent` writes it"
    held = read_json(description_path(path), AgentDescription, what, wrong=ModelError, optional=LATER)
    check_world(path, held.world, conditions)
    check_vehicle(path, held.vehicle, conditions)
    return held


def _agent(path: Path, name: str, held: AgentDescription) -> Agent:
    network, localisation = _load_network(path, held), held.world.localisation if held.spec.streams else None
    return Agent(name=name, network=network, sha256=files_sha256(path), length=held.length, localisation=localisation)


def _check_fit(path: Path, held: AgentDescription, data: Recordings, recogniser_sha256: str) -> None:
    """Raise a ModelError that names what differs; names come before hashes, as they say more."""
    if held.spec.streams != isinstance(data, StreamData):
        kinds = ("clips", "streams") if isinstance(data, StreamData) else ("streams", "clips")
        raise ModelError(f"{path}: trained on {kinds[0]}, {data.name} holds {kinds[1]}; train the agent again")
    for what, trained, given in (
        ("skeleton", held.skeleton, data.skeleton.joint_names),
        ("set of classes", held.classes, data.class_names),
    ):
        if trained != given:
            raise ModelError(f"{path}: trained for another {what}: {trained}, {data.name} has {given}")
    check_trained_for(path, "data set", held.data_sha256, data.sha256, "train the agent again")
    check_trained_for(path, "recogniser", held.recogniser_sha256, recogniser_sha256, "train the agent again")


def _load_network(path: Path, held: AgentDescription) -> AgentNetwork:
    """Build a network and load its weights."""
    try:
        with torch.device("meta"):  # no memory is taken for sizes that the weights may not have
            network = AgentNetwork(held.spec, classes=len(held.classes) + held.spec.streams)  # and no activity
    except (RuntimeError, TypeError) as error:
        raise ModelError(f"{path}: expected the weights of an agent, got {error}".splitlines()[0]) from error
    network.load_state_dict(load_tensors(path, network, "an agent"), assign=True)
    return network
