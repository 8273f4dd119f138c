"""Streams on disk: an .npz with `segments` in place of `labels`, checked when it is read and written atomically."""

import zipfile
from itertools import pairwise
from pathlib import Path

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
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
from ehar.data.streams.data import StreamData
from ehar.files import replacing

LEAP = 1.0  # [m] that people's middle cannot move in a frame
_SCHEMA = SHARED | {"segments", "missing"}


def load_streams(path: str | Path) -> StreamData:
    """Read streams from an .npz; arrays that the schema does not name are ignored.

    Where one segment begins before the one before it has ended, the earlier one ends there: annotators overlap. The
    notes of the data say so.

    Args:
        path: the file; its name without the suffix names the data in reports.

    Raises:
        DataError: the file is missing, is not an .npz, holds pickled objects, or does not fit the schema.
    """
    path = Path(path)
    return _parse(Fields(str(path), read_arrays(path, _SCHEMA)), name=path.stem)


def holds_streams(path: Path) -> bool:
    """Return whether a file is an archive with `segments`."""
    if not path.is_file() or not zipfile.is_zipfile(path):
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            return "segments.npy" in archive.namelist()
    except (zipfile.BadZipFile, OSError, ValueError):  # whoever reads it says what is wrong
        return False


def save_streams(path: str | Path, data: StreamData) -> None:
    """Write streams as an .npz.

    The file appears whole or not at all, and only if `load_streams` would accept it.

    Raises:
        DataError: the data breaks the schema.
        UsageError: the file cannot be written.
    """
    path = Path(path)
    arrays: dict[str, Array] = {**shared_arrays(data), "segments": data.segments.astype(np.int64)}
    arrays["missing"] = data.missing
    _parse(Fields(str(path), arrays), name=data.name)
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)


def _parse(fields: Fields, *, name: str) -> StreamData:
    frames = len(fields.get("positions", FLOAT, "total_frames", "persons", "joints", 3))
    missing = np.zeros(frames, dtype=bool)
    if "missing" in fields.arrays:
        missing = fields.get("missing", BOOL, frames)
    shared = parse_shared(fields, missing=missing)
    offsets, names, class_names = shared["offsets"], shared["sequence_names"], shared["class_names"]
    unseen = np.logical_and.reduceat(missing, offsets[:-1])
    if unseen.any():
        raise fields.error("missing", f"got no frame of sequence {names[unseen.argmax()]!r} that is not missing")
    shared["positions"] = _filled(shared["positions"], offsets)
    _refuse_leaps(fields, shared["positions"], offsets, missing, names)
    segments, notes = _parse_segments(fields, offsets, class_names)
    owners = np.searchsorted(offsets, segments[:, 0], side="right") - 1
    is_test = parse_split(fields, segments[:, 2], owners, class_names, names)
    return StreamData(name=name, segments=segments, missing=missing, is_test=is_test, notes=notes, **shared)


def _parse_segments(
    fields: Fields, offsets: IntArray, class_names: tuple[str, ...]
) -> tuple[IntArray, tuple[str, ...]]:
    """Return the segments in order, without overlaps, and a line that says which were cut, if any was."""
    held = fields.get("segments", INTEGER, "segments", 3).astype(np.int64)
    parse_labels(fields, "segments", held[:, 2], class_names, lambda index: f"segment {index}")
    segments = held[np.argsort(held[:, 0], kind="stable")]
    first, end = segments[:, 0], segments[:, 1]
    for wrong, problem in (
        (first >= end, "expected an end frame behind the first"),
        ((first < 0) | (end > offsets[-1]), f"expected frames from 0 to {offsets[-1]}"),
        (end > _ends(offsets, np.clip(first, 0, offsets[-1] - 1)), "expected an end within the same stream"),
        (np.append(np.diff(first) == 0, False), "expected no two that begin at the same frame"),
    ):
        if wrong.any():
            raise fields.error("segments", f"got {segments[wrong.argmax()].tolist()}, {problem}")
    cut, around = end[:-1] > first[1:], end[:-1] >= end[1:]
    notes: tuple[str, ...] = ()
    if cut.any():
        one = segments[(cut & around).argmax() if (cut & around).any() else cut.argmax()]
        notes = (
            f"{cut.sum()} of {len(segments)} segments overlap the next one and end where it begins, "
            f"{(cut & around).sum()} of them although it ends within them, such as {class_names[one[2]]!r} at frames "
            f"{one[0]} to {one[1]}",
        )
    segments[:-1, 1] = np.minimum(end[:-1], first[1:])
    return segments, notes


def _ends(offsets: IntArray, frames: IntArray) -> IntArray:
    """Return the end of the stream that each frame is in."""
    ends: IntArray = offsets[np.searchsorted(offsets, frames, side="right")]
    return ends


def _filled(positions: FloatArray, offsets: IntArray) -> FloatArray:
    """Return positions whose missing frames that hold NaN are interpolated within their stream."""
    holes = np.logical_not(np.isfinite(positions).all(axis=(1, 2, 3)))
    if not holes.any():
        return positions
    filled = positions.copy()
    for begin, end in pairwise(offsets):
        part = slice(begin, end)
        known = np.flatnonzero(~holes[part])
        flat = filled[part].reshape(part.stop - part.start, -1)
        at = np.flatnonzero(holes[part])
        after = np.clip(np.searchsorted(known, at), 0, len(known) - 1)
        low, high = known[np.maximum(after - (known[after] > at), 0)], known[after]
        share = np.where(high > low, (at - low) / np.maximum(high - low, 1), 0.0)[:, None].astype(np.float32)
        flat[at] = flat[low] * (1 - share) + flat[high] * share
    return filled


def _refuse_leaps(
    fields: Fields, positions: FloatArray, offsets: IntArray, missing: BoolArray, names: tuple[str, ...]
) -> None:
    """Raise a DataError where somebody moves farther in a frame than people do, and nothing is missing."""
    step = np.linalg.norm(np.diff(positions.mean(axis=2), axis=0), axis=-1).max(axis=1)
    step[offsets[1:-1] - 1] = 0
    step[missing[1:] | missing[:-1]] = 0
    if len(step) and step.max() > LEAP:
        frame = int(step.argmax()) + 1
        stream = int(np.searchsorted(offsets, frame, side="right")) - 1
        raise fields.error(
            "positions",
            f"got a person who moves {step.max():.1f} m into frame {frame - offsets[stream]} of sequence "
            f"{names[stream]!r}; expected at most {LEAP:g} m, or `missing` there",
        )
