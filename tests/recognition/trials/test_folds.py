"""Folds over people."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.data.motion_data import MotionData
from ehar.errors import DataError, UsageError
from recognition.trials.folds import people_folds, training_sequences
from tests.helpers.fakes import tiny_data


def of_people(persons: int = 1) -> MotionData:
    """Return 24 sequences of 8 people, each of whom shows every class once; the last two are in the test."""
    person = np.repeat(np.arange(8), 3)
    subjects = np.stack([person, (person // 2 * 2 + 1) if persons == 2 else person], axis=1)[:, :persons]
    return replace(tiny_data(sequences=24, persons=persons), subjects=subjects, is_test=person > 5)


def test_everybody_is_left_out_once_and_nobody_of_the_test_is_used() -> None:
    data = of_people()
    folds = people_folds(data, 3)
    held = [set(data.subjects[fold.held, 0]) for fold in folds]
    assert set().union(*held) == set(range(6)) and sum(map(len, held)) == 6
    for fold, people in zip(folds, held, strict=True):
        assert not people & set(data.subjects[fold.learned, 0])
        assert not data.is_test[np.concatenate([fold.learned, fold.held])].any()  # type: ignore[index]
        np.testing.assert_array_equal(np.sort([*fold.learned, *fold.held]), training_sequences(data))


def test_who_performs_with_somebody_who_is_left_out_is_in_no_sequence_that_is_learned() -> None:
    data = of_people(persons=2)
    for fold in people_folds(data, 2):
        everybody = np.intersect1d(data.subjects[fold.held], data.subjects[fold.learned])
        left_out = np.random.default_rng(0).permutation(6)
        assert not set(everybody) >= set(left_out[::2]) and not set(everybody) >= set(left_out[1::2])
        assert len(fold.learned) and len(fold.held)


def test_folds_are_the_same_each_time() -> None:
    first, second = people_folds(of_people(), 2), people_folds(of_people(), 2)
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one.held, other.held)


def test_people_who_are_not_named_or_too_few_are_refused() -> None:
    with pytest.raises(DataError, match="expected the names of all people who are trained on"):
        people_folds(tiny_data(), 2)
    with pytest.raises(UsageError, match="--folds: got 7, expected 2 to 6"):
        people_folds(of_people(), 7)


def test_a_class_that_only_one_person_shows_is_refused() -> None:
    data = of_people()
    labels = np.where(data.subjects[:, 0] == 2, 0, 1 + np.arange(24) % 2)
    with pytest.raises(DataError, match="nobody shows nod: try other --folds"):
        people_folds(replace(data, labels=labels), 6)
