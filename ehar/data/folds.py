"""Folds over people: in each other people are the test part, so that all of a set are tested once."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ehar.arrays import IntArray
from ehar.data.any_source import load_recordings
from ehar.data.motion_data import MotionData
from ehar.data.scenario import people_together, split_parts
from ehar.data.streams.data import StreamData
from ehar.errors import DataError, UsageError


def fold(data: str | Path | MotionData | StreamData, *, number: int, folds: int = 3) -> MotionData | StreamData:
    """Return a set whose test part is that of a fold; all others are for training.

    The set's own test part is fold 0, if its people are nowhere else. The people of the rest are dealt out to the other
    folds, who has most frames first, each to the fold that has the fewest. A set that was divided by something else, by
    cameras or by who acts first, has all its people dealt out. People who perform together stay together, as in the
    parts of streams.

    Args:
        data: sequences or streams, in memory or as `load_recordings` takes them; all have to name who performs.
        number: of the fold, from 0.
        folds: how many there are.

    Raises:
        UsageError: there are fewer than 2 folds or more than people allow, `number` is not one of them, or the data
            are unknown.
        DataError: the data are malformed, do not name everybody who performs, or a part of the fold lacks a class.
    """
    data = data if isinstance(data, MotionData | StreamData) else load_recordings(data)
    if data.unnamed:
        raise DataError(
            f"{data.name}: subjects: expected all people by number, so that each is in one fold, got none in "
            f"{data.unnamed} of {len(data.subjects)} sequences"
        )
    of_sequence = _fold_of(data, folds)
    if not 0 <= number < folds:
        raise UsageError(f"--number: got {number}, expected 0 to {folds - 1}")
    found = replace(data, name=f"{data.name}-fold{number}", is_test=of_sequence == number)
    parts = split_parts(found)
    if isinstance(found, MotionData):
        learned = np.concatenate([parts.recogniser, parts.policy, parts.validation])
        lacking = np.setxor1d(found.labels[parts.test], found.labels[learned])
        if len(lacking):
            raise DataError(
                f"{found.name}: expected every class in the test part and outside of it, "
                f"class {found.class_names[lacking[0]]!r} is on one side: try other --folds"
            )
    return found


def _fold_of(data: MotionData | StreamData, folds: int) -> IntArray:
    """Return the fold that each sequence is tested in, (sequences,)."""
    found = np.full(len(data.lengths), -1)
    found[split_parts(data).test] = 0
    group = people_together(data.subjects)
    own = int(not np.isin(group[found == 0], group[found != 0]).any())  # folds that its own split makes: one or none
    rest = np.flatnonzero(found) if own else np.arange(len(found))
    groups, of_rest = np.unique(group[rest], return_inverse=True)
    if not 2 <= folds <= len(groups) + own:
        raise UsageError(
            f"--folds: got {folds}, expected 2 to {len(groups) + own}, as {data.name} has {len(groups)} people, or "
            f"groups of people who perform together{' outside its own test part' if own else ''}"
        )
    frames = np.bincount(of_rest, weights=data.lengths[rest])
    held = np.zeros(folds - own)
    for one in np.argsort(-frames, kind="stable"):
        least = int(held.argmin())
        found[rest[of_rest == one]] = own + least
        held[least] += frames[one]
    return found
