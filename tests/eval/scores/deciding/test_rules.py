"""When rules answer, on activities that are small enough to read."""

import numpy as np
import pytest

from ehar.errors import DataError
from eval.scores.deciding.rules import (
    FixedTime,
    Sprt,
    Threshold,
    Words,
    decide,
    waited,
    words_of_records,
    worth,
)
from tests.helpers.made_records import make_records, make_stream_records
from tests.helpers.words import words_of

PROBABILITIES = np.array(
    [
        [[0.5, 0.3, 0.2], [0.2, 0.45, 0.35], [0.1, 0.8, 0.1], [0.05, 0.9, 0.05]],
        [[0.4, 0.35, 0.25], [0.6, 0.2, 0.2], [0.9, 0.05, 0.05], [0.1, 0.1, 0.8]],
    ]
)
SHOWN = np.array([[True, True, True, True], [True, True, False, False]])


def logit(probability: float) -> float:
    return float(np.log(probability / (1 - probability)))


def test_odds_are_against_all_others_and_the_lead_is_against_the_second() -> None:
    words = words_of(PROBABILITIES)
    assert words.odds[0, 3] == pytest.approx(logit(0.9))
    assert words.lead[0, 3] == pytest.approx(np.log(0.9 / 0.05))


def test_records_hold_the_same_words() -> None:
    words = words_of_records(records := make_records(0))
    assert words.answer is records.predicted and words.top is records.top_probability
    assert words.shown.all()


# Frames of no activity, three of class 0, one of none, two of class 1, and class 1 again where the episode ends.
LABELS = np.array([[-1, 0, 0, 0, -1, 1, 1, -1, 1, 1], [2, 2, -1, -1, 0, 0, 0, 0, 0, -1]])
SAID = np.array([[-1, -1, 0, 0, 0, -1, -1, 1, 1, 1], [2, 2, 2, 2, 2, 2, 0, 0, 0, 0]])


def test_records_of_streams_hold_the_words_on_each_activity_from_its_onset_on() -> None:
    records = make_stream_records(LABELS, SAID)
    words = words_of_records(records)
    assert words.shown.sum(axis=1).tolist() == [3, 2, 5]  # what an episode begins or ends with may be cut
    assert [row[shown].tolist() for row, shown in zip(words.answer, words.shown, strict=True)] == [
        SAID[0, 1:4].tolist(),
        SAID[0, 5:7].tolist(),
        SAID[1, 4:9].tolist(),
    ]
    np.testing.assert_array_equal(words.top[1, :2], records.top_probability[0, 5:7])
    assert words.second is None


@pytest.mark.parametrize("rule", [FixedTime(0), Threshold(-np.inf)], ids=str)
def test_no_activity_is_no_answer(rule: FixedTime | Threshold) -> None:
    """A rule waits for a word, and where none comes until the end nothing is answered."""
    decisions = decide(rule, words_of_records(make_stream_records(LABELS, SAID)))
    assert decisions.frame.tolist() == [1, 1, 0]
    assert decisions.answer.tolist() == [0, -1, 2]


@pytest.mark.parametrize(
    ("rule", "frames", "answers"),
    [
        (FixedTime(0), [0, 0], [0, 0]),
        (FixedTime(2), [2, 2], [1, 0]),
        (FixedTime(9), [3, 3], [1, 2]),
        (Threshold(logit(0.75)), [2, 2], [1, 0]),
        (Threshold(logit(0.5) - 1e-9), [0, 1], [0, 0]),
        (Threshold(np.inf), [3, 3], [1, 2]),
        (Sprt(np.log(2.9)), [2, 1], [1, 0]),
    ],
    ids=str,
)
def test_a_rule_answers_once(rule: FixedTime | Threshold | Sprt, frames: list[int], answers: list[int]) -> None:
    decisions = decide(rule, words_of(PROBABILITIES))
    assert decisions.frame.tolist() == frames
    assert decisions.answer.tolist() == answers


def test_the_lead_is_not_the_probability() -> None:
    """0.45 with the rest spread over many classes is a clear lead; 0.6 against 0.39 is none."""
    spread = np.array([0.45, *[0.055] * 10])
    rivals = np.array([0.6, 0.39, *[0.01 / 9] * 9])
    words = words_of(np.stack([spread, rivals])[:, None])
    assert Sprt(2.0).stops(words)[:, 0].tolist() == [True, False]
    assert Threshold(logit(0.5)).stops(words)[:, 0].tolist() == [False, True]


def test_an_activity_that_ends_is_answered_at_its_end() -> None:
    words = words_of(PROBABILITIES, SHOWN)
    assert words.last.tolist() == [3, 1]
    assert decide(Threshold(logit(0.85)), words).frame.tolist() == [3, 1]


def test_frames_after_the_end_do_not_matter() -> None:
    other = PROBABILITIES.copy()
    other[1, 2:] = 1 / 3
    for rule in (FixedTime(3), Threshold(logit(0.7)), Sprt(1.0)):
        one, two = (decide(rule, words_of(values, SHOWN)) for values in (PROBABILITIES, other))
        assert one.frame.tolist() == two.frame.tolist() and one.answer.tolist() == two.answer.tolist()


def test_answers_cost_their_time() -> None:
    time = waited(decide(FixedTime(1), words_of(PROBABILITIES)), 0.1)
    np.testing.assert_allclose(time, [0.2, 0.2])
    np.testing.assert_allclose(worth(np.array([True, False]), time, 10.0), [98, -2])


@pytest.mark.parametrize("shown", [[[False, True]], [[True, False, True]], [[]]])
def test_a_mask_with_holes_is_refused(shown: list[list[bool]]) -> None:
    mask = np.array(shown, dtype=bool)
    nothing = np.zeros(mask.shape)
    with pytest.raises(DataError, match="missing frames only at their end"):
        Words(nothing.astype(int), nothing, nothing, mask)


def test_the_second_probability_is_asked_for() -> None:
    words = words_of(PROBABILITIES)
    with pytest.raises(DataError, match="expected the second most probable class's probability, got none"):
        Sprt(1.0).stops(Words(words.answer, words.top, None, words.shown))
