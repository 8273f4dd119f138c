"""HumanML3D: motion of one person as 22 joints of SMPL, 20 frames a second, y up, with captions.

`new_joints/012314.npy` is (frames, 22, 3) in metres. Captions are no classes: a class is the first verb of the first
caption, or what a .csv says. `test.txt` names the sequences of the published test.
"""

import csv
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.motion_data import MotionData
from ehar.data.preparing.axes import Up, upright
from ehar.data.preparing.layouts import SMPL22
from ehar.data.readers.assembly import Clip, assemble
from ehar.data.readers.names import matching_files
from ehar.errors import DataError, UsageError

FPS = 20.0
JOINTS = len(SMPL22.joint_names)


def prepare_humanml3d(
    source: str | Path, *, labels: Path | None = None, least: int = 1, unit: str = "m", up: Up = "y"
) -> MotionData:
    """Read the joints of HumanML3D.

    A class is the first verb of the first caption, unless --labels says otherwise.

    For example:
        ehar data prepare humanml3d HumanML3D humanml3d.npz --least 100
        ehar data prepare humanml3d HumanML3D mine.npz --labels mine.csv

    Args:
        source: folder that holds new_joints, texts and test.txt.
        labels: .csv with a name and a class a row; what it does not name is left out.
        least: sequences that a class has at least; smaller classes are left out.
        unit: unit of length in the files: m, cm, mm, or a number of metres.
        up: axis that points up in the files.

    Raises:
        UsageError: `least` is below 1.
        DataError: nothing names the classes, or a file does not hold 22 joints a frame.
    """
    source = Path(source)
    if least < 1:
        raise UsageError(f"least: got {least}, expected at least 1")
    folder = source / "new_joints"
    files = matching_files(folder if folder.is_dir() else source, ".npy", "new_joints of HumanML3D")
    class_of = _labels_of_rows(labels) if labels is not None else _labels_of_captions(source / "texts")
    counts = Counter(class_of[file.stem] for file in files if file.stem in class_of)
    chosen = [file for file in files if file.stem in class_of and counts[class_of[file.stem]] >= least]
    if not chosen:
        raise DataError(f"{source}: got no sequence with a class of at least {least}, of {len(files)} files")
    tests = _names(source / "test.txt")

    def clips() -> Iterator[Clip]:
        for file in chosen:
            yield Clip(
                file=file,
                name=file.stem,
                label=class_of[file.stem],
                motion=upright(read_joints(file), unit=unit, up=up)[:, None],
                is_test=None if tests is None else file.stem in tests,
            )

    left_out = len(files) - len(chosen)
    return assemble(
        clips(),
        name="humanml3d",
        skeleton=SMPL22,
        fps=FPS,
        license="of AMASS and HumanAct12, from which HumanML3D is made: research use, do not redistribute",
        notes=(f"{left_out} of {len(files)} files have no class, or one of fewer than {least}",) if left_out else (),
    )


def read_joints(file: Path) -> FloatArray:
    """Return the joints (T, 22, 3) of one file, in its own unit and axes; NaN where it has no finite numbers.

    In the data set as it is made two files are NaN throughout, 007975 and its mirror image.

    Raises:
        DataError: the file is no .npy, or does not hold numbers of this shape.
    """
    try:
        held = np.load(file, allow_pickle=False)
    except Exception as error:  # broken bytes can raise almost any error
        raise DataError(f"{file}: not a readable .npy: {' '.join(str(error).split())}") from error
    if not isinstance(held, np.ndarray) or held.dtype.kind != "f" or held.ndim != 3 or not len(held):
        raise DataError(f"{file}: got {_described(held)}, expected floats (frames, {JOINTS}, 3)")
    if held.shape[1:] != (JOINTS, 3):
        hint = "; vectors of 263 numbers are new_joint_vecs, expected new_joints" if held.shape[-1] == 263 else ""
        raise DataError(f"{file}: got {_described(held)}, expected floats (frames, {JOINTS}, 3){hint}")
    return np.where(np.isfinite(held), held, np.nan).astype(np.float64)


def _described(held: object) -> str:
    return f"{held.dtype} of shape {held.shape}" if isinstance(held, np.ndarray) else "an archive"


def _labels_of_rows(file: Path) -> dict[str, str]:
    try:
        rows = [row for row in csv.reader(file.read_text(encoding="utf-8-sig").splitlines()) if row]
    except (OSError, ValueError, csv.Error) as error:
        raise DataError(f"{file}: expected a .csv of names and classes, got {error}") from error
    for number, row in enumerate(rows, start=1):
        if len(row) != 2 or not all(cell.strip() for cell in row):
            raise DataError(f"{file}: row {number}: got {','.join(row)[:40]!r}, expected a name and a class")
    return {name.strip(): label.strip() for name, label in rows}


def _labels_of_captions(folder: Path) -> dict[str, str]:
    """Return the first verb of each first caption; `a person walks#a/DET person/NOUN walk/VERB#0.0#0.0`."""
    if not folder.is_dir():
        raise DataError(f"{folder}: no such folder; expected texts of HumanML3D there, or --labels with a .csv")
    found = {}
    for file in sorted(folder.glob("*.txt")):
        caption = file.read_text(encoding="utf-8", errors="replace").partition("\n")[0]
        verb = re.search(r"(\S+)/VERB", caption)
        if verb is not None:
            found[file.stem] = verb[1]
    return found


def _names(file: Path) -> set[str] | None:
    return set(file.read_text(encoding="utf-8", errors="replace").split()) if file.is_file() else None
