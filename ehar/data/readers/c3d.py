"""C3D: markers of motion capture, read by the library ezc3d.

A file names its markers and says nothing of bones. So bones join the markers that are nearest to each other: the least
spanning tree over the first file. Its markers are those that all files share; markers without a name are left out.
"""

import re
import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.sparse.csgraph import minimum_spanning_tree

from ehar.arrays import FloatArray
from ehar.data.motion_data import MotionData
from ehar.data.preparing.axes import UNITS, Up, metres, up_rotation, upright
from ehar.data.readers.assembly import Clip, assemble
from ehar.data.readers.names import compiled, label_of, visible_files
from ehar.data.skeleton import Skeleton
from ehar.errors import DataError, UsageError

LIMIT = 60.0  # [s] that a file may take: ezc3d waits forever for some that end too soon
BLOCK = 512  # bytes
MAGIC = 0x50  # the second byte of every C3D file
LEAST_MARKERS = 4
UNNAMED = re.compile(r"\*\d+|")  # markers that nobody named
SAME_RATE = 1e-3  # share by which frame rates may differ

# Read in a process of its own: broken files make ezc3d wait forever, or end the process.
_READ = """
import sys
import ezc3d
import numpy as np
held = ezc3d.c3d(sys.argv[1])
points, residuals = held["data"]["points"], held["data"]["meta_points"]["residuals"]
told = held["parameters"]["POINT"]
labels = [label for name in sorted(told) if name.startswith("LABELS") for label in told[name]["value"]]
positions = np.moveaxis(points[:3], 0, 2).transpose(1, 0, 2)
positions[(residuals[0] < 0).T] = np.nan
units = told.get("UNITS", {}).get("value", [""])
np.savez(sys.argv[2], positions=positions, labels=np.array(labels, dtype=str),
         fps=held["header"]["points"]["frame_rate"], units=np.array((list(units) or [""])[0], dtype=str))
"""


@dataclass(frozen=True, eq=False)
class Markers:
    """One C3D file.

    Args:
        names: N names.
        positions: (T, N, 3) in the file's unit and axes; NaN where a marker is lost.
        fps: frames per second.
        unit: unit of length that the file says: m, cm, mm or another word; empty if it says none.
    """

    names: tuple[str, ...]
    positions: FloatArray
    fps: float
    unit: str


def prepare_c3d(
    source: str | Path, *, pattern: str = "{label}_{number}.c3d", unit: str = "mm", up: Up = "z"
) -> MotionData:
    """Read a folder of C3D files; needs ezc3d.

    Markers that all files share become joints; bones join the nearest.

    For example:
        ehar data prepare c3d recordings mine.npz --pattern '{label}_{number}.c3d'

    Args:
        source: folder of the files.
        pattern: pattern of the file names: {label} is the class, other words in braces match anything.
        unit: unit of length in the files: m, cm, mm, or a number of metres.
        up: axis that points up in the files.

    Raises:
        UsageError: ezc3d is not installed, or an option has a wrong value.
        DataError: a file is malformed or differs in rate, says another unit, or shares too few markers with the others.
    """
    if find_spec("ezc3d") is None:
        raise UsageError("data prepare c3d needs ezc3d: pip install -e '.[c3d]'")
    source, regex = Path(source), compiled(pattern)
    metres(unit), up_rotation(up)  # a wrong option is told before anything is read
    files = visible_files(source, ".c3d")
    if not files:
        raise DataError(f"{source}: got no .c3d files, expected a folder that holds some")
    words = [label_of(file, regex, pattern) for file in files]
    held = [read_c3d(file) for file in files]
    for file, markers in zip(files, held, strict=True):
        if abs(markers.fps / held[0].fps - 1) > SAME_RATE:
            raise DataError(f"{file}: got {markers.fps:g} frames a second, expected {held[0].fps:g} as in {files[0]}")
        if markers.unit in UNITS and markers.unit != unit and unit in UNITS:
            overruled = f"--unit {metres(unit):g} if the file is wrong"
            raise DataError(
                f"{file}: POINT:UNITS: got {markers.unit}, expected {unit}; --unit {markers.unit} reads it, {overruled}"
            )
    shared = [name for name in held[0].names if all(name in markers.names for markers in held)]
    if len(shared) < LEAST_MARKERS:
        raise DataError(f"{source}: got {len(shared)} markers that all files name, expected at least {LEAST_MARKERS}")
    clips = [
        Clip(
            file=file,
            name=file.relative_to(source).with_suffix("").as_posix(),
            label=word,
            motion=upright(markers.positions[:, [markers.names.index(name) for name in shared]], unit=unit, up=up)[
                :, None
            ],
        )
        for file, word, markers in zip(files, words, held, strict=True)
    ]
    others = sum(len(markers.names) - len(shared) for markers in held)
    notes = [f"{others} markers are not in all files and are left out"] if others else []
    strange = sorted({markers.unit for markers in held} - {*UNITS, ""})
    notes += [f"POINT:UNITS: {', '.join(strange)} is no unit that is known, {unit} is taken"] if strange else []
    return assemble(
        clips,
        name=source.name,
        skeleton=Skeleton(tuple(shared), nearest_bones(clips[0].motion[:, 0])),
        fps=held[0].fps,
        license="unknown: that of the C3D files",
        notes=[*notes, "bones join the markers that are nearest to each other: C3D names none"],
    )


