"""Scores of streams, by hand."""

import numpy as np
import pytest

from eval.scores.streams.activities import RATIOS, activities, activity_frames
from eval.scores.streams.alarms import delays, false_alarms
from eval.scores.streams.table import stream_table
from tests.helpers.made_records import make_stream_records

NONE = -1
#                  0    1  2  3  4    5     6  7  8  9 10 11   12  13  14   15 16 17
LABELS = np.array([[2, 2, 0, 0, 0, NONE, 1, 1, 1, 1, 0, 0, NONE, 1, 1, 1, 1, NONE]])
ANSWERS = np.array([[2, 2, 2, 0, 0, 1, 1, 1, 0, 1, 1, 1, 2, 0, 1, 1, NONE, NONE]])


def test_activities_are_rows_of_one_class_that_are_not_cut_by_the_episode() -> None:
    episode, begin, end = activity_frames(LABELS)
    assert episode.tolist() == [0, 0, 0, 0]
    assert list(zip(begin.tolist(), end.tolist(), strict=True)) == [(2, 5), (6, 10), (10, 12), (13, 17)]
    _, begin, end = activity_frames(np.array([[0, 1, 1, 0], [NONE, 1, 2, NONE]]))
    assert list(zip(begin.tolist(), end.tolist(), strict=True)) == [(1, 3), (1, 2), (2, 3)]


def test_each_activity_is_scored_from_its_onset() -> None:
    scored = activities(make_stream_records(LABELS, ANSWERS))
    assert not scored.of_streams
    assert scored.label.tolist() == [0, 1, 0, 1]
    assert scored.first.tolist() == [9, 13, 17, 20]
    assert scored.predicted.shape == (4, len(RATIOS)) == (4, 20)
    # The second lasts 4 frames, of which the third is wrong: 5 to 25 %, ... up to 100 %.
    assert scored.correct[1].tolist() == [True] * 10 + [False] * 5 + [True] * 5
    assert scored.viewpoint[1, :, 0].tolist() == [6.0] * 5 + [7.0] * 5 + [8.0] * 5 + [9.0] * 5


def test_delays_last_until_the_answer_stays_right() -> None:
    took, recognised = delays(LABELS, ANSWERS)
    assert took.tolist() == [1, 3, 2, 4]
    assert recognised.tolist() == [True, True, False, False]


def test_false_alarms_are_answers_for_what_is_not_shown() -> None:
    # 0 at frame 8, 2 at frame 12 and 0 at frame 13 are not shown there. 1 from frame 9 on was right once.
    assert false_alarms(LABELS, ANSWERS) == 3
    assert false_alarms(LABELS, LABELS) == 0
    assert false_alarms(LABELS, np.full_like(LABELS, NONE)) == 0
    assert false_alarms(np.full((2, 3), NONE), np.array([[0, 0, 1], [1, 1, 1]])) == 3  # rows of two episodes differ


def test_the_table_is_in_seconds_and_minutes() -> None:
    table = stream_table({"no-act": make_stream_records(LABELS, ANSWERS)}, fps=2.0, episodes=len(LABELS))
    right = 100 * (LABELS == ANSWERS).mean()
    still = 100 * (ANSWERS == LABELS)[LABELS == NONE].mean()
    assert table.rows == (("no-act", f"{right:.1f}", f"{still:.1f}", "1.25", "50.0", "20.0", *table.rows[0][-2:]),)
    assert "1 episodes of 9 s" in table.title


@pytest.mark.parametrize("seed", range(5))
def test_a_recogniser_that_is_always_right_has_no_delay(seed: int) -> None:
    labels = np.repeat(np.random.default_rng(seed).integers(-1, 3, size=(4, 20)), 5, axis=1)
    took, recognised = delays(labels, labels)
    assert len(took) and not took.any() and recognised.all()
    assert activities(make_stream_records(labels, labels)).correct.all()
