"""Finds test sequences that were recorded once, but are in the training part as well: files of data sets have them."""

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.data.motion_data import MotionData
from ehar.data.recordings import Recordings
from ehar.errors import DataError

ALIKE = 0.5  # share of its frames that a copy has elsewhere; few may be alike by chance


def copied(data: Recordings, sequences: IntArray) -> BoolArray:
    """Return which sequences (n,) are copies of any of the data's others: more than half of their frames are there too.

    Frames are the same if all joints are, to the last bit; no two recordings are. A recogniser that learned from the
    other sequences has met a copy already.
    """
    others = np.setdiff1d(np.arange(len(data.lengths)), sequences)
    known = set().union(*(_frames(data.sequence(other)) for other in others.tolist()))
    return np.array([_is_copy(data.sequence(sequence), known) for sequence in sequences.tolist()], dtype=bool)


def unseen_test(data: MotionData) -> IntArray:
    """Return the test sequences that are no copies of training sequences, (n,).

    Raises:
        DataError: the data has no split, or every test sequence is a copy.
    """
    if data.is_test is None or data.is_test.all() or not data.is_test.any():
        raise DataError(f"{data.name}: expected training and test sequences, as `split` names them")
    test = np.flatnonzero(data.is_test)
    found: IntArray = test[~copied(data, test)]
    if not len(found):
        raise DataError(f"{data.name}: expected a test sequence that is no copy of a training sequence")
    return found


def is_copy(motion: FloatArray, other: FloatArray) -> bool:
    """Return whether a recording (T, P, J, 3) is a copy of another one (S, P, J, 3)."""
    return _is_copy(motion, set(_frames(other)))


def _is_copy(motion: FloatArray, known: set[bytes]) -> bool:
    return sum(frame in known for frame in _frames(motion)) > ALIKE * len(motion)


def _frames(motion: FloatArray) -> list[bytes]:
    return [frame.tobytes() for frame in motion]
