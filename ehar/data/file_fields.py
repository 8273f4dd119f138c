"""The arrays of an .npz file, checked one by one for type and shape: what files of sequences and of streams share."""

import zipfile
import zlib
from collections.abc import Callable, Mapping, Set
from dataclasses import dataclass
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
import numpy.typing as npt

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.data.recordings import UNKNOWN_SUBJECT, Recordings
from ehar.data.skeleton import Skeleton
from ehar.errors import DataError

Array = npt.NDArray[Any]

FLOAT, INTEGER, NUMBER, TEXT, BOOL = "f", "iu", "fiu", "U", "b"
SHARED = {"positions", "offsets", "class_names", "sequence_names", "split", "subjects", "fps", "joint_names", "bones"}
SHARED |= {"license", "synthetic"}
_KIND_NAMES = {FLOAT: "floats", INTEGER: "integers", NUMBER: "a number", TEXT: "strings", BOOL: "a bool"}
_SPLIT_WORDS = ("train", "test")


def read_arrays(path: Path, schema: Set[str]) -> dict[str, Array]:
    """Read the arrays of a schema; others in the file are ignored.

    Raises:
        DataError: the file is missing, is not an .npz, or holds pickled objects; they are never loaded.
    """
    if not path.is_file():
        raise DataError(f"{path}: no such file; expected an .npz of motion data")
    try:
        path.open("rb").close()
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    if not zipfile.is_zipfile(path):
        raise DataError(f"{path}: not an .npz file (an .npz is a zip archive of numpy arrays)")
    field = "the archive"
    arrays = {}
    try:
        with np.load(path, allow_pickle=False) as archive:
            for field in sorted(schema & set(archive.files)):
                arrays[field] = archive[field]
                if not isinstance(arrays[field], np.ndarray):  # numpy hands out what is no array as bytes
                    raise ValueError("expected an array as numpy saves it")
    except (
        ValueError,
        OSError,
        EOFError,
        KeyError,
        MemoryError,
        RuntimeError,
        SyntaxError,
        TokenError,  # numpy reads the header of an array as Python
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        if "allow_pickle" in str(error):
            raise DataError(
                f"{path}: {field}: got an object array, a pickle; expected plain numbers or text"
            ) from error
        raise DataError(f"{path}: {field}: cannot be read: {_one_line(error)}") from error
    return arrays


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


@dataclass(frozen=True)
class Fields:
    """The arrays of one file; each is checked for type and shape when it is read."""

    where: str
    arrays: Mapping[str, Array]

    def error(self, field: str, problem: str) -> DataError:
        """Return an error that names the file and the array."""
        return DataError(f"{self.where}: {field}: {problem}")

    def get(self, field: str, kinds: str, *shape: int | str) -> Array:
        """Return an array of the shape; a word in the shape stands for any length of at least 1."""
        if field not in self.arrays:
            raise self.error(field, f"missing; the file holds {', '.join(sorted(self.arrays)) or 'none of the schema'}")
        array = self.arrays[field]
        if array.dtype.kind not in kinds:
            raise self.error(field, f"got dtype {array.dtype}, expected {_KIND_NAMES[kinds]}")
        fits = array.ndim == len(shape) and all(
            got == want if isinstance(want, int) else got > 0 for got, want in zip(array.shape, shape, strict=True)
        )
        if not fits:
            wanted = ", ".join(str(length) for length in shape) + ("," if len(shape) == 1 else "")
            raise self.error(field, f"got shape {array.shape}, expected ({wanted})")
        return array

    def names(self, field: str, *shape: int | str) -> tuple[str, ...]:
        """Return names (n,); all of them have to differ."""
        names = tuple(str(name) for name in self.get(field, TEXT, *shape))
        twice = sorted({name for name in names if names.count(name) > 1}) if len(set(names)) < len(names) else []
        if twice:
            raise self.error(field, f"{twice[0]!r} appears {names.count(twice[0])} times; every name must differ")
        return names


def parse_shared(
    fields: Fields, *, sequences: int | str = "sequences", missing: BoolArray | None = None
) -> dict[str, Any]:
    """Return what all recordings have, by the names of `Recordings`, but for the split.

    Args:
        fields: the arrays.
        sequences: number of sequences, if it is known.
        missing: (frames,) frames whose positions need not be finite.
    """
    positions = fields.get("positions", FLOAT, "total_frames", "persons", "joints", 3)
    frames, persons, joints, _ = positions.shape
    sequence_names = fields.names("sequence_names", sequences)
    offsets = _parse_offsets(fields, sequence_names, frames)
    missing = np.zeros(frames, dtype=bool) if missing is None else missing
    return {
        "positions": _parse_positions(fields, positions, offsets, sequence_names, missing),
        "offsets": offsets,
        "class_names": fields.names("class_names", "classes"),
        "sequence_names": sequence_names,
        "fps": _parse_fps(fields),
        "skeleton": _parse_skeleton(fields, joints),
        "subjects": _parse_subjects(fields, len(sequence_names), persons),
        "license": str(fields.get("license", TEXT)[()]),
        "synthetic": bool(fields.get("synthetic", BOOL)) if "synthetic" in fields.arrays else False,
    }


def parse_labels(
    fields: Fields, field: str, labels: IntArray, class_names: tuple[str, ...], owner: Callable[[int], str]
) -> IntArray:
    """Return labels (N,), all of which are classes; `owner` names what the n-th label is of, in errors."""
    outside = np.flatnonzero((labels < 0) | (labels >= len(class_names)))
    if outside.size:
        got = f"got {labels[outside[0]]} for {owner(int(outside[0]))}"
        raise fields.error(field, f"{got}, expected 0 to {len(class_names) - 1}")
    return labels.astype(np.int64)


def shared_arrays(data: Recordings) -> dict[str, Array]:
    """Return the arrays of a file that all recordings have.

    Raises:
        DataError: the number of a subject is too large.
    """
    arrays: dict[str, Array] = {
        "positions": data.positions,
        "offsets": data.offsets.astype(np.int64),
        "class_names": np.array(data.class_names, dtype=np.str_),
        "sequence_names": np.array(data.sequence_names, dtype=np.str_),
        "subjects": _as_int32(data.subjects, "subjects"),
        "fps": np.array(data.fps, dtype=np.float32),
        "joint_names": np.array(data.skeleton.joint_names, dtype=np.str_),
        "bones": data.skeleton.bone_indices.astype(np.int32),
        "license": np.array(data.license, dtype=np.str_),
    }
    if data.is_test is not None:
        arrays["split"] = np.where(data.is_test, "test", "train")
    if data.synthetic:
        arrays["synthetic"] = np.array(True)
    return arrays


def _as_int32(numbers: IntArray, field: str) -> IntArray:
    """Return numbers as the file holds them; one that it cannot hold would become another one."""
    most = np.iinfo(np.int32).max
    if numbers.size and numbers.max() > most:
        raise DataError(f"{field}: got {numbers.max()}, expected at most {most}")
    return numbers.astype(np.int32)


def _parse_offsets(fields: Fields, sequence_names: tuple[str, ...], frames: int) -> IntArray:
    offsets = fields.get("offsets", INTEGER, len(sequence_names) + 1).astype(np.int64)
    if offsets[0] != 0:
        raise fields.error("offsets", f"got {offsets[0]} first, expected 0")
    falling = np.flatnonzero(np.diff(offsets) <= 0)
    if falling.size:
        i = falling[0]
        got = f"got {offsets[i]} then {offsets[i + 1]} around sequence {sequence_names[i]!r}"
        raise fields.error("offsets", f"{got}, expected increasing numbers")
    if offsets[-1] != frames:
        raise fields.error("offsets", f"got {offsets[-1]} last, expected {frames}, the number of frames in positions")
    return offsets


def _parse_positions(
    fields: Fields, positions: FloatArray, offsets: IntArray, sequence_names: tuple[str, ...], missing: BoolArray
) -> FloatArray:
    with np.errstate(over="ignore"):  # numbers beyond float32 become infinite and are refused below
        positions = np.ascontiguousarray(positions, dtype=np.float32)
    wrong = np.flatnonzero(~np.isfinite(positions).all(axis=(1, 2, 3)) & ~missing)
    if wrong.size:
        frame = wrong[0]
        sequence = int(np.searchsorted(offsets, frame, side="right")) - 1
        kind = "NaN" if np.isnan(positions[frame]).any() else "infinite"
        where = f"sequence {sequence_names[sequence]!r}, frame {frame - offsets[sequence]}"
        more = f", and {wrong.size - 1} more frames" if wrong.size > 1 else ""
        raise fields.error("positions", f"got {kind} in {where}{more}; expected finite metres, or `missing` there")
    return positions


def _parse_skeleton(fields: Fields, joints: int) -> Skeleton:
    joint_names = fields.names("joint_names", joints)
    if "bones" in fields.arrays and fields.arrays["bones"].shape == (0, 2):
        raise fields.error("bones", "got none, expected at least one pair of joints")
    bones = fields.get("bones", INTEGER, "bones", 2).astype(np.int64)
    outside = np.flatnonzero(((bones < 0) | (bones >= joints)).any(axis=1))
    if outside.size:
        pair = bones[outside[0]].tolist()
        raise fields.error("bones", f"got {pair} as bone {outside[0]}, expected joints from 0 to {joints - 1}")
    return Skeleton(joint_names=joint_names, bones=tuple((int(a), int(b)) for a, b in bones))


def _parse_fps(fields: Fields) -> float:
    # By way of text, so that a float32 of 29.97 becomes 29.97, and a saved file keeps its hash.
    fps = float(str(np.float32(fields.get("fps", NUMBER)[()])))
    if not (np.isfinite(fps) and fps > 0):
        raise fields.error("fps", f"got {fps}, expected frames per second above 0")
    return fps


def parse_split(
    fields: Fields, labels: IntArray, owners: IntArray, class_names: tuple[str, ...], sequence_names: tuple[str, ...]
) -> BoolArray | None:
    """Return which sequences are for tests, None without a split.

    Args:
        fields: the arrays.
        labels: (N,) the class of each activity.
        owners: (N,) the sequence that it is in.
        class_names: names of classes.
        sequence_names: names of sequences.
    """
    if "split" not in fields.arrays:
        return None
    split = fields.get("split", TEXT, len(sequence_names))
    unknown = np.flatnonzero(~np.isin(split, _SPLIT_WORDS))
    if unknown.size:
        i = unknown[0]
        got = f"got {str(split[i])!r} for sequence {sequence_names[i]!r}"
        raise fields.error("split", f"{got}, expected {' or '.join(_SPLIT_WORDS)}")
    for word in _SPLIT_WORDS:
        counts = np.bincount(labels[(split == word)[owners]], minlength=len(class_names))
        if not counts.all():
            lacking = ", ".join(class_names[k] for k in np.flatnonzero(counts == 0))
            raise fields.error("split", f"no {word} sequence of {lacking}; expected at least one of every class")
    is_test: BoolArray = split == "test"
    return is_test


def _parse_subjects(fields: Fields, sequences: int, persons: int) -> IntArray:
    if "subjects" not in fields.arrays:
        return np.full((sequences, persons), UNKNOWN_SUBJECT)
    one_for_all = fields.arrays["subjects"].ndim == 1
    subjects = fields.get("subjects", INTEGER, *((sequences,) if one_for_all else (sequences, persons)))
    if (subjects < UNKNOWN_SUBJECT).any():
        raise fields.error("subjects", f"got {subjects.min()}, expected numbers from 0, or -1 for unknown")
    if one_for_all:
        subjects = np.repeat(subjects[:, None], persons, axis=1)
    return subjects.astype(np.int64)
