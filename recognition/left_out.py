"""People who are left out of a training, group by group, so that it can be asked about people whom it does not know."""

from dataclasses import dataclass

import numpy as np

from ehar.arrays import IntArray
from ehar.data.motion_data import MotionData
from ehar.data.recordings import UNKNOWN_SUBJECT, Recordings
from ehar.data.scenario import people_together
from ehar.data.streams.data import NO_ACTIVITY, StreamData
from ehar.errors import DataError, UsageError

FOLD_SEED = 0  # folds are properties of the data, not of a run


@dataclass(frozen=True, eq=False)
class Fold:
    """One division of some sequences.

    Args:
        learned: sequences without anybody who is left out.
        held: sequences that show somebody who is left out.
    """

    learned: IntArray
    held: IntArray


def leave_people_out(data: Recordings, sequences: IntArray, folds: int) -> tuple[Fold, ...]:
    """Leave out everybody of some sequences once, in `folds` groups.

    Raises:
        UsageError: there are fewer people than folds, or fewer than two folds.
        DataError: the data do not name people.
    """
    return _leave_out(data, sequences, folds, data.subjects, "people")


def leave_performers_out(data: Recordings, sequences: IntArray, folds: int) -> tuple[Fold, ...]:
    """Leave out all who perform together once; couples, where everybody performs with everybody, as `data fold` does.

    Raises:
        UsageError: there are fewer of them than folds, or fewer than two folds.
        DataError: the data do not name people.
    """
    return _leave_out(data, sequences, folds, people_together(data.subjects)[:, None], "people or couples")


def _leave_out(data: Recordings, sequences: IntArray, folds: int, members: IntArray, called: str) -> tuple[Fold, ...]:
    """Leave out every member once.

    Args:
        data: the data.
        sequences: the sequences that are divided.
        folds: number of groups.
        members: (all sequences of the data, M) numbers of who is in each.
        called: what members are called.
    """
    if UNKNOWN_SUBJECT in data.subjects[sequences]:
        raise DataError(
            f"{data.name}: expected the names of all people who are trained on, so that some can be left out"
        )
    everybody = np.unique(members[sequences])
    if not 2 <= folds <= len(everybody):
        expected = f"2 to {len(everybody)}, the {called} whom {data.name} trains on"
        raise UsageError(f"--folds: got {folds}, expected {expected}")
    drawn = np.random.default_rng(FOLD_SEED).permutation(everybody)
    out = [np.isin(members[sequences], drawn[number::folds]).any(axis=1) for number in range(folds)]
    return tuple(Fold(sequences[~left], sequences[left]) for left in out)


def of_known_classes(data: MotionData | StreamData, fold: Fold) -> IntArray:
    """Return the held sequences without a class that nobody else shows; a network could only be wrong there."""
    known = _classes(data, fold.learned)
    return np.array([one for one in fold.held if _classes(data, np.array([one])) <= known], dtype=np.int64)


def _classes(data: MotionData | StreamData, sequences: IntArray) -> set[int]:
    """Return the classes that some sequences show."""
    if isinstance(data, MotionData):
        return set(data.labels[sequences].tolist())
    frames = [data.labels[data.offsets[one] : data.offsets[one + 1]] for one in sequences]
    return set(np.concatenate(frames).tolist()) - {NO_ACTIVITY}
