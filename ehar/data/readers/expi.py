"""ExPI, Extreme Pose Interaction: the original files of two couples, and the split of the paper's protocol.

The 70 sequences of the protocol lie in `<source>/acro{1,2}/<activity><number>/mocap_cleaned.tsv`. A marker may be
missing (an empty cell, or NaN) for at most `LONGEST_GAP` frames between two frames that have it; it is then
interpolated linearly.
"""

from pathlib import Path

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.data.motion_data import MotionData
from ehar.data.preparing.axes import Up, upright
from ehar.data.skeleton import Skeleton
from ehar.errors import DataError

FPS = 25.0
LONGEST_GAP = 25  # frames, 1 s: a straight line over more than that is no longer the motion
SKELETON = Skeleton(
    joint_names=(
        *("fhead", "lhead", "rhead", "back", "lshoulder", "rshoulder", "lelbow", "relbow", "lwrist", "rwrist"),
        *("lhip", "rhip", "lknee", "rknee", "lheel", "rheel", "ltoes", "rtoes"),
    ),
    bones=(
        *((0, 1), (0, 2), (0, 3), (3, 4), (4, 6), (6, 8), (3, 5), (5, 7), (7, 9)),
        *((3, 10), (10, 12), (12, 14), (14, 16), (3, 11), (11, 13), (13, 15), (15, 17)),
    ),
)
PERSONS = 2  # the man, then the woman
FIRST_LINE = 2  # line of the first frame, counted from 1, after a header
NUMBERS = PERSONS * len(SKELETON.joint_names) * 3

# The protocol for activities that both couples perform: acro2 is trained on, acro1 is tested on.
TRAIN_COUPLE, TEST_COUPLE = "acro2", "acro1"
TRAIN = {
    "a-frame": (1, 2, 3, 4, 5),
    "around-the-back": (3, 4, 5, 6, 7),
    "coochie": (1, 2, 3, 4, 5),
    "frog-classic": (3, 4, 5, 6, 7),
    "noser": (1, 2, 3, 4, 5),
    "toss-out": (1, 2, 3, 4, 5),
    "cartwheel": (2, 3, 4, 5, 6),
}
TEST = {
    "a-frame": (1, 2, 3, 4, 5),
    "around-the-back": (1, 2, 3, 4, 5),
    "coochie": (1, 2, 3, 4, 5),
    "frog-classic": (1, 2, 4, 5, 6),
    "noser": (1, 2, 3, 4, 6),
    "toss-out": (1, 2, 3, 4, 5),
    "cartwheel": (3, 4, 5, 6, 7),
}
SUBJECTS = {"acro1": (0, 1), "acro2": (2, 3)}


def prepare_expi(source: str | Path, *, unit: str = "mm", up: Up = "z") -> MotionData:
    """Read the original ExPI files.

    For example:
        ehar data prepare expi ExPI expi.npz

    Args:
        source: folder that holds acro1 and acro2.
        unit: unit of length in the files: m, cm, mm, or a number of metres.
        up: axis that points up in the files.

    Raises:
        DataError: a sequence is missing, a row does not hold 108 numbers, or a marker is missing for too long.
    """
    source = Path(source)
    names = [f"{TRAIN_COUPLE}/{activity}{number}" for activity, numbers in TRAIN.items() for number in numbers]
    trained = len(names)
    names += [f"{TEST_COUPLE}/{activity}{number}" for activity, numbers in TEST.items() for number in numbers]
    files = [source / name / "mocap_cleaned.tsv" for name in names]
    missing = [name for name, file in zip(names, files, strict=True) if not file.is_file()]
    if missing:
        problem = f"{len(missing)} of {len(names)} sequences have no mocap_cleaned.tsv: {', '.join(missing)}"
        raise DataError(f"{source}: {problem}; expected acro1 and acro2 of ExPI below it")
    sequences, gaps = zip(*(read_sequence(file, unit=unit, up=up) for file in files), strict=True)
    lost = np.concatenate(gaps)
    labels = [
        label for split in (TRAIN, TEST) for label, numbers in enumerate(split.values()) for _ in range(len(numbers))
    ]
    return MotionData(
        name="expi",
        positions=np.concatenate(sequences),
        offsets=np.cumsum([0, *map(len, sequences)]),
        labels=np.array(labels),
        missing=lost if lost.any() else None,
        class_names=tuple(TRAIN),
        sequence_names=tuple(names),
        fps=FPS,
        skeleton=SKELETON,
        is_test=np.arange(len(names)) >= trained,
        subjects=np.array([SUBJECTS[name.split("/")[0]] for name in names]),
        license="ExPI: research use, on request from its authors; do not redistribute",
    )


def read_sequence(file: Path, *, unit: str = "mm", up: Up = "z") -> tuple[FloatArray, BoolArray]:
    """Return the joints (T, 2, 18, 3) float32 [m] of one file, and in which frames (T,) some were missing.

    The file has a header, then one row per frame. Commas separate the values, although the file ends in .tsv.
    """
    lines = file.read_text(encoding="utf-8", errors="replace").rstrip().splitlines()
    rows = [_parse_row(file, number, line) for number, line in enumerate(lines[1:], start=FIRST_LINE)]
    if not rows:
        raise DataError(f"{file}: got no frames, expected a header line and then {NUMBERS} numbers a row")
    values = np.array(rows)
    gaps = np.isnan(values).any(axis=1)
    _fill_gaps(file, values)
    return upright(values.reshape(len(rows), PERSONS, -1, 3), unit=unit, up=up), gaps


def _parse_row(file: Path, number: int, line: str) -> list[float]:
    cells = [cell.strip() for cell in line.split(",")]
    if len(cells) != NUMBERS:
        expected = f"expected {NUMBERS} (2 persons, 18 joints, x y z)"
        raise DataError(f"{file}: line {number}: got {len(cells)} values separated by commas, {expected}")
    try:
        row = [float(cell) if cell else np.nan for cell in cells]
    except ValueError:
        raise DataError(f"{file}: line {number}: got {_first_word(cells)!r}, expected numbers only") from None
    if np.isinf(row).any():
        raise DataError(f"{file}: line {number}: got an infinite position, expected millimetres")
    return row


def _first_word(cells: list[str]) -> str:
    for cell in cells:
        try:
            float(cell or "nan")
        except ValueError:
            return cell
    return ""


def _fill_gaps(file: Path, values: FloatArray) -> None:
    """Interpolate missing values (T, 108) linearly in time, in place."""
    frames = np.arange(len(values))
    for column in np.flatnonzero(np.isnan(values).any(axis=0)):
        known = np.flatnonzero(~np.isnan(values[:, column]))
        edges = np.concatenate([[-1], known, [len(values)]])
        gaps = np.diff(edges) - 1
        allowed = np.full(len(gaps), LONGEST_GAP)
        allowed[[0, -1]] = 0
        wrong = np.flatnonzero(gaps > allowed)
        if wrong.size:
            begin, gap = edges[wrong[0]] + 1, gaps[wrong[0]]
            person, joint = divmod(int(column) // 3, len(SKELETON.joint_names))
            marker = f"{SKELETON.joint_names[joint]} of person {person}"
            expected = f"expected at most {LONGEST_GAP} between two frames that have it"
            raise DataError(f"{file}: line {begin + FIRST_LINE}: {marker} is missing for {gap} frames, {expected}")
        values[:, column] = np.interp(frames, known, values[known, column])
