"""What simulation predicts of cameras is scored against what really came out there, at the same moments."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.data.scenario import split_parts
from ehar.recogniser import Recognition
from ehar.sensors.sensor import Sensed
from ehar.viewpoint import wrap_difference
from ehar.world import INDOOR
from eval.studies.real_views.choice import ViewChoice, _score, _View, predict_cameras
from eval.studies.real_views.executions import Execution, agreed, find_executions, find_poses
from eval.studies.real_views.moments import shared_moments
from tests.helpers.recordings import TURNS, recorded_solo

LEFT, RIGHT, THIRD = 1, 2, 3


def view(execution: Execution, source: int, camera: int) -> _View:
    return _View(execution, source, camera, begin=0, frames=10)


def scored(offset: float, sign: float = 1.0) -> ViewChoice:
    """Score predictions that are the real accuracies times a sign, and an offset."""
    rng = np.random.default_rng(0)
    executions = [Execution(f"e{i}", i % 2, i // 2, {LEFT: 0, RIGHT: 1, THIRD: 2}) for i in range(8)]
    truth = {(one.name, camera): float(rng.random()) for one in executions for camera in one.sequences}
    guesses = {
        view(one, source, camera): offset + sign * truth[one.name, camera]
        for one in executions
        for source in one.sequences
        for camera in one.sequences
    }
    found = _score(guesses, truth)
    assert found.executions == 8 and found.basis.people == 4
    return found


def test_a_prediction_that_is_right_but_for_an_offset_names_every_better_camera() -> None:
    found = scored(0.3)
    assert (found.correlation, found.within_classes) == pytest.approx((1, 1))
    assert found.pairs == 24  # one pair of other cameras for each of 3 sources
    assert found.better.share == found.ceiling.share == 1 and found.better.ends == (1, 1)


def test_a_prediction_upside_down_names_none() -> None:
    found = scored(1, sign=-1)
    assert (found.correlation, found.within_classes) == pytest.approx((-1, -1))
    assert found.better.share == found.ceiling.share == 0


def test_a_prediction_that_knows_no_difference_is_as_good_as_chance() -> None:
    found = scored(0.5, sign=0)
    assert (found.correlation, found.within_classes, found.better.share) == (None, None, 0.5)


def test_cameras_that_are_equally_good_in_truth_do_not_count() -> None:
    one = Execution("e", 0, 0, {LEFT: 0, RIGHT: 1, THIRD: 2})
    truth = {("e", LEFT): 0.5, ("e", RIGHT): 0.5, ("e", THIRD): 0.7}
    guesses = {view(one, source, camera): 0.9 - camera / 10 for source in truth_cameras() for camera in truth_cameras()}
    found = _score(guesses, truth)
    assert found.pairs == 2  # not LEFT and RIGHT, from THIRD
    assert found.better.share == found.ceiling.share == 0


def truth_cameras() -> tuple[int, ...]:
    return LEFT, RIGHT, THIRD


class SaysTheFirstClass:
    """A recogniser that always names the first of three classes."""

    class_names = ("a", "b", "c")
    embedding_size = 1

    def start(self, episodes: int) -> int:
        return episodes

    def step(self, state: int, sensed: Sensed, viewpoint: np.ndarray) -> tuple[Recognition, int]:
        return Recognition(np.tile([0.0, -9.0, -9.0], (state, 1)), np.zeros((state, 1))), state


class Remembers(SaysTheFirstClass):
    """Keeps the viewpoints and the joints that it was shown."""

    def __init__(self) -> None:
        self.seen: list[tuple[np.ndarray, np.ndarray]] = []

    def step(self, state: int, sensed: Sensed, viewpoint: np.ndarray) -> tuple[Recognition, int]:
        self.seen.append((viewpoint.copy(), sensed.joints_2d.copy()))
        return super().step(state, sensed, viewpoint)


def test_executions_that_the_recogniser_learned_from_are_left_out_under_any_name() -> None:
    data = recorded_solo(executions=24)
    found = find_executions(data)
    poses = agreed(find_poses(data, found), found)
    learned = split_parts(data).recogniser
    unknown = [one for one in found if not set(one.sequences.values()) & set(learned.tolist())]
    told = predict_cameras(data, found, poses, SaysTheFirstClass(), INDOOR, 10)
    assert told.executions == len(unknown) > 0
    positions = data.positions.copy()  # what it learned from is now a copy of an execution that it did not know
    copy = slice(*data.offsets[learned[0] : learned[0] + 2])
    positions[copy] = data.sequence(next(iter(unknown[0].sequences.values())))
    fewer = predict_cameras(replace(data, positions=positions), found, poses, SaysTheFirstClass(), INDOOR, 10)
    assert fewer.executions == len(unknown) - 1


def test_moments_are_those_that_all_cameras_recorded() -> None:
    data = recorded_solo()  # camera k begins two k frames into the motion
    found = find_executions(data)
    moments = shared_moments(data, found[0], find_poses(data, found[:1]))
    assert moments.begin == {1: 4, 2: 2, 3: 0} and moments.frames == 20


def test_a_simulated_camera_stands_where_the_real_one_did_and_sees_the_same_moment() -> None:
    data = recorded_solo(executions=24)
    found = find_executions(data)
    poses = agreed(find_poses(data, found), found)
    recogniser = Remembers()
    told = predict_cameras(data, found, poses, recogniser, INDOOR, 10)
    assert told.frames == 10
    own, simulated = recogniser.seen[0], recogniser.seen[10]  # the first frame of the real views, and of all views
    cameras, turns = len(TURNS), np.array(list(TURNS.values()))
    azimuth = simulated[0][:, 1].reshape(-1, cameras, cameras)  # of an execution, the source, and the camera
    turned = azimuth - np.einsum("ess->es", azimuth)[:, :, None] - (turns[:, None] - turns)
    assert np.abs(wrap_difference(turned)).max() < 0.3  # [rad]; dancers are not where the cameras turn about
    pixels = simulated[1].reshape(-1, cameras, cameras, *simulated[1].shape[1:])
    off = np.linalg.norm(pixels - own[1].reshape(-1, 1, *pixels.shape[2:]), axis=-1)
    away = np.linalg.norm(pixels - np.roll(own[1].reshape(-1, 1, *pixels.shape[2:]), 1, axis=2), axis=-1)
    assert np.median(off) < 12 < np.median(away)  # [px], of the camera itself with our estimator's errors, and another
