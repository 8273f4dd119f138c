"""Frames of streams without activity: where they are most of all, they do not drown the others."""

from dataclasses import replace

import numpy as np

from recognition.training.frame_weights import frame_weights
from tests.helpers.streams import raising_streams


def test_frames_without_activity_do_not_drown_the_others() -> None:
    streams = raising_streams()  # three classes, and no activity in half of the frames
    weights = frame_weights(streams, np.arange(8))
    assert weights is not None
    np.testing.assert_allclose(weights, [1, 1, 1, 2 / 3])  # so that they count as much as two of three classes
    busy = replace(streams, segments=np.add(streams.segments, [0, 8, 0]))  # in all but a tenth
    assert frame_weights(busy, np.arange(8)) is None
