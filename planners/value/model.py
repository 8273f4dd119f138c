"""All that a planner which values views has learned, and where it lies on disk: safetensors, with JSON beside them."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load_file, save

from ehar.arrays import IntArray
from ehar.data.motion_data import MotionData
from ehar.errors import ModelError
from ehar.files import write_bytes
from planners.value.belief import BeliefModel
from planners.value.field import GainField

SHIPPED = Path(__file__).parents[1] / "weights"
FULL = "full"


@dataclass(frozen=True, eq=False)
class GainModel:
    """What is learned on the policy part of the training data, for one recogniser and sensor.

    Args:
        fields: gain fields by variant; `full` knows all of the situation, the others are for ablations.
        belief: how evidence comes in.
        pairs: (pairs, 2) of [left, right], the joints of the trunk.
        sha256: of the files, recorded beside results.
    """

    fields: dict[str, GainField]
    belief: BeliefModel
    pairs: IntArray
    sha256: str = ""


def gain_model_path(directory: Path, *, sensor: str, views: str) -> Path:
    """Return where the fields' weights lie in a models directory; the JSON lies beside them."""
    return directory / f"gain-field-{sensor}-{views}.safetensors"


def save_gain_model(path: Path, model: GainModel, *, recogniser_sha256: str, history: dict[str, Any]) -> None:
    """Save a model, and beside it which recogniser it belongs to and how it came about.

    Args:
        path: of the safetensors file.
        model: trained.
        recogniser_sha256: of the recogniser whose outputs it was trained on.
        history: how it was trained; kept for people, not read back.
    """
    tensors = {
        f"{name}.{matrix}": np.ascontiguousarray(getattr(field, matrix))
        for name, field in model.fields.items()
        for matrix in ("absolute", "relative")
    }
    description = {
        "recogniser_sha256": recogniser_sha256,
        "fields": {name: {"parts": field.parts, "spread": field.spread} for name, field in model.fields.items()},
        "trunk": model.pairs.tolist(),
        "belief": model.belief.to_dict(),
        "training": history,
    }
    write_bytes(path, save(tensors))
    write_bytes(path.with_suffix(".json"), (json.dumps(description, indent=1) + "\n").encode())


def load_gain_model(
    directory: Path | None, data: MotionData, *, sensor: str, views: str, recogniser_sha256: str
) -> GainModel:
    """Load a gain model and check that it belongs to the recogniser.

    Args:
        directory: of models; None means what is shipped for a synthetic set.
        data: what it will be used on.
        sensor: that it was trained with.
        views: the recogniser's training regime.
        recogniser_sha256: of the recogniser that it will work with.

    Raises:
        ModelError: the files are missing or malformed, or belong to another recogniser.
    """
    path = gain_model_path(directory or SHIPPED / data.name, sensor=sensor, views=views)
    for file in (path, path.with_suffix(".json")):
        if not file.is_file():
            raise ModelError(
                f"{file}: no such file: expected a gain field, as made by `ehar train gain-field --data {data.name} "
                f"--models {directory or 'DIR'} --sensor {sensor} --views {views}`"
            )
    try:
        description = json.loads(path.with_suffix(".json").read_text())
        trained_for = str(description["recogniser_sha256"])
        described = {
            str(name): (tuple(map(str, of["parts"])), float(of["spread"])) for name, of in description["fields"].items()
        }
        pairs = np.array(description["trunk"], dtype=np.int64).reshape(-1, 2)
        belief = BeliefModel.from_dict(description["belief"])
        joints = len(data.skeleton.joint_names)
        if len(pairs) == 0 or pairs.min() < 0 or pairs.max() >= joints:
            raise ValueError(f"trunk: expected pairs of joints 0 to {joints - 1}, got {pairs.tolist()}")
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, OSError, ModelError) as error:
        raise ModelError(
            f"{path.with_suffix('.json')}: expected the JSON that `ehar train gain-field` writes, got {error!r}"
        ) from error
    if trained_for != recogniser_sha256:
        raise ModelError(
            f"{path}: trained for another recogniser: its sha256 was {trained_for[:12]}..., "
            f"this one's is {recogniser_sha256[:12]}...; train the gain field again"
        )
    try:
        tensors = load_file(path)
        fields = {
            name: GainField(parts, tensors[f"{name}.absolute"], tensors[f"{name}.relative"], spread)
            for name, (parts, spread) in described.items()
        }
    except (SafetensorError, OSError, KeyError, ModelError) as error:
        raise ModelError(f"{path}: expected the gain fields {', '.join(described)}, got {error}") from error
    if FULL not in fields:
        raise ModelError(f"{path}: expected a gain field {FULL!r}, got {', '.join(fields) or 'none'}")
    content = path.read_bytes() + path.with_suffix(".json").read_bytes()
    return GainModel(fields, belief, pairs, hashlib.sha256(content).hexdigest())
