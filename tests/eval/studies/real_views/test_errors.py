"""Errors that are known come out as they are: those of our estimator, and those that recordings are made with."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.world import INDOOR
from eval.studies.real_views.alignment import Pose
from eval.studies.real_views.errors import JointErrors, real_errors, simulated_errors
from eval.studies.real_views.executions import Poses, find_executions
from tests.helpers.recordings import TURNS, recorded_solo, rotation


def poses() -> Poses:
    """Return how the cameras of `recorded_solo` really stand."""
    names, found = {one.name for one in find_executions(recorded_solo())}, {}
    for one, turn in TURNS.items():
        for other, also in TURNS.items():
            turned = rotation(also - turn)
            place = np.array([0.1 * other, 3.0, 0]) - turned @ np.array([0.1 * one, 3.0, 0])
            found.update({(name, one, other): Pose(turned, place) for name in names if one != other})
    return found


@pytest.fixture(scope="module")
def simulated() -> JointErrors:
    data = recorded_solo(frames=60)
    return simulated_errors(data, find_executions(data), poses(), INDOOR.camera)


def test_our_estimator_has_the_errors_that_it_is_given(simulated: JointErrors) -> None:
    assert simulated.relative_noise == pytest.approx(0.01, abs=0.002)
    assert simulated.occluded_noise == pytest.approx(4, abs=0.6)
    assert abs(simulated.correlation) < 0.03
    assert simulated.lasting < 0.1  # a mean over 60 frames
    front, side, back = simulated.swaps
    assert front == back == 0 and 0.005 < side < 0.08


@pytest.mark.parametrize("noise", [0.01, 0.03])
def test_noise_of_trackers_is_told_for_one_of_them(noise: float) -> None:
    data = recorded_solo(frames=60, noise=noise)
    found = real_errors(data, find_executions(data), poses(), INDOOR.camera)
    height = np.ptp(data.positions[..., 2], axis=-1).mean()
    whole = np.hypot(found.relative_noise, found.noise_floor / (height * 525 / 3))  # people are of one height
    assert whole == pytest.approx(noise / height, rel=0.2)
    assert abs(found.correlation) < 0.35
    assert found.swaps == pytest.approx((0, 0, 0), abs=0.01)


def test_backs_that_are_taken_for_fronts_are_swaps() -> None:
    data = recorded_solo(frames=60)
    third = np.repeat(data.views == 3, data.lengths)  # type: ignore[arg-type]
    positions = data.positions.copy()
    positions[third] = positions[third][:, :, data.skeleton.mirror]
    found = real_errors(replace(data, positions=positions), find_executions(data), poses(), INDOOR.camera)
    assert 0.2 < np.mean(found.swaps) < 0.45  # 4 of 6 pairs have one such camera; half is counted for each tracker
