"""Training clips: whose motion they show, with which label, and that a seed decides them."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from ehar.data.motion_data import MotionData
from ehar.data.scenario import split_parts
from ehar.errors import DataError
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.registry import make_sensor
from ehar.sensors.sensor import Sensed, SensorNoise
from recognition.networks.features import channel_count
from recognition.training.clips import BODY_SCALE, Clips, ClipSource
from tests.helpers.fakes import tiny_data

LENGTH = 10
SIZE = slice(5, 7)  # of a bone in the image


def source(data: MotionData, sequences: np.ndarray, **changes: object) -> ClipSource:
    options = {"length": LENGTH, "sensor": PerfectSensor(), "views": "paper", "form": "ctrgcn", "augment": False}
    return ClipSource(data=data, sequences=sequences, **{**options, **changes})  # type: ignore[arg-type]


def marked_data(marks: np.ndarray) -> MotionData:
    """Return tiny data whose bodies are `marks` (sequences,) times as large."""
    data = tiny_data()
    frames = np.repeat(marks, data.lengths)
    return replace(data, positions=data.positions * frames[:, None, None, None].astype(np.float32))


def bone_lengths(clips: Clips) -> torch.Tensor:
    """Return the longest bone in the image over each clip, (B,)."""
    return clips.features[..., SIZE].norm(dim=-1).amax(dim=(1, 2, 3))


@pytest.mark.parametrize("sensor", ["perfect", "estimator"])
@pytest.mark.parametrize("views", ["moving", "paper"])
@pytest.mark.parametrize("persons", [1, 2])
def test_shapes(sensor: str, views: str, persons: int) -> None:
    data = tiny_data(persons=persons)
    for form in ("causal", "ctrgcn"):
        clips = source(data, np.arange(6), sensor=make_sensor(sensor, tiny_data()), views=views, form=form).draw(
            np.random.default_rng(0), 4
        )
        assert clips.features.shape == (4, LENGTH, persons, 6, channel_count(persons, view=form == "causal"))
    assert clips.features.dtype == torch.float32
    assert torch.isfinite(clips.features).all()
    assert clips.labels.shape == (4,)


def test_only_sequences_of_the_part_are_drawn_and_all_of_them() -> None:
    parts = split_parts(tiny_data())
    for part in (parts.recogniser, parts.policy, parts.validation, parts.test):
        if len(part) == 0:
            continue
        data = tiny_data()
        # Of every other sequence nothing is finite: one frame of it would be seen in the features.
        spoilt = np.full(len(data.labels), np.nan)
        spoilt[part] = 1.0
        with np.errstate(invalid="ignore"):
            clips = source(marked_data(spoilt), part).draw(np.random.default_rng(0), 64)
        assert torch.isfinite(clips.features).all()
        assert set(clips.labels.tolist()) == set(data.labels[part].tolist())


def test_a_clip_has_the_label_of_its_sequence() -> None:
    marks = np.array([1.0, 3.0, 9.0])[tiny_data().labels]  # a body's size gives its class away
    data = marked_data(marks)
    clips = source(data, np.arange(12)).draw(np.random.default_rng(0), 60)
    lengths = bone_lengths(clips)
    largest = [lengths[clips.labels == label].max() for label in range(3)]
    smallest = [lengths[clips.labels == label].min() for label in range(3)]
    assert largest[0] < smallest[1]
    assert largest[1] < smallest[2]


def test_the_first_frame_is_uniform_over_a_sequence() -> None:
    # Two frames of 20 are larger: the clips that hold one of them are those that begin in 11 of 11, 1 of 11 places.
    data = tiny_data(sequences=2)
    positions = data.positions.copy()
    positions[[0, 20]] *= 20
    clips = source(replace(data, positions=positions), np.arange(2)).draw(np.random.default_rng(0), 600)
    first = (bone_lengths(clips) > 8).float().mean()
    assert first == pytest.approx(1 / 11, abs=0.04)


def test_long_sequences_are_drawn_more_often() -> None:
    data = tiny_data(sequences=2, frames=20)
    joined = replace(
        data,
        positions=np.concatenate([data.positions, data.positions[-20:], data.positions[-20:]]),
        offsets=np.array([0, 20, 80]),
    )
    clips = source(joined, np.arange(2)).draw(np.random.default_rng(0), 600)
    assert (clips.labels == 1).float().mean() == pytest.approx(6 / 8, abs=0.06)


class RecordingSensor(PerfectSensor):
    """Keeps the joints in space that it was shown."""

    def sense(self, positions: np.ndarray, viewpoint: np.ndarray, noise: SensorNoise) -> Sensed:
        self.positions = positions
        return super().sense(positions, viewpoint, noise)


def test_bodies_are_scaled_as_wholes_and_only_where_asked() -> None:
    data = tiny_data(sequences=1, frames=LENGTH)  # one window: clips differ in scale alone
    sensors = {augment: RecordingSensor() for augment in (False, True)}
    for augment, sensor in sensors.items():
        source(data, np.arange(1), augment=augment, sensor=sensor).draw(np.random.default_rng(0), 200)
    plain, scaled = sensors[False].positions, sensors[True].positions
    np.testing.assert_allclose(plain, np.broadcast_to(plain[:1], plain.shape))
    np.testing.assert_allclose(plain[:, 0].mean(axis=(1, 2)), 0, atol=1e-6)
    scale = scaled[:, 0, 0, 0, 2] / plain[:, 0, 0, 0, 2]
    np.testing.assert_allclose(scaled, scale[:, None, None, None, None] * plain, rtol=1e-4, atol=1e-6)
    assert 1 - BODY_SCALE <= scale.min() < 1 - 0.9 * BODY_SCALE
    assert 1 + 0.9 * BODY_SCALE < scale.max() <= 1 + BODY_SCALE


def test_a_seed_decides_the_clips() -> None:
    sensor = make_sensor("estimator", tiny_data())
    clips = source(tiny_data(), np.arange(12), sensor=sensor, views="moving", augment=True)
    first, again, other = (clips.draw(np.random.default_rng(seed), 5) for seed in (0, 0, 1))
    assert torch.equal(first.features, again.features)
    assert torch.equal(first.labels, again.labels)
    assert not torch.equal(first.features, other.features)


def test_no_sequence_as_long_as_a_clip() -> None:
    with pytest.raises(
        DataError, match=r"tiny: expected a training sequence of at least 21 frames, the longest has 20"
    ):
        source(tiny_data(), np.arange(12), length=21)
    with pytest.raises(DataError, match="the longest has 0"):
        source(tiny_data(), np.arange(0))


def test_sequences_that_are_too_short_are_left_out() -> None:
    data = tiny_data(sequences=3)
    shortened = replace(data, offsets=np.array([0, 20, 24, 60]))
    clips = source(shortened, np.arange(3)).draw(np.random.default_rng(0), 50)
    assert set(clips.labels.tolist()) == {0, 2}


def test_recorded_views_are_those_of_the_cameras_and_need_them() -> None:
    with pytest.raises(DataError, match="tiny: expected `views`, the cameras that recorded each sequence; it has none"):
        source(tiny_data(), np.arange(3), views="recorded")
    data = tiny_data(sequences=2)
    near = replace(data, positions=data.positions + np.array([0, 3, 0], dtype=np.float32), views=np.array([1, 2]))
    far = replace(near, positions=near.positions + np.array([0, 3, 0], dtype=np.float32))
    views = [
        source(moved, np.arange(2), views="recorded", form="causal")
        .draw(np.random.default_rng(0), 20)
        .features[..., -1]
        for moved in (near, far)
    ]
    np.testing.assert_allclose([view.exp().mean() for view in views], [3, 6], atol=0.1)
