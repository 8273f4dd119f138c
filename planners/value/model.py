"""The trained model of the planners that value views; on disk it is safetensors, with JSON beside them."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load_file, save

from ehar.arrays import IntArray, in_brief
from ehar.conditions import Conditions
from ehar.data.recordings import Recordings
from ehar.errors import ModelError
from ehar.files import read_json
from ehar.flight.vehicle import Vehicle
from ehar.localisation import Localisation
from ehar.track import IDEAL
from ehar.world import LATER as OBSTACLES
from ehar.world import PAPER, World
from planners.shipped import weights_folder
from planners.value.belief.clips import BeliefModel
from planners.value.belief.streams import StreamBeliefModel
from planners.value.field import GainField
from planners.value.situation import STREAM_LOOKAHEAD, USUAL_MEMORY
from recognition.weight_files import (
    check_files,
    check_trained_for,
    check_vehicle,
    check_world,
    description_path,
    files_sha256,
    save_weights,
)

FULL = "full"
# Fields that older descriptions do not have.
LATER = (*OBSTACLES, "stream_belief", "memory", "lookahead", "learned", "vehicle")


@dataclass(frozen=True, eq=False, repr=False)
class GainModel:
    """Gain fields, trained on the policy part of the training data, and belief, for one recogniser and sensor.

    Args:
        fields: gain fields by variant; `full` sees the whole situation, the others are for ablations.
        belief: the parameters of the belief, in clips or in streams.
        pairs: (pairs, 2) of [left, right], the joints of the trunk.
        sha256: hash of the files, recorded beside results.
        length: number of frames of the clips that it was trained on; None in streams, or if that is not recorded.
        memory: time that a view counts for in a stream [s]; of no use in clips.
        lookahead: time over which the shares of activities are expected in a stream [s]; of no use in clips.
        localisation: the localisation that it was trained with; None in clips, which have none.
        data_sha256: hash of the data that it was trained on; None if that is not recorded.
    """

    fields: dict[str, GainField]
    belief: BeliefModel | StreamBeliefModel
    pairs: IntArray
    sha256: str = ""
    length: int | None = None
    memory: float = USUAL_MEMORY
    lookahead: float = STREAM_LOOKAHEAD
    localisation: Localisation | None = None
    data_sha256: str | None = None

    __repr__ = in_brief


@dataclass(frozen=True)
class FieldDescription:
    """The entry of one gain field in the JSON; see `GainField`."""

    parts: tuple[str, ...]
    spread: float


@dataclass(frozen=True)
class GainDescription:
    """The JSON beside the weights of gain fields.

    Args:
        recogniser_sha256: hash of the recogniser whose outputs they were trained on.
        fields: the fields by variant.
        trunk: pairs of [left, right], the joints of the trunk.
        belief: the parameters of the belief in clips; None in streams.
        training: how they were trained; kept for people; only the length and the hash of the data are read back.
        world: the world of the training.
        stream_belief: the parameters of the belief in streams; None in clips.
        memory: time that a view counts for in a stream [s].
        lookahead: time over which the shares of activities are expected in a stream [s].
        vehicle: the vehicle that flew; None on the grid.
    """

    recogniser_sha256: str
    fields: dict[str, FieldDescription]
    trunk: tuple[tuple[int, int], ...]
    belief: BeliefModel | None
    training: dict[str, Any]
    world: World = PAPER
    stream_belief: StreamBeliefModel | None = None
    memory: float = USUAL_MEMORY
    lookahead: float = STREAM_LOOKAHEAD
    vehicle: Vehicle | None = None

    @property
    def length(self) -> int | None:
        """The number of frames of the training's clips; None in streams, or if it is not recorded."""
        length = self.training.get("length")
        return length if isinstance(length, int) and self.stream_belief is None else None

    @property
    def data_sha256(self) -> str | None:
        """The hash of the data of the training; None if it is not recorded."""
        sha256 = self.training.get("data_sha256")
        return sha256 if isinstance(sha256, str) else None


def gain_model_path(directory: Path, conditions: Conditions) -> Path:
    """Return the path of the fields' weights in a models directory; the JSON lies beside them.

    The name tells the vehicle of fields that were learned in flight.
    """
    return directory / f"gain-field-{conditions.seen}{conditions.flown_suffix}.safetensors"


