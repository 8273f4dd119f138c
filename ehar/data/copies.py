"""Finds test sequences that were recorded once, but are in the training part as well: files of data sets have them."""

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.data.motion_data import MotionData

ALIKE = 0.5  # share of its frames that a copy has elsewhere; few may be alike by chance


def copied(data: MotionData, sequences: IntArray) -> BoolArray:
    """Return which sequences (n,) are copies of any of the data's others: more than half of their frames are there too.

    Frames are the same if all joints are, to the last bit; no two recordings are. A recogniser that learned from the
    other sequences has met a copy already.
    """
    others = np.setdiff1d(np.arange(len(data.labels)), sequences)
    known = set().union(*(_frames(data.sequence(other)) for other in others.tolist()))
    return np.array([_is_copy(data.sequence(sequence), known) for sequence in sequences.tolist()], dtype=bool)


def is_copy(motion: FloatArray, other: FloatArray) -> bool:
    """Return whether a recording (T, P, J, 3) is a copy of another one (S, P, J, 3)."""
    return _is_copy(motion, set(_frames(other)))


def _is_copy(motion: FloatArray, known: set[bytes]) -> bool:
    return sum(frame in known for frame in _frames(motion)) > ALIKE * len(motion)


def _frames(motion: FloatArray) -> list[bytes]:
    return [frame.tobytes() for frame in motion]
