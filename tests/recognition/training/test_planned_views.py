"""Views that planners chose: windows of their episodes, half of a batch, seen from where they were."""

import numpy as np
import torch

from ehar.sensors.perfect import PerfectSensor
from recognition.training.clips import ClipSource
from recognition.training.planned_views import PlannedViews
from tests.helpers.fakes import tiny_data
from tests.helpers.streams import tiny_streams

FRAMES, LENGTH = 14, 10


def some_views(episodes: int = 3) -> PlannedViews:
    """Return views whose distance tells the episode and the frame: 6 m in the first frame of the first one."""
    distance = 6 + np.arange(episodes)[:, None] + np.arange(FRAMES) / 100
    angle = np.full_like(distance, 1.0)
    return PlannedViews(np.arange(episodes) + 2, np.arange(episodes), np.stack([distance, angle, angle], axis=-1))


def test_windows_lie_inside_episodes_and_all_are_drawn() -> None:
    drawn = some_views().draw(np.random.default_rng(0), 400, LENGTH)
    begin = drawn.first - (drawn.sequence - 2)
    assert set(begin) == set(range(FRAMES - LENGTH + 1)) and set(drawn.sequence) == {2, 3, 4}
    expected = 6 + (drawn.sequence - 2)[:, None] + (begin[:, None] + np.arange(LENGTH)) / 100
    np.testing.assert_allclose(drawn.viewpoints[..., 0], expected)


def test_whole_episodes_are_drawn_where_they_are_no_longer() -> None:
    drawn = some_views().draw(np.random.default_rng(0), 5, FRAMES)
    np.testing.assert_array_equal(drawn.viewpoints, some_views().viewpoints[drawn.sequence - 2])


def test_half_of_a_batch_is_seen_from_there() -> None:
    for data in (tiny_data(sequences=8, frames=30), tiny_streams()):
        own = {"data": data, "sequences": np.arange(len(data.lengths)), "length": LENGTH, "views": "paper"}
        views = some_views()
        if data.lengths.shape[0] < 5:
            views = PlannedViews(np.zeros(3, dtype=np.int64), views.first, views.viewpoints)
        source = ClipSource(sensor=PerfectSensor(), form="causal", augment=False, planned=views, **own)  # type: ignore[arg-type]
        clips = source.draw(np.random.default_rng(1), 9)
        far = clips.features[..., -1].exp()[:, :, 0, 0]  # [m], as the network is told
        usual, planned = far[:5], far[5:]
        assert torch.allclose(planned[:, 1:] - planned[:, :-1], torch.tensor(0.01), atol=1e-4)
        assert set(planned.round().flatten().tolist()) <= {6.0, 7.0, 8.0}
        assert (usual[:, 1:] == usual[:, :-1]).all()  # the paper's cameras stay
        assert len(clips.labels) == len(clips.sequences) == 9
        assert np.isin(clips.sequences[5:], views.sequence).all()


def test_hashes_tell_views_apart() -> None:
    views = some_views()
    moved = PlannedViews(views.sequence, views.first, views.viewpoints + 1e-9)
    assert views.sha256 == some_views().sha256 != moved.sha256
