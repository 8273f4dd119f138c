"""Delays at equal false alarms, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from eval.scores.streams.alarms import alarms_per_minute
from eval.scores.streams.equal_alarms import restrained
from tests.helpers.made_records import make_stream_records

NONE = -1
LABELS = np.array([[NONE, NONE, 0, 0, 0, 0, NONE, 1, 1, 1, 1, NONE]])
# 1 is a false alarm in frame 0; 0 comes at its onset, but unsure for two frames; 1 comes one frame late.
ANSWERS = np.array([[1, NONE, 0, 0, 0, 0, NONE, NONE, 1, 1, 1, NONE]])
SURE = np.array([[0.5, 0.9, 0.4, 0.45, 0.8, 0.8, 0.9, 0.9, 0.7, 0.8, 0.8, 0.9]])
RECORDS = replace(make_stream_records(LABELS, ANSWERS), top_probability=SURE)


def test_with_alarms_to_spare_every_answer_counts() -> None:
    assert alarms_per_minute(LABELS, ANSWERS, fps=2.0) == 10.0  # one in 6 s
    kept = restrained(RECORDS, 2.0, 10.0)
    assert kept.delays.tolist() == [0, 1]


def test_who_may_raise_no_alarm_answers_only_when_sure() -> None:
    # Between 0.5, which the false alarm has, and 0.7: class 0 is named two frames later.
    kept = restrained(RECORDS, 2.0, 0.0)
    assert kept.delays.tolist() == [2, 1]
    assert 0.5 < kept.threshold <= 0.7


def test_who_is_never_right_says_nothing_and_takes_all_the_time() -> None:
    wrong = replace(RECORDS, predicted=np.full_like(ANSWERS, 2))
    kept = restrained(wrong, 2.0, 0.0)
    assert kept.threshold == np.inf
    assert kept.delays.tolist() == [4, 4]


@pytest.mark.parametrize("seed", range(5))
def test_more_alarms_never_make_it_slower(seed: int) -> None:
    rng = np.random.default_rng(seed)
    labels = np.repeat(rng.integers(-1, 3, size=(3, 12)), 5, axis=1)
    answers = np.where(rng.random(labels.shape) < 0.7, labels, rng.integers(-1, 3, size=labels.shape))
    records = replace(make_stream_records(labels, answers), top_probability=rng.random(labels.shape))
    waits = [restrained(records, 5.0, most).delays.mean() for most in (0.0, 5.0, 20.0, 1e9)]
    assert waits == sorted(waits, reverse=True)