def used_gain_model(directory: Path, conditions: Conditions) -> Path:
    """Return the path of the fields that planners use: those learned on this track, and without them the grid's."""
    path = gain_model_path(directory, conditions)
    return path if path.is_file() else gain_model_path(directory, replace(conditions, track=IDEAL))


def save_gain_model(
    path: Path,
    model: GainModel,
    *,
    recogniser_sha256: str,
    history: dict[str, Any],
    world: World = PAPER,
    vehicle: Vehicle | None = None,
) -> None:
    """Save a model, and beside it a description of its recogniser and its training.

    Args:
        path: the safetensors file.
        model: the trained model.
        recogniser_sha256: hash of the recogniser whose outputs it was trained on.
        history: how it was trained; kept for people; only the length and the hash of the data are read back.
        world: the world that it was trained in.
        vehicle: the vehicle that flew; None on the grid.
    """
    tensors = {
        f"{name}.{matrix}": np.ascontiguousarray(getattr(field, matrix))
        for name, field in model.fields.items()
        for matrix in ("absolute", "relative")
    }
    description = GainDescription(
        recogniser_sha256=recogniser_sha256,
        fields={name: FieldDescription(field.parts, field.spread) for name, field in model.fields.items()},
        trunk=tuple((int(left), int(right)) for left, right in model.pairs),
        belief=model.belief if isinstance(model.belief, BeliefModel) else None,
        training=history,
        world=world,
        stream_belief=model.belief if isinstance(model.belief, StreamBeliefModel) else None,
        memory=model.memory,
        lookahead=model.lookahead,
        vehicle=vehicle,
    )
    save_weights(path, save(tensors), description)


def load_gain_model(conditions: Conditions, data: Recordings, recogniser_sha256: str) -> GainModel:
    """Load a gain model and check that it belongs to the recogniser.

    Args:
        conditions: conditions of the training: folder, sensor, views and world.
        data: the data that it will be used on.
        recogniser_sha256: hash of the recogniser that it will work with.

    Raises:
        ModelError: the files are missing or malformed, or belong to another recogniser, world or vehicle.
    """
    path = used_gain_model(weights_folder(conditions, data), conditions)
    return open_gain_model(path, conditions, len(data.skeleton.joint_names), recogniser_sha256)


def open_gain_model(path: Path, conditions: Conditions, joint_count: int, recogniser_sha256: str) -> GainModel:
    """Load a gain model without the data that it will be used on.

    Args:
        path: the safetensors file.
        conditions: conditions of the training: folder, sensor, views and world.
        joint_count: number of joints of a person.
        recogniser_sha256: hash of the recogniser that it will work with.

    Raises:
        ModelError: as in `load_gain_model`.
    """
    check_files(
        path,
        f"a gain field, as made by `ehar train gain-field {conditions.options} {conditions.models_option}`",
    )
    file, what = description_path(path), "a gain field, as `ehar train gain-field` writes it"
    description = read_json(file, GainDescription, what, optional=LATER, wrong=ModelError)
    belief = description.stream_belief or description.belief
    if belief is None:
        raise ModelError(f"{file}: belief: expected the parameters of one, got null")
    joints = range(joint_count)
    if not description.trunk or any(joint not in joints for pair in description.trunk for joint in pair):
        got = str(description.trunk)[:80]
        raise ModelError(f"{file}: trunk: expected pairs of joints 0 to {len(joints) - 1}, got {got}")
    check_world(path, description.world, conditions)
    check_vehicle(path, description.vehicle, conditions)
    check_trained_for(
        path, "recogniser", description.recogniser_sha256, recogniser_sha256, "train the gain field again"
    )
    try:
        tensors = load_file(path)
        fields = {
            name: GainField(field.parts, tensors[f"{name}.absolute"], tensors[f"{name}.relative"], field.spread)
            for name, field in description.fields.items()
        }
    except (SafetensorError, OSError, KeyError, ModelError) as error:
        raise ModelError(f"{path}: expected the gain fields {', '.join(description.fields)}, got {error}") from error
    if FULL not in fields:
        raise ModelError(f"{path}: expected a gain field {FULL!r}, got {', '.join(fields) or 'none'}")
    pairs = np.array(description.trunk, dtype=np.int64)
    localisation = None if description.stream_belief is None else description.world.localisation
    return GainModel(
        fields,
        belief,
        pairs,
        sha256=files_sha256(path),
        length=description.length,
        memory=description.memory,
        lookahead=description.lookahead,
        localisation=localisation,
        data_sha256=description.data_sha256,
    )
