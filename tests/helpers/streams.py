"""Streams that are small enough to read: three of them, with activities, gaps and missing frames."""

import numpy as np

from ehar.data.stream_data import StreamData
from tests.helpers.fakes import CLASS_NAMES, POSE, SKELETON

LENGTHS = (40, 30, 50)
SEGMENTS = ((2, 10, 0), (10, 21, 1), (25, 40, 2), (40, 55, 1), (60, 70, 0), (75, 90, 2), (100, 120, 1), (70, 74, 0))


def tiny_streams() -> StreamData:
    """Return one training stream and two test streams of a person who hardly moves."""
    rng = np.random.default_rng(0)
    positions = np.tile(POSE, (sum(LENGTHS), 1, 1, 1)) + 0.01 * rng.standard_normal((sum(LENGTHS), 1, *POSE.shape))
    return StreamData(
        name="tiny",
        positions=positions.astype(np.float32),
        offsets=np.array([0, 40, 70, 120]),
        class_names=CLASS_NAMES,
        sequence_names=("morning", "noon", "evening"),
        fps=10.0,
        skeleton=SKELETON,
        is_test=np.array([False, True, True]),
        subjects=np.array([[0], [1], [1]]),
        segments=np.array(sorted(SEGMENTS)),
        missing=np.isin(np.arange(sum(LENGTHS)), [50, 51, 110]),
    )
