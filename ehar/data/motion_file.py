"""Motion data on disk: the .npz of the schema, checked when it is read and written atomically."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.data.file_fields import (
    BOOL,
    FLOAT,
    INTEGER,
    SHARED,
    Array,
    Fields,
    parse_labels,
    parse_shared,
    parse_split,
    read_arrays,
    shared_arrays,
)
from ehar.data.motion_data import MotionData
from ehar.data.preparing.gaps import fill_gaps
from ehar.files import replacing

_NOTES = ("views", "recorded_ms")  # what is known of each sequence, if it is
SCHEMA = SHARED | {"labels", "missing", *_NOTES}


def load_motion(path: str | Path) -> MotionData:
    """Read motion data from an .npz of the schema; arrays that the schema does not name are ignored.

    In frames that `missing` names, positions may be NaN: they are interpolated joint by joint.

    Args:
        path: the file; its name without the suffix names the data in reports.

    Raises:
        DataError: the file is missing, is not an .npz, holds pickled objects (they are never loaded), or does not fit
            the schema.
    """
    path = Path(path)
    return parse_motion(Fields(str(path), read_arrays(path, SCHEMA)), name=path.stem)


def save_motion(path: str | Path, data: MotionData) -> None:
    """Write motion data as an .npz of the schema; a file of synthetic motion has one more array, `synthetic`.

    The file appears whole or not at all, and only if `load_motion` would accept it.

    Raises:
        DataError: the data breaks the schema.
        UsageError: the file cannot be written.
    """
    path = Path(path)
    arrays = _to_arrays(data)
    parse_motion(Fields(str(path), arrays), name=data.name)
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)


def parse_motion(fields: Fields, *, name: str, notes: tuple[str, ...] = ()) -> MotionData:
    """Return the motion of the arrays of a file.

    Args:
        fields: the arrays.
        name: name of the data.
        notes: what a reader has to tell.

    Raises:
        DataError: an array breaks the schema.
    """
    held = fields.get("labels", INTEGER, "sequences")
    count = len(held)
    missing = fields.get("missing", BOOL, "total_frames") if "missing" in fields.arrays else None
    frames = len(fields.get("positions", FLOAT, "total_frames", "persons", "joints", 3))
    if missing is not None and len(missing) != frames:
        raise fields.error("missing", f"got {len(missing)} frames, expected as many as positions have")
    shared = parse_shared(fields, sequences=count, missing=missing)
    sequence_names, class_names = shared["sequence_names"], shared["class_names"]
    labels = parse_labels(fields, "labels", held, class_names, lambda index: f"sequence {sequence_names[index]!r}")
    if missing is not None:
        shared["positions"] = _without_gaps(fields, shared, missing)
    known: dict[str, Any] = {
        name: fields.get(name, INTEGER, count).astype(np.int64) for name in _NOTES if name in fields.arrays
    }
    return MotionData(
        name=name,
        labels=labels,
        missing=missing,
        is_test=parse_split(fields, labels, np.arange(count), class_names, sequence_names),
        **shared,
        notes=notes,
        **known,
    )


def _without_gaps(fields: Fields, shared: Mapping[str, Any], missing: BoolArray) -> FloatArray:
    positions: FloatArray = shared["positions"].copy()
    for sequence, name in enumerate(shared["sequence_names"]):
        part = slice(*shared["offsets"][sequence : sequence + 2])
        if missing[part].any():
            where = f"{fields.where}: positions: sequence {name!r}"
            positions[part], _ = fill_gaps(positions[part], shared["skeleton"], where)
    return positions


def _to_arrays(data: MotionData) -> dict[str, Array]:
    arrays = {**shared_arrays(data), "labels": data.labels.astype(np.int32)}
    optional = (*_NOTES, "missing")
    return arrays | {name: getattr(data, name) for name in optional if getattr(data, name) is not None}
