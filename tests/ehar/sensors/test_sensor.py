"""The noise draws, and the perfect sensor."""

import numpy as np
import pytest

from ehar.arrays import BoolArray, FloatArray
from ehar.camera import Camera, project
from ehar.errors import UsageError
from ehar.sensors.estimator import EstimatorSensor
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.registry import make_sensor
from ehar.sensors.sensing import sense
from ehar.sensors.sensor import Sensed, SensorNoise, draw_noise
from ehar.world import PAPER
from tests.helpers.fakes import SKELETON, tiny_data


def test_draws_have_their_shapes_and_distributions() -> None:
    noise = draw_noise(np.random.default_rng(0), (50, 20), 2, 16)
    assert noise.localisation.shape == (50, 20, 2, 16, 2)
    assert noise.dropout.shape == (50, 20, 2, 16)
    assert noise.swap.shape == (50, 20, 2)
    assert noise.localisation.std() == pytest.approx(1, abs=0.02)
    for uniform in (noise.dropout, noise.swap):
        assert uniform.min() >= 0
        assert uniform.max() < 1
        assert uniform.mean() == pytest.approx(0.5, abs=0.02)


def test_one_frame_of_the_draws_and_its_forks() -> None:
    noise = draw_noise(np.random.default_rng(0), (5, 7), 2, 3)
    for of_frame, forked, draws in zip(noise.frame(4), noise.frame(4).forked(), noise, strict=True):
        np.testing.assert_array_equal(of_frame, draws[:, 4])
        np.testing.assert_array_equal(forked, draws[:, None, 4])


def test_the_perfect_sensor_sees_every_joint_exactly() -> None:
    rng = np.random.default_rng(1)
    positions, viewpoints = rng.normal(0, 0.5, (4, 2, 6, 3)), PAPER.sample_starts(rng, 4)
    camera = Camera(width=640, height=480, focal_length=500.0)
    sensed = PerfectSensor(camera=camera).sense(positions, viewpoints, draw_noise(rng, (4,), 2, 6))
    np.testing.assert_array_equal(sensed.joints_2d, project(positions, viewpoints, camera)[0])
    np.testing.assert_array_equal(sensed.confidence, np.ones((4, 2, 6)))


def test_sensors_by_name() -> None:
    assert isinstance(make_sensor("perfect", tiny_data()), PerfectSensor)
    estimator = make_sensor("estimator", tiny_data())
    assert isinstance(estimator, EstimatorSensor)
    assert estimator.skeleton is SKELETON
    with pytest.raises(UsageError, match="unknown sensor 'radar'; expected one of: perfect, estimator"):
        make_sensor("radar", tiny_data())


def test_a_sensor_s_own_is_told_by_name_what_is_hidden() -> None:
    """It may have other arguments before that one."""
    given: list[object] = []

    class Blurs(PerfectSensor):
        def sense(  # type: ignore[override]
            self,
            positions: FloatArray,
            viewpoint: FloatArray,
            noise: SensorNoise,
            blur: float = 0.0,
            *,
            hidden: BoolArray | None = None,
        ) -> Sensed:
            given.append((blur, hidden))
            return super().sense(positions, viewpoint, noise, hidden)

    positions = np.zeros((2, 1, 6, 3))
    hidden = np.zeros((2, 1, 6), dtype=bool)
    hidden[0, 0, 3] = True
    sensed = sense(
        Blurs(),
        positions,
        np.full((2, 3), (8.0, 0.0, 1.5)),
        draw_noise(np.random.default_rng(0), (2,), 1, 6),
        hidden=hidden,
    )
    assert given == [(0.0, hidden)] and sensed.confidence[0, 0, 3] == 0 and sensed.confidence[1].all()
