"""Trained weights on disk: a safetensors file, and beside it a JSON file that describes the weights."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from safetensors import SafetensorError
from safetensors.torch import load_file, save
from torch import Tensor, nn

from ehar.conditions import Conditions
from ehar.errors import EharError, ModelError
from ehar.files import read_json, replacing, shortened
from ehar.flight.vehicle import LIMITS, Vehicle
from ehar.track import load_track
from ehar.world import World, load_world

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def description_path(path: Path) -> Path:
    """Return the path of the JSON that describes weights."""
    return path.with_suffix(".json")


def save_weights(path: Path, content: bytes, description: "DataclassInstance") -> None:
    """Write weights and their description.

    The weights appear last: where they lie, both files are whole and belong together, whenever a process is killed.

    Args:
        path: the safetensors file.
        content: the content of that file.
        description: a dataclass; its fields are the keys of the JSON.

    Raises:
        UsageError: a file cannot be written.
    """
    with replacing(path) as weights, replacing(description_path(path)) as told:  # the last one is put in place first
        weights.write_bytes(content)
        told.write_bytes((json.dumps(asdict(description), indent=1) + "\n").encode())
        path.unlink(missing_ok=True)  # a new description does not fit old weights


def network_bytes(network: nn.Module) -> bytes:
    """Return the content of a safetensors file with a network's weights."""
    return save({name: tensor.detach().cpu().contiguous() for name, tensor in network.state_dict().items()})


def check_files(path: Path, expected: str) -> None:
    """Raise a ModelError that says what was expected, if the weights or their description are missing."""
    for file in (path, description_path(path)):
        if not file.is_file():
            raise ModelError(f"{file}: no such file: expected {expected}")


def check_world(path: Path, trained: World, conditions: Conditions) -> None:
    """Raise a ModelError that names both worlds, unless weights were trained in the world that conditions ask for.

    Weights of the open world will do where there are obstacles or passers-by: bounds, moves and images are the same.
    So will weights that were trained with another localisation, or where it was known otherwise whose joints are whose,
    or nobody could ask what a worse one costs.
    """
    asked = replace(load_world(conditions.world), identity="known")
    trained = replace(trained, localisation=asked.localisation, identity="known")
    if not (trained.agrees_with(asked) or trained.agrees_with(asked.opened)):
        raise ModelError(
            f"{path}: trained in the world {trained}, asked for {asked}; "
            f"expected that world, or weights that are trained with --world {conditions.world_name}"
        )


def check_vehicle(path: Path, trained: Vehicle | None, conditions: Conditions) -> None:
    """Raise a ModelError that names what differs, unless what learned in flight learned with the conditions' vehicle.

    Names of weights tell vehicles apart. But two vehicle files may have one name, and a file may have changed. A body
    decides nothing that is learned.

    Args:
        path: the weights.
        trained: the vehicle of the training; None if nothing flew, or before it was recorded.
        conditions: conditions whose track the weights are to be used on.
    """
    asked = None if trained is None else load_track(conditions.track, load_world(conditions.world).workspace).vehicle
    if trained is None or asked is None:
        return
    for limit in LIMITS:
        before, now = getattr(trained, limit), getattr(asked, limit)
        if before != now:
            raise ModelError(
                f"{path}: learned with another vehicle that is called {trained.name!r}: its {limit} was {before:g}, "
                f"now it is {now:g}; train again, or give the other vehicle file another name"
            )


def check_trained_for(path: Path, what: str, trained: str, given: str, again: str) -> None:
    """Raise a ModelError that names both hashes, unless weights belong to what they are to be used with.

    Args:
        path: the weights.
        what: what they belong to, in words.
        trained: the hash of what they were trained for.
        given: the hash of what they are to be used with.
        again: what to do about it.
    """
    if trained != given:
        raise ModelError(
            f"{path}: trained for another {what}: its sha256 was {shortened(trained)}..., "
            f"this one's is {shortened(given)}...; {again}"
        )


def files_sha256(path: Path) -> str:
    """Return the hash of weights and their description."""
    return hashlib.sha256(path.read_bytes() + description_path(path).read_bytes()).hexdigest()


def load_tensors(path: Path, network: nn.Module, owner: str) -> dict[str, Tensor]:
    """Read the weights of a network.

    Args:
        path: the safetensors file.
        network: the network of these weights; it is not changed.
        owner: the owner of such a network, as named in errors: "an agent".

    Raises:
        ModelError: the file is missing or malformed, its tensors are not those of the network, or are not finite.
    """
    try:
        state: dict[str, Tensor] = load_file(path)
    except (SafetensorError, OSError) as error:
        reason = str(error).splitlines()[0]
        raise ModelError(f"{path}: expected the weights of {owner}, got {reason}") from error
    wanted = network.state_dict()
    wrong = sorted(
        name
        for name in wanted.keys() | state.keys()
        if name not in state
        or name not in wanted
        or (state[name].shape, state[name].dtype) != (wanted[name].shape, wanted[name].dtype)
    )
    if wrong:
        raise ModelError(f"{path}: {len(wrong)} tensors do not fit {owner} as described, first {wrong[0]!r}")
    for name, tensor in state.items():
        if not tensor.isfinite().all():
            raise ModelError(f"{path}: tensor {name!r} is not finite everywhere")
    return state


@dataclass(frozen=True)
class _Training:
    run: Mapping[str, Any]


@dataclass(frozen=True)
class _Trained:
    training: _Training


def recorded_run(path: Path) -> dict[str, Any]:
    """Return the settings that decided the result of a training; empty if the JSON of the weights has none."""
    try:
        trained = read_json(description_path(path), _Trained, "the description of trained weights", unknown=True)
    except EharError:
        return {}
    return dict(trained.training.run)
