"""What simulation predicts of cameras is scored against what really came out there."""

import numpy as np
import pytest

from eval.studies.real_views.choice import _score, _View
from eval.studies.real_views.executions import Execution

LEFT, RIGHT, THIRD = 1, 2, 3


def scored(offset: float, sign: float = 1.0) -> tuple[float | None, float | None, float | None, int]:
    """Score predictions that are the real accuracies times a sign, and an offset."""
    rng = np.random.default_rng(0)
    executions = [Execution(f"e{i}", i % 2, 0, {LEFT: 0, RIGHT: 1, THIRD: 2}) for i in range(8)]
    truth = {(one.name, camera): float(rng.random()) for one in executions for camera in one.sequences}
    guesses = {
        _View(one, source, camera): offset + sign * truth[one.name, camera]
        for one in executions
        for source in one.sequences
        for camera in one.sequences
        if source != camera
    }
    found = _score(guesses, truth)
    assert found.executions == 8
    return found.correlation, found.within_classes, found.better, found.pairs


def test_a_prediction_that_is_right_but_for_an_offset_names_every_better_camera() -> None:
    assert scored(0.3) == pytest.approx((1, 1, 1, 24))  # one pair of other cameras for each of 3 sources


def test_a_prediction_upside_down_names_none() -> None:
    assert scored(1, sign=-1) == pytest.approx((-1, -1, 0, 24))


def test_a_prediction_that_knows_no_difference_is_as_good_as_chance() -> None:
    correlation, within, better, _ = scored(0.5, sign=0)
    assert (correlation, within, better) == (None, None, 0.5)


def test_cameras_that_are_equally_good_in_truth_do_not_count() -> None:
    one = Execution("e", 0, 0, {LEFT: 0, RIGHT: 1, THIRD: 2})
    truth = {("e", LEFT): 0.5, ("e", RIGHT): 0.5, ("e", THIRD): 0.7}
    found = _score({_View(one, THIRD, LEFT): 0.9, _View(one, THIRD, RIGHT): 0.1}, truth)
    assert (found.pairs, found.better) == (0, None)
