"""Folds over people for trials: the test part is never touched, and every class is learned in each."""

import numpy as np

from ehar.arrays import IntArray
from ehar.data.motion_data import MotionData
from ehar.data.scenario import split_parts
from ehar.errors import DataError
from recognition.left_out import Fold, leave_people_out


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
    found = leave_people_out(data, training_sequences(data), folds)
    for number, fold in enumerate(found):
        lacking = np.setdiff1d(data.labels[fold.held], data.labels[fold.learned])
        if len(lacking) or not len(fold.learned):
            names = ", ".join(data.class_names[label] for label in lacking) or "all classes"
            raise DataError(f"{data.name}: without the people of fold {number} nobody shows {names}: try other --folds")
    return found
