import numpy as np
import pytest

from eval.scores.metrics import ece
from eval.scores.reliability import reliability


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
