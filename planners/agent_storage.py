"""Trained agents on disk: safetensors for the weights, JSON for what they were built and trained for."""

import hashlib
import json
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

from safetensors import SafetensorError
from safetensors.torch import load_file, save

from ehar.errors import ModelError
from ehar.motion_data import MotionData
from planners.agent import Agent
from planners.agent_inputs import ENCODED, InputSizes
from planners.agent_network import AgentNetwork, AgentSpec
from planners.gain_model import SHIPPED
from recognition.storage import write_whole


def agent_name(stage: str, without: str = "none") -> str:
    """Return what the agent of a training stage is called; one that goes without an encoder is named after it."""
    return stage if without == "none" else f"{stage}-no-{without}"


def agent_path(directory: Path, name: str, *, sensor: str, views: str, seed: int) -> Path:
    """Return where an agent's weights lie in a models directory; the JSON lies beside them."""
    return directory / f"agent-{name}-{sensor}-{views}-seed{seed}.safetensors"


def agent_seeds(directory: Path | None, data: MotionData, name: str, *, sensor: str, views: str) -> tuple[int, ...]:
    """Return the training seeds of which there is an agent of that name, in order."""
    folder = directory or SHIPPED / data.name
    form = re.compile(re.escape(agent_path(folder, name, sensor=sensor, views=views, seed=0).stem[:-1]) + r"(\d+)")
    found = (form.fullmatch(path.stem) for path in folder.glob(f"agent-{name}-*.safetensors"))
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
        history: how it was trained; kept for people, not read back.
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
    write_whole(path, save(state))
    write_whole(path.with_suffix(".json"), (json.dumps(description, indent=1) + "\n").encode())


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
        ModelError: the files are missing or malformed, or belong to other data, skeletons or recognisers.
    """
    path = agent_path(directory or SHIPPED / data.name, name, sensor=sensor, views=views, seed=seed)
    for file in (path, path.with_suffix(".json")):
        if not file.is_file():
            raise ModelError(
                f"{file}: no such file: expected an agent, as made by `ehar train agent --data {data.name} "
                f"--models {directory or 'DIR'} --sensor {sensor} --views {views}`"
            )
    network = _network(path, data, recogniser_sha256)
    content = path.read_bytes() + path.with_suffix(".json").read_bytes()
    return Agent(name=name, network=network, sha256=hashlib.sha256(content).hexdigest())


def _network(path: Path, data: MotionData, recogniser_sha256: str) -> AgentNetwork:
    """Return the network of a file that fits the data and the recogniser."""
    description_path = path.with_suffix(".json")
    try:
        description = json.loads(description_path.read_text())
        spec = description["spec"]
        sizes = InputSizes(**{size: int(value) for size, value in spec["sizes"].items()})
        without = tuple(str(left) for left in spec["without"])
        if not set(without) <= set(ENCODED):
            raise ValueError(f"without: expected some of {', '.join(ENCODED)}, got {without}")
        agent_spec = AgentSpec(sizes, without, int(spec["hindsight"]))
        fits = (
            ("data", str(description["data_sha256"]), data.sha256),
            ("recogniser", str(description["recogniser_sha256"]), recogniser_sha256),
        )
        skeleton, classes = tuple(description["skeleton"]), tuple(description["classes"])
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, OSError) as error:
        raise ModelError(
            f"{description_path}: expected the JSON that `ehar train agent` writes, got {error!r}"
        ) from error
    for what, trained, given in (
        ("skeleton", skeleton, data.skeleton.joint_names),
        ("classes", classes, data.class_names),
    ):
        if trained != given:
            raise ModelError(f"{path}: trained for another {what}: {trained}, {data.name} has {given}")
    for what, hash_trained, hash_given in fits:
        if hash_trained != hash_given:
            raise ModelError(
                f"{path}: trained for another {what}: "
                f"its sha256 was {hash_trained[:12]}..., this one's is {hash_given[:12]}...; "
                f"train the agent again"
            )
    network = AgentNetwork(agent_spec)
    try:
        state = load_file(path)
        network.load_state_dict(state)
    except (SafetensorError, OSError, RuntimeError) as error:
        raise ModelError(f"{path}: expected the weights of an agent, got {str(error).splitlines()[0]}") from error
    if not all(bool(weight.isfinite().all()) for weight in network.parameters()):
        raise ModelError(f"{path}: expected finite weights, got others")
    return network
