"""Checkpoints of trainings: one safetensors file, with JSON in its metadata for everything that is not a tensor."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from safetensors import safe_open
from safetensors.torch import save
from torch import Tensor

from ehar.files import write_bytes

HELD = "held"  # the key of the JSON
OPTIMISER = "optimiser"


class Checkpoint(NamedTuple):
    """The state of a training that was stopped.

    Args:
        states: state_dicts of networks, by names without a slash.
        optimiser: state_dict of the optimiser; None if it has made no step.
        held: everything else, for JSON.
    """

    states: Mapping[str, Mapping[str, Tensor]]
    optimiser: dict[str, Any] | None
    held: dict[str, Any]


def save_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Write a checkpoint; a reader finds the previous checkpoint or this one, never half of one."""
    tensors = {f"{name}/{key}": value for name, state in checkpoint.states.items() for key, value in state.items()}
    held = {**checkpoint.held, OPTIMISER: None}
    if checkpoint.optimiser is not None:
        held[OPTIMISER] = checkpoint.optimiser["param_groups"]
        for parameter, state in checkpoint.optimiser["state"].items():
            tensors |= {f"{OPTIMISER}/{parameter}/{key}": value for key, value in state.items()}
    content = save({name: tensor.contiguous() for name, tensor in tensors.items()}, {HELD: json.dumps(held)})
    write_bytes(path, content)


def load_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint, with tensors of the CPU: who loads a state moves what belongs on a GPU, and no counters.

    Args:
        path: the file.

    Raises:
        Exception: the file is damaged, or is not a checkpoint; the damage decides the type of the error.
    """
    states: dict[str, dict[str, Tensor]] = {}
    moments: dict[int, dict[str, Tensor]] = {}
    with safe_open(path, framework="pt") as file:
        held = dict(json.loads(file.metadata()[HELD]))
        for name in file.keys():
            tensor = file.get_tensor(name)
            if name.startswith(f"{OPTIMISER}/"):
                _, parameter, key = name.split("/")
                moments.setdefault(int(parameter), {})[key] = tensor
            else:
                network, key = name.split("/", 1)
                states.setdefault(network, {})[key] = tensor
    groups = held.pop(OPTIMISER)
    return Checkpoint(states, None if groups is None else {"state": moments, "param_groups": groups}, held)
