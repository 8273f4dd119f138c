"""What is missing tells nothing of what comes behind it: not through the sensors, not through the centre."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ehar.batch import noise_of
from ehar.data.streams.data import StreamData
from ehar.data.streams.file import load_streams, save_streams
from ehar.data.streams.scenario import StreamScenarios
from ehar.data.surroundings import surroundings_of
from ehar.sensors.registry import SENSORS, make_sensor
from ehar.sensors.sensing import sense
from ehar.sensors.sensor import Sensed
from ehar.world import CROWD, PAPER, ROOM, World
from tests.helpers.streams import raising_streams

FRAMES = 30  # of each stream, at 10 fps


def with_gap(begin: int, end: int, *, later: float) -> StreamData:
    """Return streams as a file gives them back; behind a gap of the first, people stand `later` metres farther on."""
    data = replace(raising_streams(people=3, seconds=3), is_test=None)
    positions, missing = data.positions.copy(), data.missing.copy()
    positions[end:FRAMES] += np.array([later, 0, 0], dtype=np.float32)
    positions[begin:end], missing[begin:end] = np.nan, True
    with TemporaryDirectory() as folder:
        save_streams(Path(folder) / "raising.npz", replace(data, positions=positions, missing=missing))
        return load_streams(Path(folder) / "raising.npz")


def shown(data: StreamData, sensor: str, world: World = PAPER) -> Sensed:
    """Return what a camera that stays is shown of the whole first stream, (L, ...)."""
    scenarios, chosen = StreamScenarios(data, int(data.lengths[0]), np.array([0]), np.array([0])), np.array([0])
    start = PAPER.sample_starts(np.random.default_rng(1), 1)
    noise = noise_of(scenarios, 1, np.random.default_rng(2))
    around, joints = surroundings_of(scenarios, chosen, world, np.random.default_rng(3)), scenarios.positions(chosen)
    hidden = None
    if around is not None:
        assert all(np.isfinite(array).all() for array in around.arrays.values())
        hidden = around.hide(np.repeat(start[:, None], joints.shape[1], axis=1), joints, slice(None))
    sensed = sense(make_sensor(sensor, data), joints, start[:, None], noise, hidden=hidden)
    return Sensed(sensed.joints_2d[0], sensed.confidence[0])


@given(
    gap=st.tuples(st.integers(1, FRAMES - 2), st.integers(1, 12)),
    fps=st.sampled_from([5.0, 10.0, 12.5, 15.0, 30.0]),
    sensor=st.sampled_from(sorted(SENSORS)),
    world=st.sampled_from([PAPER, ROOM, CROWD]),
)
@example(gap=(10, 5), fps=10.0, sensor="estimator", world=CROWD)
@example(gap=(10, 1), fps=15.0, sensor="perfect", world=PAPER)
@example(gap=(1, 5), fps=10.0, sensor="estimator", world=ROOM)
def test_two_streams_that_differ_behind_a_gap_look_the_same_up_to_its_end(
    gap: tuple[int, int], fps: float, sensor: str, world: World
) -> None:
    begin, end = gap[0], min(sum(gap), FRAMES - 1)
    one, other = (with_gap(begin, end, later=later).resampled(fps) for later in (0.0, 0.9))
    np.testing.assert_array_equal(one.missing, other.missing)
    times = np.arange(one.lengths[0]) / fps * 10  # in frames of the file
    here, there = shown(one, sensor, world), shown(other, sensor, world)
    until, gone = times < end - 1e-6, (times >= begin - 1e-6) & (times < end - 1e-6)
    for a, b in zip(here, there, strict=True):
        np.testing.assert_array_equal(a[until], b[until])
    assert not here.confidence[gone].any()
    middle = np.array([make_sensor(sensor, one).camera.width, make_sensor(sensor, one).camera.height]) / 2
    np.testing.assert_array_equal(here.joints_2d[gone], np.broadcast_to(middle, here.joints_2d[gone].shape))
    assert here.confidence[times < begin - 1].any() == (times < begin - 1).any()
    behind = ~one.missing[: len(times)] & ~until
    assert not behind.any() or (here.joints_2d[behind] != there.joints_2d[behind]).any()


@pytest.mark.parametrize("sensor", sorted(SENSORS))
def test_the_frames_that_are_not_missing_are_sensed_as_ever(sensor: str) -> None:
    data = raising_streams(people=3, seconds=3)
    scenarios = StreamScenarios(data, FRAMES, np.arange(3), np.zeros(3, dtype=np.int64))
    positions, noise = scenarios.positions(np.arange(3)), noise_of(scenarios, 3, np.random.default_rng(2))
    viewpoints = PAPER.sample_starts(np.random.default_rng(1), 21).reshape(3, 7, 3)  # 7 alternatives, as oracles try
    gone = positions.copy()
    gone[1] = np.nan
    for frame in (0, 12):
        forked = noise.frame(frame).forked()
        whole, part = (
            sense(make_sensor(sensor, data), each[:, None, frame], viewpoints, forked) for each in (positions, gone)
        )
        for a, b in zip(whole, part, strict=True):
            np.testing.assert_array_equal(a[[0, 2]], b[[0, 2]])
        assert not part.confidence[1].any() and part.joints_2d.shape == whole.joints_2d.shape
