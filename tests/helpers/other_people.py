"""Data of which one part shows other people."""

from dataclasses import replace

import numpy as np

from ehar.data.motion_data import MotionData
from ehar.data.scenario import split_parts
from ehar.data.streams.data import StreamData
from tests.helpers.fakes import CLASS_NAMES


def with_others(data: MotionData | StreamData, part: str) -> MotionData | StreamData:
    """Return data with other motion and other labels in a part; other ones in the test part move no sequence."""
    sequences = getattr(split_parts(data), part)
    positions = data.positions.copy()
    of_sequence = np.repeat(np.arange(len(data.lengths)), data.lengths)
    there = np.isin(of_sequence, sequences)
    positions[there] += np.random.default_rng(7).normal(0, 0.2, positions[there].shape).astype(np.float32)
    if isinstance(data, StreamData):
        segments, theirs = data.segments.copy(), np.isin(data.stream_of, sequences)
        segments[theirs, 2] = (segments[theirs, 2] + 1) % len(CLASS_NAMES)
        return replace(data, positions=positions, segments=segments)
    labels = data.labels.copy()
    labels[sequences] = (labels[sequences] + 1) % len(CLASS_NAMES)
    return replace(data, positions=positions, labels=labels)