def nearest_bones(positions: FloatArray) -> tuple[tuple[int, int], ...]:
    """Return the bones of the least spanning tree between markers (T, N, 3), by their median distances."""
    median = np.full(positions.shape[1:2] * 2, np.nan)
    for marker in range(len(median)):  # one at a time: all at once take gigabytes for minutes of motion
        apart = np.linalg.norm(positions - positions[:, [marker]], axis=-1)
        together = np.isfinite(apart).any(axis=0)
        median[marker, together] = np.nanmedian(apart[:, together], axis=0)
    median = np.where(np.isfinite(median), np.maximum(median, 1e-9), 1e3)  # scipy takes 0 for no way
    first, second = minimum_spanning_tree(median).nonzero()
    return tuple(sorted((int(min(pair)), int(max(pair))) for pair in zip(first, second, strict=True)))


def read_c3d(file: Path) -> Markers:
    """Return the named markers of one file.

    Raises:
        DataError: it is no C3D file, ends too soon, or cannot be read within a minute.
    """
    _check_size(file)
    with TemporaryDirectory() as folder:
        found = Path(folder) / "markers.npz"
        try:
            done = subprocess.run(
                [sys.executable, "-c", _READ, str(file), str(found)], capture_output=True, text=True, timeout=LIMIT
            )
        except subprocess.TimeoutExpired as error:
            raise DataError(f"{file}: not a readable C3D file: ezc3d takes longer than {LIMIT:g} s") from error
        if done.returncode or not found.is_file():
            lines = done.stderr.strip().splitlines()
            raise DataError(f"{file}: not a readable C3D file: {lines[-1] if lines else 'ezc3d ended without a word'}")
        with np.load(found) as arrays:
            positions, labels = (
                arrays["positions"],
                [str(label).rpartition(":")[2].strip() for label in arrays["labels"]],
            )
            fps, unit = float(arrays["fps"]), _unit(str(arrays["units"]).strip())
    if len(labels) < positions.shape[1] or not len(positions):
        frames, markers = positions.shape[:2]
        raise DataError(
            f"{file}: got {frames} frames of {markers} markers and {len(labels)} labels, expected some of each"
        )
    if not 0 < fps < np.inf:
        raise DataError(f"{file}: frame rate: got {fps:g}, expected frames a second")
    named = [index for index, label in enumerate(labels[: positions.shape[1]]) if not UNNAMED.fullmatch(label)]
    names = tuple(labels[index] for index in named)
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise DataError(f"{file}: POINT:LABELS: got {twice!r} twice, expected a name for each marker of one person")
    return Markers(names, positions[:, named], fps, unit)


def _unit(word: str) -> str:
    """Return m, cm or mm for a word that means it, such as `Meters`; any other word as it is."""
    match = re.fullmatch(r"(milli|centi|)met(?:er|re)s?|([mc]?)m", word, re.IGNORECASE)
    return word if match is None else f"{(match[1] or match[2] or '')[:1].lower()}m"


def _check_size(file: Path) -> None:
    """Raise a DataError unless a file begins as C3D files do, and is as long as its header says."""
    size, head = file.stat().st_size, file.open("rb").read(BLOCK)
    if len(head) < BLOCK or head[1] != MAGIC or not head[0]:
        raise DataError(f"{file}: got no header of a C3D file, expected one of {BLOCK} bytes")
    processor = file.read_bytes()[(head[0] - 1) * BLOCK + 3 :][:1]
    order = ">" if processor == bytes([86]) else "<"  # 84 Intel, 85 DEC, 86 MIPS
    markers, analog, first, last = (int(word) for word in np.frombuffer(head[2:10], dtype=f"{order}u2"))
    start = int(np.frombuffer(head[16:18], dtype=f"{order}u2")[0])
    scale = float(np.frombuffer(head[12:16], dtype=f"{order}f4")[0])
    if processor == bytes([85]):  # DEC's floats are others; their sign is in the same place
        scale = -1.0 if head[13] & 0x80 else 1.0
    wanted = (start - 1) * BLOCK + (last - first + 1) * (4 * markers + analog) * (4 if scale < 0 else 2)
    if not (markers and start > 1 and last >= first):
        raise DataError(f"{file}: got a header of {markers} markers in frames {first} to {last}, expected some")
    if size < wanted:
        raise DataError(f"{file}: got {size} bytes, expected at least {wanted}: it ends too soon")
