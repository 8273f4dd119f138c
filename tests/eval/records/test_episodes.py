"""What is kept of each frame of each episode, and read back."""

import numpy as np

from ehar.rollout import Record
from eval.records.episodes import DIGITS, join_records, record_episodes
from tests.helpers.made_records import flown, make_records


def test_records_keep_what_metrics_need() -> None:
    log_probs = np.log(np.array([[[0.7, 0.2, 0.1], [0.2, 0.5, 0.3]]], dtype=np.float32))
    record = Record(np.full((1, 2, 3), 1.23456789), log_probs, 0.0)
    told = {"first": np.array([3]), "start": np.zeros((1, 3)), "label": np.array([1]), "subjects": np.array([[4, 7]])}
    kept = record_episodes(record, sequence=["a"], **told)
    assert kept.subjects.tolist() == [[4, 7]]
    assert kept.predicted.tolist() == [[0, 1]]
    assert kept.correct.tolist() == [[False, True]]
    assert kept.true_probability.tolist() == [[0.2, 0.5]]
    assert kept.top_probability.tolist() == [[0.7, 0.5]]
    assert kept.second_probability is not None and kept.second_probability.tolist() == [[0.2, 0.3]]
    assert kept.viewpoint[0, 0, 0] == round(1.23456789, DIGITS)


def test_batches_join_in_order() -> None:
    whole = join_records([make_records(1), make_records(2)])
    assert len(whole) == 18
    np.testing.assert_array_equal(whole.predicted[9:], make_records(2).predicted)


def test_batches_of_flights_join_in_order() -> None:
    whole = join_records([flown(make_records(1)), flown(make_records(2), seed=5)])
    assert whole.flight is not None
    np.testing.assert_array_equal(whole.flight.effort[9:], np.random.default_rng(5).random((8, 9)).round(DIGITS)[3])
