"""What simulation predicts of cameras is scored against what really came out there."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.data.scenario import split_parts
from ehar.recogniser import Recognition
from ehar.sensors.sensor import Sensed
from ehar.world import INDOOR
from eval.studies.real_views.choice import _score, _View, predict_cameras
from eval.studies.real_views.executions import Execution, find_executions, find_poses
from tests.helpers.recordings import recorded_solo

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


class SaysTheFirstClass:
    """A recogniser that always names the first of three classes."""

    class_names = ("a", "b", "c")
    embedding_size = 1

    def start(self, episodes: int) -> int:
        return episodes

    def step(self, state: int, sensed: Sensed, viewpoint: np.ndarray) -> tuple[Recognition, int]:
        return Recognition(np.tile([0.0, -9.0, -9.0], (state, 1)), np.zeros((state, 1))), state


def test_executions_that_the_recogniser_learned_from_are_left_out_under_any_name() -> None:
    data = recorded_solo(executions=24)
    found = find_executions(data)
    poses = find_poses(data, found)
    learned = split_parts(data).recogniser
    unknown = [one for one in found if not set(one.sequences.values()) & set(learned.tolist())]
    told = predict_cameras(data, found, poses, SaysTheFirstClass(), INDOOR, 10)
    assert told.executions == len(unknown) > 0
    positions = data.positions.copy()  # what it learned from is now a copy of an execution that it did not know
    copy = slice(*data.offsets[learned[0] : learned[0] + 2])
    positions[copy] = data.sequence(next(iter(unknown[0].sequences.values())))
    fewer = predict_cameras(replace(data, positions=positions), found, poses, SaysTheFirstClass(), INDOOR, 10)
    assert fewer.executions == len(unknown) - 1
