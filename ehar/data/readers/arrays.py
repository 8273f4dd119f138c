"""A folder of arrays, .npy or .csv, and a small JSON beside them that says what they are."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from ehar.arrays import FloatArray
from ehar.data.motion_data import MotionData
from ehar.data.preparing.axes import Up, metres, up_rotation, upright
from ehar.data.preparing.gaps import without_empty_bodies
from ehar.data.preparing.layouts import layout_of
from ehar.data.readers.assembly import Clip, assemble
from ehar.data.readers.names import LABEL, compiled, visible_files
from ehar.data.recordings import UNKNOWN_SUBJECT
from ehar.data.skeleton import Skeleton
from ehar.errors import DataError
from ehar.files import read_json

SIDECAR = "ehar.json"
_FIELDS = {**LABEL, "subject": r"\d+", "split": "train|test"}


@dataclass(frozen=True, kw_only=True)
class ArraysFile:
    """The content of `ehar.json`.

    Args:
        joints: names of the joints, or a layout: coco17, kinect20, ntu25, smpl22 or body12.
        bones: pairs of joints, by index; none takes those of the layout.
        fps: frames per second.
        pattern: pattern of the file names: {label}, {subject} (a number) and {split} (train or test) are taken, other
            words in braces match anything.
        unit: unit of length: m, cm, mm, or a number of metres.
        up: axis that points up.
        persons: number of people in a frame.
        license: the license of the motion.
    """

    joints: str | tuple[str, ...]
    fps: Annotated[float, Gt(0)]
    pattern: str
    bones: tuple[tuple[Annotated[int, Ge(0)], Annotated[int, Ge(0)]], ...] = ()
    unit: str | float = "m"
    up: Up = "z"
    persons: Annotated[int, Ge(1)] = 1
    license: str = "unknown"

    def __post_init__(self) -> None:
        """Check words, and that bones are of these joints."""
        metres(self.unit), up_rotation(self.up)
        joints = self.skeleton.joint_names
        outside = [bone for bone in self.skeleton.bones if max(bone) >= len(joints)]
        if outside or not self.skeleton.bones:
            got = f"got {list(outside[0])}" if outside else "got none"
            raise DataError(f"bones: {got}, expected pairs of joints from 0 to {len(joints) - 1}")
        if len(set(joints)) < len(joints):
            raise DataError("joints: expected names that all differ")
        compiled(self.pattern, _FIELDS)

    @property
    def skeleton(self) -> Skeleton:
        """The skeleton of one person."""
        if not isinstance(self.joints, str):
            return Skeleton(self.joints, self.bones)
        layout = layout_of(self.joints)
        return Skeleton(layout.joint_names, self.bones or layout.bones)


def prepare_arrays(source: str | Path, *, unit: str = "m", up: Up = "z") -> MotionData:
    """Read a folder of .npy or .csv files, and an ehar.json.

    A .npy is (frames, persons, joints, 3), a .csv has a frame a row.

    NaN, an empty cell, or a body of zeros is what was not seen.

    For example:
        ehar data prepare arrays recordings mine.npz

    Args:
        source: folder of the files and of ehar.json.
        unit: correction of the unit that ehar.json says: mm makes lengths 1,000 times shorter.
        up: correction of the axis that points up, after that of ehar.json.

    Raises:
        DataError: ehar.json or an array is malformed, or a name does not fit the pattern.
    """
    source = Path(source)
    told = read_json(source / SIDECAR, ArraysFile, "a description of arrays", defaults=True)
    pattern = compiled(told.pattern, _FIELDS)
    files = visible_files(source, ".npy", ".csv")
    if not files:
        raise DataError(f"{source}: got no .npy and no .csv, expected a folder that holds some")

    def clips() -> Iterator[Clip]:
        for file in files:
            match = pattern.fullmatch(file.name) or pattern.fullmatch(file.stem + file.suffix.lower())
            if match is None:
                raise DataError(f"{file}: got a name that does not fit the pattern {told.pattern!r}")
            known = match.groupdict()
            motion = upright(read_array(file, told), unit=told.unit, up=told.up)
            yield Clip(
                file=file,
                name=file.relative_to(source).with_suffix("").as_posix(),
                label=known["label"],
                motion=without_empty_bodies(upright(motion, unit=unit, up=up)),
                is_test=known["split"] == "test" if "split" in known else None,
                subject=int(known.get("subject", UNKNOWN_SUBJECT)),
            )

    return assemble(
        clips(),
        name=source.resolve().name,
        skeleton=told.skeleton,
        fps=told.fps,
        license=told.license,
        persons=told.persons,
    )


def read_array(file: Path, told: ArraysFile) -> FloatArray:
    """Return the joints (T, P, J, 3) of one file, in its own unit and axes.

    Raises:
        DataError: the file cannot be read, or has another shape.
    """
    joints = len(told.skeleton.joint_names)
    held = _rows(file) if file.suffix.lower() == ".csv" else _npy(file)
    shape = (len(held), told.persons, joints, 3)
    fits = held.shape in (shape, (shape[0], *shape[2:])) if told.persons == 1 else held.shape == shape
    if file.suffix.lower() == ".csv":
        fits = held.shape[1] == told.persons * joints * 3
    if held.dtype.kind not in "fiu" or not fits or not len(held):
        expected = f"(frames, {told.persons}, {joints}, 3)"
        expected += f", or {told.persons * joints * 3} numbers a row" if file.suffix.lower() == ".csv" else ""
        raise DataError(f"{file}: got {held.dtype} of shape {held.shape}, expected numbers of shape {expected}")
    return held.astype(np.float64).reshape(shape)


def _npy(file: Path) -> np.ndarray:
    try:
        held = np.load(file, allow_pickle=False)
    except Exception as error:  # broken bytes can raise almost any error
        raise DataError(f"{file}: not a readable .npy: {' '.join(str(error).split())}") from error
    if not isinstance(held, np.ndarray) or not held.ndim:
        raise DataError(f"{file}: got an archive or a single number, expected one array")
    return held


def _rows(file: Path) -> np.ndarray:
    """Return the numbers of a .csv, (T, N), where an empty cell is NaN, without its header."""
    lines = file.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    cells = [[cell.strip() for cell in line.split(",")] for line in lines if line.strip()]
    first = 1 if cells and _is_header(cells[0]) else 0
    rows: list[list[float]] = []
    for number, row in enumerate(cells[first:], start=first + 1):
        values = [_number(cell) for cell in row]
        if None in values:
            raise DataError(f"{file}: line {number}: got {row[values.index(None)][:20]!r}, expected a number")
        if rows and len(row) != len(rows[0]):
            raise DataError(f"{file}: line {number}: got {len(row)} numbers, expected {len(rows[0])} as in the first")
        rows.append([value for value in values if value is not None])
    return np.array(rows) if rows else np.empty((0, 0))


def _is_header(row: list[str]) -> bool:
    """Return whether a first line names columns: by words, or by numbers from 0 on, as pandas writes them."""
    words = all(_number(cell) is None for cell in row)
    return words or (len(row) > 1 and row == [str(number) for number in range(len(row))])


def _number(cell: str) -> float | None:
    try:
        return float(cell) if cell else float("nan")
    except ValueError:
        return None
