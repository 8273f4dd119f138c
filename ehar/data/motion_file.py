"""Motion data on disk: the .npz of the schema, checked when it is read and written atomically."""

from pathlib import Path
from typing import Any

import numpy as np

from ehar.data.file_fields import (
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
from ehar.files import replacing

_NOTES = ("views", "recorded_ms")  # what is known of each sequence, if it is
_SCHEMA = SHARED | {"labels", *_NOTES}


def load_motion(path: str | Path) -> MotionData:
    """Read motion data from an .npz of the schema; arrays that the schema does not name are ignored.

    Args:
        path: the file; its name without the suffix names the data in reports.

    Raises:
        DataError: the file is missing, is not an .npz, holds pickled objects (they are never loaded), or does not fit
            the schema.
    """
    path = Path(path)
    return _parse(Fields(str(path), read_arrays(path, _SCHEMA)), name=path.stem)


def save_motion(path: str | Path, data: MotionData) -> None:
    """Write motion data as an .npz of the schema; a file of synthetic motion has one more array, `synthetic`.

    The file appears whole or not at all, and only if `load_motion` would accept it.

    Raises:
        DataError: the data breaks the schema.
        UsageError: the file cannot be written.
    """
    path = Path(path)
    arrays = _to_arrays(data)
    _parse(Fields(str(path), arrays), name=data.name)
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)


def _parse(fields: Fields, *, name: str) -> MotionData:
    held = fields.get("labels", INTEGER, "sequences")
    count = len(held)
    shared = parse_shared(fields, sequences=count)
    sequence_names, class_names = shared["sequence_names"], shared["class_names"]
    labels = parse_labels(fields, "labels", held, class_names, lambda index: f"sequence {sequence_names[index]!r}")
    notes: dict[str, Any] = {
        name: fields.get(name, INTEGER, count).astype(np.int64) for name in _NOTES if name in fields.arrays
    }
    return MotionData(
        name=name,
        labels=labels,
        is_test=parse_split(fields, labels, np.arange(count), class_names, sequence_names),
        **shared,
        **notes,
    )


def _to_arrays(data: MotionData) -> dict[str, Array]:
    arrays = {**shared_arrays(data), "labels": data.labels.astype(np.int32)}
    return arrays | {name: getattr(data, name) for name in _NOTES if getattr(data, name) is not None}
