"""Trained agents on disk: safetensors for the weights, JSON for what they were built and trained for."""

import hashlib
import json
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save

from ehar.data.motion_data import MotionData
from ehar.errors import ModelError
from ehar.files import write_bytes
from planners.agents.agent import Agent
from planners.agents.inputs import InputSizes
from planners.agents.network import AgentNetwork, AgentSpec
from planners.value.model import SHIPPED


def agent_name(stage: str, without: str = "none") -> str:
    """Return what the agent of a training stage is called; one that goes without an encoder is named after it."""
    return stage if without == "none" else f"{stage}-no-{without}"


def agent_path(directory: Path, name: str, *, sensor: str, views: str, seed: int) -> Path:
    """Return where an agent's weights lie in a models directory; the JSON lies beside them."""
    return directory / f"agent-{name}-{sensor}-{views}-seed{seed}.safetensors"


def agent_seeds(directory: Path | None, data: MotionData, name: str, *, sensor: str, views: str) -> tuple[int, ...]:
    """Return the training seeds of which there is an agent of that name, in order."""
    folder = directory or SHIPPED / data.name
    first = agent_path(folder, name, sensor=sensor, views=views, seed=0).stem
    form = re.compile(re.escape(first.removesuffix("0")) + r"(0|[1-9][0-9]*)")
    found = (form.fullmatch(path.stem) for path in folder.glob("agent-*.safetensors"))
    return tuple(sorted(int(match[1]) for match in found if match))


def save_agent(
    path: Path, network: AgentNetwork, data: MotionData, *, recogniser_sha256: str, history: dict[str, Any]
) -> None:
    """Save an agent, and beside it for which data and recogniser it was trained, and how.

    Args:
        path: of the safetensors file.
        network: trained.
        data: that it was trained on.
        recogniser_sha256: of the recogniser that it was trained with.
        history: how it was trained; not read back with the agent.
    """
    description = {
        "spec": asdict(network.spec),
        "recogniser_sha256": recogniser_sha256,
        "data_sha256": data.sha256,
        "skeleton": data.skeleton.joint_names,
        "classes": data.class_names,
        "training": history,
    }
    state = {name: tensor.detach().cpu().contiguous() for name, tensor in network.state_dict().items()}
    write_bytes(path, save(state))
    write_bytes(path.with_suffix(".json"), (json.dumps(description, indent=1) + "\n").encode())


def load_agent(
    directory: Path | None, data: MotionData, name: str, *, sensor: str, views: str, recogniser_sha256: str, seed: int
) -> Agent:
    """Load an agent and check that it belongs to the data and the recogniser.

    Args:
        directory: of models; None means what is shipped for a synthetic set.
        data: what it will be used on.
        name: il, ppo, il-ppo, or one of these with what it goes without.
        sensor: that it was trained with.
        views: the recogniser's training regime.
        recogniser_sha256: of the recogniser that it will work with.
        seed: of its training.

    Raises:
        ModelError: the files are missing or malformed, or belong to another data set or recogniser.
    """
    path = agent_path(directory or SHIPPED / data.name, name, sensor=sensor, views=views, seed=seed)
    for file in (path, path.with_suffix(".json")):
        if not file.is_file():
            raise ModelError(
                f"{file}: no such file: expected an agent, as made by `ehar train agent --data {data.name} "
                f"--models {directory or 'DIR'} --sensor {sensor} --views {views}`"
            )
    held = _read_description(path.with_suffix(".json"))
    _check_fit(path, held, data, recogniser_sha256)
    network = _load_network(path, held.spec)
    content = path.read_bytes() + path.with_suffix(".json").read_bytes()
    return Agent(name=name, network=network, sha256=hashlib.sha256(content).hexdigest())


class _Description(NamedTuple):
    """What lies beside the weights: what the network was built and trained for."""

    spec: AgentSpec
    skeleton: tuple[str, ...]
    classes: tuple[str, ...]
    data_sha256: str
    recogniser_sha256: str


def _read_description(path: Path) -> _Description:
    """Read the JSON beside the weights."""
    try:
        held = json.loads(path.read_text())
        spec = held["spec"]
        return _Description(
            spec=AgentSpec(
                sizes=InputSizes(**{name: int(size) for name, size in spec["sizes"].items()}),
                without=tuple(spec["without"]),
                hindsight=int(spec["hindsight"]),
            ),
            skeleton=tuple(held["skeleton"]),
            classes=tuple(held["classes"]),
            data_sha256=str(held["data_sha256"]),
            recogniser_sha256=str(held["recogniser_sha256"]),
        )
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, OSError, ModelError) as error:
        raise ModelError(f"{path}: expected the JSON that `ehar train agent` writes, got {error!r}") from error


def _check_fit(path: Path, held: _Description, data: MotionData, recogniser_sha256: str) -> None:
    """Raise a ModelError that names what differs; names before hashes, as they say more."""
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


def _load_network(path: Path, spec: AgentSpec) -> AgentNetwork:
    """Build a network and load its weights."""
    try:
        state = load_file(path)
        with torch.device("meta"):  # no memory is taken for sizes that the weights may not have
            network = AgentNetwork(spec)
    except (SafetensorError, OSError, RuntimeError, TypeError) as error:
        raise ModelError(f"{path}: expected the weights of an agent, got {error}".splitlines()[0]) from error
    wanted = network.state_dict()
    wrong = sorted(
        name
        for name in wanted.keys() | state.keys()
        if name not in state
        or name not in wanted
        or (state[name].shape, state[name].dtype) != (wanted[name].shape, wanted[name].dtype)
    )
    if wrong:
        raise ModelError(f"{path}: {len(wrong)} tensors do not fit the agent that is expected, first {wrong[0]!r}")
    for name, tensor in state.items():
        if not tensor.isfinite().all():
            raise ModelError(f"{path}: tensor {name!r} is not finite everywhere")
    network.load_state_dict(state, assign=True)
    return network
