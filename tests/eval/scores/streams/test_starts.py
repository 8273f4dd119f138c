"""Point-level average precision, by hand."""

import numpy as np
import pytest

from eval.records.episodes import EpisodeRecords
from eval.scores.streams.scores import macro_f1, stream_scores
from eval.scores.streams.starts import OFFSETS, Starts, point_map
from tests.helpers.made_records import make_stream_records

NONE = -1


def records_of(labels: list[list[int]], answers: list[list[int]], scores: list[list[float]]) -> EpisodeRecords:
    return make_stream_records(np.array(labels), np.array(answers), top_probability=np.array(scores))


def test_a_start_is_where_the_class_is_new_and_an_activity() -> None:
    found = Starts.of(np.array([[0, 0, NONE, 1, 2], [NONE, NONE, 0, 0, 0]]))
    assert list(zip(*(column.tolist() for column in found), strict=True)) == [
        (0, 0, 0),
        (0, 3, 1),
        (0, 4, 2),
        (1, 2, 0),
    ]


def test_detections_are_ranked_and_each_start_is_found_once() -> None:
    # At 1 fps, class 0 starts at 2 in the first episode and at 1 in the second. It is answered from 4 on with 0.9 and
    # from 6 on with 0.7 in the first, and from 1 on with 0.8 in the second.
    labels = [[NONE, NONE, 0, 0, 0, 0, 0, 0], [NONE, 0, 0, 0, 0, 0, 0, NONE]]
    answers = [[NONE, NONE, NONE, NONE, 0, NONE, 0, 0], [NONE, 0, 0, 0, 0, 0, 0, NONE]]
    scores = [[0.5, 0.5, 0.5, 0.5, 0.9, 0.5, 0.7, 0.7], [0.5, 0.8, 0.8, 0.8, 0.8, 0.8, 0.8, 0.5]]
    found = point_map(records_of(labels, answers, scores), fps=1.0)
    assert tuple(found) == OFFSETS
    # Within 1 s only the second detection is right: one of two starts, at a precision of a half.
    assert found[1] == pytest.approx(0.5 * 0.5)
    # Within 2 s the first is right too, and the third has the start that the first has.
    assert found[2] == found[10] == pytest.approx(1.0)


def test_precision_is_made_to_fall_and_classes_count_alike() -> None:
    # Class 0 starts at 1, 11 and 21: found, then a false one at 16, then found twice. Class 1, at 31, is not found.
    labels, answers, scores = (np.full((1, 40), value) for value in (NONE, NONE, 0.5))
    labels[0, [1, 11, 21]], labels[0, 31] = 0, 1
    answers[0, [1, 11, 16, 21]] = 0
    scores = scores.astype(float)
    scores[0, [1, 16, 11, 21]] = 0.9, 0.8, 0.7, 0.6
    found = point_map(make_stream_records(labels, answers, top_probability=scores), fps=1.0)
    assert found[1] == pytest.approx(np.mean([(1 + 3 / 4 + 3 / 4) / 3, 0.0]))


def test_f1_is_the_mean_over_the_classes_that_are_shown() -> None:
    labels, answers = np.array([0, 0, 0, 1]), np.array([0, 0, 1, 1])
    assert macro_f1(labels, answers) == pytest.approx(np.mean([2 * 2 / (2 + 3), 2 * 1 / (2 + 1)]))
    assert macro_f1(labels, labels) == 1
    assert macro_f1(labels, np.array([2, NONE, 2, 2])) == 0


@pytest.mark.parametrize("seed", range(3))
def test_who_is_always_right_has_all_of_it(seed: int) -> None:
    labels = np.repeat(np.random.default_rng(seed).integers(-1, 3, size=(4, 20)), 5, axis=1)
    right = stream_scores(make_stream_records(labels, labels), fps=5.0)
    assert right.f1_mean == right.point_map_mean == right.frames_right == right.recognised == pytest.approx(100)
    assert right.false_alarms_per_min == right.delay_s == 0
    late = np.roll(labels, 8, axis=1)  # 1.6 s
    shifted = stream_scores(make_stream_records(labels, late), fps=5.0)
    assert shifted.point_map["1"] < shifted.point_map["2"] <= 100
