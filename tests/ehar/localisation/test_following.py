"""The centre that follows people: filterpy's filter, late by its delay, and without a look ahead."""

import numpy as np
import pytest
from filterpy.common import Q_discrete_white_noise
from filterpy.kalman import KalmanFilter

from ehar.arrays import BoolArray, FloatArray
from ehar.localisation import CentreLimits, FollowedCentre, Localisation

FPS = 30.0


Gaps = tuple[tuple[int, int], ...]


def within(gaps: Gaps, frames: int = 240) -> BoolArray:
    """Return which frames lie in one of the gaps, (T,)."""
    return np.isin(np.arange(frames), [frame for begin, end in gaps for frame in range(begin, end)])


def walk(frames: int = 240, seed: int = 0) -> FloatArray:
    """Return somebody's way (T, 3) at 1 m/s, with turns."""
    rng = np.random.default_rng(seed)
    heading = np.cumsum(0.1 * rng.standard_normal(frames))
    step = np.stack([np.cos(heading), np.sin(heading), np.zeros(frames)], axis=1) / FPS
    return np.cumsum(step, axis=0) + np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize(("axis", "gaps"), [(0, ()), (1, ((50, 51), (120, 150))), (2, ((1, 4), (230, 240)))])
def test_without_delay_it_is_filterpy_s_filter_of_constant_velocity(axis: int, gaps: Gaps) -> None:
    told, way = Localisation(noise=0.05, delay=0.0), walk()
    missing = within(gaps)
    measured = way + 0.05 * np.random.default_rng((0, 3)).standard_normal(way.shape)
    kalman = KalmanFilter(dim_x=2, dim_z=1)
    kalman.x = np.array([[way[0, axis]], [0.0]])
    kalman.F, kalman.H = np.array([[1, 1 / FPS], [0, 1]]), np.array([[1.0, 0.0]])
    kalman.R, kalman.P = np.array([[0.05**2]]), np.diag([0.05**2, 1.0])
    kalman.Q = Q_discrete_white_noise(dim=2, dt=1 / FPS, var=told.agility**2)
    expected = [way[0, axis]]
    for position, gone in zip(measured[1:, axis], missing[1:], strict=True):
        kalman.predict()
        kalman.update(None if gone else position)
        expected.append(float(kalman.x[0, 0]))
    np.testing.assert_allclose(told.estimated(way, FPS, 3, missing)[0][:, axis], expected, atol=1e-9)


def test_in_a_long_gap_people_are_thought_to_stay() -> None:
    way = np.stack([np.arange(480) / FPS, np.zeros(480), np.ones(480)], axis=1)  # at 1 m/s
    way[90:] = way[90]  # then they stand, while nobody sees them for 10 s
    missing = within(((90, 390),), 480)
    centres = Localisation(noise=0.0).estimated(way, FPS, 0, missing)[0]
    arrived = round(0.1 * FPS)
    np.testing.assert_array_equal(centres[122 + arrived : 390 + arrived], np.tile(centres[122 + arrived], (268, 1)))
    assert 0.8 < np.linalg.norm(centres - way, axis=1).max() < 1.3  # 1 s at 1 m/s, not 10
    assert np.linalg.norm(centres[-1] - way[-1]) < 0.05


def test_a_gap_says_nothing_and_a_stream_may_begin_with_one() -> None:
    way, missing = walk(), within(((0, 5), (100, 130)))
    other = np.where(missing[:, None], 7.0, way)
    centres = Localisation().estimated(way, FPS, 0, missing)[0]
    np.testing.assert_array_equal(centres, Localisation().estimated(other, FPS, 0, missing)[0])
    np.testing.assert_array_equal(centres[:6], np.tile(way[5], (6, 1)))
    assert np.linalg.norm(centres - way, axis=1)[135:].max() < 0.5  # it finds people again


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.5])
def test_what_it_says_rests_on_what_has_arrived(delay: float) -> None:
    told, way = Localisation(delay=delay), walk()
    late = round(delay * FPS)
    changed = way.copy()
    changed[120:] += 5.0
    before, after = told.estimated(way, FPS, 0)[0], told.estimated(changed, FPS, 0)[0]
    np.testing.assert_array_equal(before[: 120 + late], after[: 120 + late])
    assert np.abs(before[120 + late] - after[120 + late]).max() > 0.1


def test_it_stays_near_a_person_who_walks_and_a_worse_localisation_is_farther_off() -> None:
    way = walk(900)
    off = [
        np.linalg.norm(Localisation(noise=noise, delay=delay).estimated(way, FPS, 0)[0] - way, axis=1)[60:].mean()
        for noise, delay in ((0.0, 0.0), (0.05, 0.1), (0.2, 0.5))
    ]
    assert off[0] < 0.01 < off[1] < 0.15 < off[2] < 0.6


def test_streams_have_errors_of_their_own() -> None:
    way = walk()
    one, again, other = (Localisation().estimated(way, FPS, stream)[0] for stream in (0, 0, 1))
    np.testing.assert_array_equal(one, again)
    assert np.abs(one - other).max() > 0.01


def test_places_that_are_told_now_and_then_are_followed_and_forgotten() -> None:
    limits = CentreLimits(speed=1.5, vertical_speed=0.6, acceleration=0.8, jerk=0.8)
    rng, step = np.random.default_rng(0), 1 / FPS
    centre, apart, motion = FollowedCentre(np.zeros(3), 0.0, step, limits), [], []
    for frame in range(480):
        time, place = frame * step, np.array([min(frame * step, 10.0), 0.0, 0.0])
        if rng.random() < 0.3 and frame < 300:  # frames come as they like, some twice or late
            centre.tell(place + 0.05 * rng.standard_normal(3), time)
            centre.tell(place + 5.0, time - 0.2)
        motion.append(np.stack(centre.next()))
        apart.append(np.linalg.norm(motion[-1][0] - place))
    assert max(apart[200:300]) < 0.3
    position, velocity, acceleration, jerk = np.moveaxis(np.array(motion), 1, 0)
    for values, most in ((velocity, 1.5), (acceleration, 0.8), (jerk, 0.8)):
        assert np.linalg.norm(values, axis=1).max() <= most + 1e-9
    led_on = position + step * (velocity + step * (acceleration / 2 + step * jerk / 6))
    np.testing.assert_allclose(led_on[:-1], position[1:], atol=1e-12)
    assert np.linalg.norm(velocity[-1]) < 0.05 and 9.5 < position[-1, 0] < 12.5, "after a second it comes to rest"
    centre.tell(np.array([3.0, 0.0, 0.0]), -50.0)  # another clock
    for frame in range(600):
        centre.tell(np.array([3.0, 0.0, 0.0]), -50.0 + frame * step)
        last = centre.next()
    np.testing.assert_allclose(last.position, [3, 0, 0], atol=0.1)
