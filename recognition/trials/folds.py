"""Folds over people: some are left out, the others are learned from; the test part is never touched."""

from dataclasses import dataclass

import numpy as np

from ehar.arrays import IntArray
from ehar.data.motion_data import MotionData
from ehar.data.recordings import UNKNOWN_SUBJECT
from ehar.data.scenario import split_parts
from ehar.errors import DataError, UsageError

FOLD_SEED = 0  # folds are properties of the data, not of a run


@dataclass(frozen=True, eq=False)
class Fold:
    """One division of the training sequences.

    Args:
        learned: sequences without anybody who is left out.
        held: sequences that show somebody who is left out.
    """

    learned: IntArray
    held: IntArray


def training_sequences(data: MotionData) -> IntArray:
    """Return all sequences outside the test part."""
    parts = split_parts(data)
    return np.sort(np.concatenate([parts.recogniser, parts.policy, parts.validation]))


def people_folds(data: MotionData, folds: int) -> tuple[Fold, ...]:
    """Leave out everybody of the training sequences once, in `folds` groups.

    Raises:
        UsageError: there are fewer people than folds, or fewer than two folds.
        DataError: the data do not name people, or a class is only shown by people of one fold.
    """
    sequences = training_sequences(data)
    people = np.unique(data.subjects[sequences])
    if UNKNOWN_SUBJECT in people:
        raise DataError(
            f"{data.name}: expected the names of all people who are trained on, so that some can be left out"
        )
    if not 2 <= folds <= len(people):
        raise UsageError(f"--folds: got {folds}, expected 2 to {len(people)}, the people whom {data.name} trains on")
    drawn = np.random.default_rng(FOLD_SEED).permutation(people)
    found = []
    for number in range(folds):
        out = np.isin(data.subjects[sequences], drawn[number::folds]).any(axis=1)
        learned, held = sequences[~out], sequences[out]
        lacking = np.setdiff1d(data.labels[held], data.labels[learned])
        if len(lacking) or not len(learned):
            names = ", ".join(data.class_names[label] for label in lacking) or "all classes"
            raise DataError(f"{data.name}: without the people of fold {number} nobody shows {names}: try other --folds")
        found.append(Fold(learned, held))
    return tuple(found)
