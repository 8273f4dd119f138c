"""The clips of an epoch: every training sequence five times, in whole batches, the same whoever draws them."""

from dataclasses import replace

import numpy as np

from ehar.data.motion_data import MotionData
from recognition.published.clips import FRAMES
from recognition.published.epochs import BATCH, REPEATS, Draw, draw_epoch
from tests.helpers.fakes import tiny_data


def data(training: int) -> MotionData:
    made = tiny_data(sequences=9)
    return replace(made, is_test=np.arange(9) >= training)


def test_an_epoch_has_each_training_sequence_five_times_in_whole_batches() -> None:
    few = draw_epoch(data(3), Draw("joint", 0, 0))
    assert few.clips.shape[:3] == (1, 3 * REPEATS, FRAMES) and few.clips.dtype == np.float32
    expected = np.repeat(data(3).labels[:3], REPEATS)
    assert sorted(few.labels.flat) == sorted(expected.tolist())
    more = draw_epoch(data(7), Draw("joint", 0, 0))
    assert more.labels.shape == (7 * REPEATS // BATCH, BATCH)


def test_seed_epoch_and_stream_decide_the_clips() -> None:
    first = draw_epoch(data(3), Draw("joint", 0, 0))
    for other in (Draw("joint", 0, 1), Draw("joint", 1, 0), Draw("bone", 0, 0)):
        assert not np.array_equal(draw_epoch(data(3), other).clips, first.clips)
    np.testing.assert_array_equal(draw_epoch(data(3), Draw("joint", 0, 0)).clips, first.clips)
