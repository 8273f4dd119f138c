"""AIST++: dancers' 3D keypoints, and a seeded selection of the size that the paper uses, split by dancer.

The reader takes `<source>/keypoints3d/*.pkl`, without what `ignore_list.txt` names, and at most 14 + 7 sequences a
genre. It holds out a third of each genre's dancers, and no dancer is on both sides. It draws the dancers, and their
sequences, from `SELECTION_SEED`; the names and the split are in the result. If one dancer alone performs a genre, that
genre would have no training or no test sequence. Then the result has no split (`is_test` is None) and at most 21
sequences a genre.

The floor stays at its height in the files, which is not 0.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.data.motion_data import MotionData
from ehar.data.preparing.axes import Up, upright
from ehar.data.preparing.layouts import COCO17
from ehar.data.readers.names import visible_files
from ehar.data.readers.pickles import load_arrays
from ehar.errors import DataError

FPS = 60.0
GENRES = {
    "gBR": "break",
    "gPO": "pop",
    "gLO": "lock",
    "gMH": "middle-hip-hop",
    "gLH": "la-hip-hop",
    "gHO": "house",
    "gWA": "waack",
    "gKR": "krump",
    "gJS": "street-jazz",
    "gJB": "ballet-jazz",
}
SKELETON = COCO17

TRAIN_PER_GENRE, TEST_PER_GENRE = 14, 7  # Sec. 5.1: 21 sequences a genre
TEST_DANCERS = 1 / 3  # of a genre's dancers: one of the usual three
SELECTION_SEED = 0  # the paper does not say which 21

_NAME = re.compile(r"(?P<genre>g[A-Z]{2})_s[A-Z]{2}_c[^_]+_d(?P<dancer>\d+)_m[^_]+_ch\d+")


def prepare_aistpp(source: str | Path, *, unit: str = "cm", up: Up = "y") -> MotionData:
    """Read the original AIST++ files.

    For example:
        ehar data prepare aistpp AIST++ aistpp.npz

    Args:
        source: folder that holds keypoints3d and the lists.
        unit: unit of length in the files: m, cm, mm, or a number of metres.
        up: axis that points up in the files.

    Raises:
        DataError: the folder or the ignore list is missing, a name is not of AIST++, or a file is not as expected.
    """
    source = Path(source)
    folder = source / "keypoints3d"
    files = visible_files(folder, ".pkl")
    if not files:
        raise DataError(f"{folder}: got no *.pkl files, expected the keypoints3d of AIST++")
    ignored = _read_ignore_list(source)
    entries = [_parse_name(file) for file in files if file.stem not in ignored]
    if not entries:
        raise DataError(f"{folder}: ignore_list.txt leaves none of its {len(files)} files")
    chosen, is_test = _select(entries, np.random.default_rng(SELECTION_SEED))
    sequences = [read_keypoints(entry.file, unit=unit, up=up) for entry in chosen]
    genres = [genre for genre in GENRES if any(entry.genre == genre for entry in chosen)]
    return MotionData(
        name="aistpp",
        positions=np.concatenate(sequences)[:, None],
        offsets=np.cumsum([0, *map(len, sequences)]),
        labels=np.array([genres.index(entry.genre) for entry in chosen]),
        class_names=tuple(GENRES[genre] for genre in genres),
        sequence_names=tuple(entry.file.stem for entry in chosen),
        fps=FPS,
        skeleton=SKELETON,
        is_test=is_test,
        subjects=np.array([[entry.dancer] for entry in chosen]),
        license="CC BY 4.0, AIST++ dance motion data set",
    )


def read_keypoints(file: Path, *, unit: str = "cm", up: Up = "y") -> FloatArray:
    """Return the joints (T, 17, 3) float32 [m], z up, of one file; nothing in it is executed.

    The optimised keypoints are taken: the raw ones have NaN in some files.
    """
    content = load_arrays(file)
    keypoints = content.get("keypoints3d_optim") if isinstance(content, dict) else None
    if not isinstance(keypoints, np.ndarray):
        raise DataError(f"{file}: keypoints3d_optim: missing, expected a dict that holds it as an array")
    if keypoints.dtype.kind != "f" or keypoints.ndim != 3 or keypoints.shape[1:] != (17, 3) or not len(keypoints):
        got = f"got {keypoints.dtype} of shape {keypoints.shape}"
        raise DataError(f"{file}: keypoints3d_optim: {got}, expected floats of shape (frames, 17, 3)")
    wrong = np.flatnonzero(~np.isfinite(keypoints).all(axis=(1, 2)))
    if wrong.size:
        raise DataError(f"{file}: keypoints3d_optim: got NaN or infinite in frame {wrong[0]}, expected centimetres")
    return upright(keypoints, unit=unit, up=up)


@dataclass(frozen=True)
class _Entry:
    file: Path
    genre: str
    dancer: int


def _parse_name(file: Path) -> _Entry:
    match = _NAME.fullmatch(file.stem)
    if match is None or match["genre"] not in GENRES:
        expected = f"expected one as gBR_sBM_cAll_d04_mBR0_ch01, of genre {', '.join(GENRES)}"
        raise DataError(f"{file}: got a name that is not of AIST++, {expected}")
    return _Entry(file, match["genre"], int(match["dancer"]))


def _read_ignore_list(source: Path) -> set[str]:
    places = [source / "ignore_list.txt", source / "splits" / "ignore_list.txt"]
    for place in places:
        if place.is_file():
            return set(place.read_text(encoding="utf-8", errors="replace").split())
    raise DataError(f"{places[0]}: no such file; expected AIST++'s list of sequences to leave out, there or in splits")


def _select(entries: list[_Entry], rng: np.random.Generator) -> tuple[list[_Entry], BoolArray | None]:
    """Choose sequences genre by genre, and which of them are tested."""
    genres = [[entry for entry in entries if entry.genre == genre] for genre in GENRES]
    genres = [members for members in genres if members]
    held: set[int] = set()
    for members in genres:
        dancers = sorted({entry.dancer for entry in members})
        wanted = max(1, round(TEST_DANCERS * len(dancers)))
        for dancer in rng.permutation(dancers).tolist():
            if len(held.intersection(dancers)) < wanted:
                held.add(dancer)
    chosen: list[_Entry] = []
    divided = True
    for members in genres:
        train = _draw([entry for entry in members if entry.dancer not in held], TRAIN_PER_GENRE, rng)
        test = _draw([entry for entry in members if entry.dancer in held], TEST_PER_GENRE, rng)
        divided = divided and bool(train) and bool(test)
        chosen += train + test
    return chosen, np.array([entry.dancer in held for entry in chosen]) if divided else None


def _draw(entries: list[_Entry], count: int, rng: np.random.Generator) -> list[_Entry]:
    picked = rng.permutation(len(entries))[:count]
    return [entries[i] for i in sorted(picked.tolist())]
