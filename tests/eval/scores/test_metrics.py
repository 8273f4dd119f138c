import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eval.scores.metrics import (
    ACC_AT,
    PROBABILITY_FLOOR,
    acc_at,
    ece,
    gap_closed,
    late_ece,
    mean_acc,
    nll,
    path_length,
    reliability,
)
from eval.scores.planner_metrics import ece_of_late_frames
from tests.helpers.made_records import make_stream_records

CORRECT = np.array([[0, 0, 1, 1, 1], [0, 1, 1, 0, 1]], dtype=bool)


@pytest.mark.parametrize(("percent", "expected"), [(10, 0.0), (20, 0.0), (30, 0.5), (50, 1.0), (70, 0.5), (100, 1.0)])
def test_acc_at_is_the_first_frame_not_before_the_ratio(percent: int, expected: float) -> None:
    # L = 5: 10 % and 20 % are frame 1, 30 % is frame 2, 50 % is frame 3, 70 % is frame 4.
    assert acc_at(CORRECT, percent) == expected


def test_acc_at_of_60_frames_reads_the_frames_of_the_paper() -> None:
    frames = [6, 18, 30, 42, 54, 60]
    for percent, frame in zip(ACC_AT, frames, strict=True):
        correct = np.zeros((1, 60), dtype=bool)
        correct[0, frame - 1] = True
        assert acc_at(correct, percent) == 1.0


@given(length=st.integers(1, 200), percent=st.integers(1, 100))
def test_acc_at_reads_exactly_one_frame_and_never_less_than_was_asked_for(length: int, percent: int) -> None:
    read = [frame for frame in range(length) if acc_at(np.arange(length)[None] == frame, percent) == 1.0]
    assert len(read) == 1
    assert 100 * (read[0] + 1) >= percent * length > 100 * read[0]


def test_mean_acc_is_of_each_episode() -> None:
    assert mean_acc(CORRECT).tolist() == [0.6, 0.6]


def test_gap_closed_is_0_for_no_act_1_for_the_oracle_and_below_0_for_worse() -> None:
    closed = gap_closed(np.array([0.4, 0.8, 0.6, 0.3]), np.array(0.4), np.array(0.8))
    np.testing.assert_allclose(closed, [0, 1, 0.5, -0.25])


def test_gap_closed_of_the_papers_agent() -> None:
    # Table 1: 52.79 without acting, 77.53 for the oracle, 64.27 for the paper's agent.
    np.testing.assert_allclose(gap_closed(np.array(64.27), np.array(52.79), np.array(77.53)), 0.464, atol=5e-4)


@pytest.mark.parametrize("oracle", [0.5, 0.4, np.nextafter(0.5, 1)])
def test_gap_closed_does_not_exist_without_a_gap(oracle: float) -> None:
    assert np.isnan(gap_closed(np.array(0.6), np.array(0.5), np.array(oracle)))


def test_nll_is_the_mean_and_a_probability_of_zero_counts_as_the_floor() -> None:
    assert nll(np.array([[1.0, np.exp(-2)]])) == pytest.approx(1.0)
    assert nll(np.array([[0.0]])) == pytest.approx(-np.log(PROBABILITY_FLOOR))


def test_ece_by_hand() -> None:
    # Bin [0.6, 0.667): confidence 0.62, accuracy 0.5. Bin [0.933, 1]: confidences 0.95 and 1.0, accuracy 1.
    top = np.array([[0.62, 0.62], [0.95, 1.0]])
    correct = np.array([[True, False], [True, True]])
    assert ece(top, correct) == pytest.approx(0.5 * 0.12 + 0.5 * 0.025)


def test_late_ece_is_that_of_the_second_half() -> None:
    top = np.array([[1.0, 1.0, 0.75, 0.75, 0.75], [1.0, 1.0, 0.75, 0.5, 0.5]])
    correct = np.array([[False, False, True, True, True], [False, False, False, True, False]])
    assert late_ece(top, correct) == pytest.approx(0)
    assert ece(top, correct) > 0.3


def test_late_ece_of_a_stream_is_that_of_the_second_half_of_each_activity() -> None:
    labels = np.array([[-1, -1, 0, 0, 0, 0, -1, 1, 1, -1]])
    answers = np.array([[0, 0, 1, 1, 0, 0, 0, 1, 1, 0]])
    top = np.array([[0.9, 0.9, 0.9, 0.9, 0.8, 0.8, 0.9, 0.6, 0.6, 0.9]])
    records = make_stream_records(labels, answers, top_probability=top)
    # Half of the first activity is over in its second frame, in which it is not recognised yet, at 50 %.
    wrong, right, other = 0.9 * 1, 0.2 * 10, 0.4 * 11
    assert ece_of_late_frames(records) == pytest.approx((wrong + right + other) / 22)


def test_ece_of_calibrated_confidence_vanishes_and_of_misplaced_certainty_is_one() -> None:
    assert ece(np.full((1, 4), 0.75), np.array([[True, True, True, False]])) == pytest.approx(0)
    assert ece(np.ones((2, 3)), np.zeros((2, 3), dtype=bool)) == pytest.approx(1)


def test_path_length_counts_metres_not_angles() -> None:
    # From 5 m to 6 m straight outward; then a quarter turn at the horizon in one step: a chord of 6 sqrt(2) m.
    outward = [[5.0, 0.3, 1.0], [5.5, 0.3, 1.0], [6.0, 0.3, 1.0]]
    turn = [[6.0, 0.0, np.pi / 2], [6.0, np.pi / 2, np.pi / 2], [6.0, np.pi / 2, np.pi / 2]]
    np.testing.assert_allclose(path_length(np.array([outward, turn])), [1.0, 6 * np.sqrt(2)])


def test_turning_at_the_pole_is_no_way() -> None:
    np.testing.assert_allclose(path_length(np.array([[7.0, 0.0, 0.0], [7.0, 2.0, 0.0]])), 0, atol=1e-12)


def test_bins_hold_what_falls_into_them() -> None:
    bins = reliability(np.array([[0.5, 0.52], [0.99, 1.0]]), np.array([[True, False], [True, True]]))
    assert bins.share[7] == bins.share[14] == 0.5
    assert (bins.accuracy[7], bins.accuracy[14]) == (0.5, 1.0)
    assert bins.confidence[7] == pytest.approx(0.51)
    assert np.isnan(np.delete(bins.accuracy, [7, 14])).all()


def test_the_mean_distance_to_the_diagonal_is_the_calibration_error() -> None:
    rng = np.random.default_rng(0)
    sure, right = rng.random((40, 9)), rng.random((40, 9)) < 0.6
    bins = reliability(sure, right)
    assert bins.share.sum() == pytest.approx(1)
    assert np.nansum(bins.share * np.abs(bins.accuracy - bins.confidence)) == pytest.approx(ece(sure, right))
