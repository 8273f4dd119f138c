"""Streams that are small enough to read: three of them, with activities, gaps and missing frames."""

from typing import Any

import numpy as np
from scipy.special import log_softmax

from ehar.arrays import FloatArray
from ehar.data.streams.data import NO_ACTIVITY_NAME, StreamData
from ehar.recogniser import Recognition
from ehar.sensors.sensor import Sensed
from tests.helpers.fakes import CLASS_NAMES, POSE, SKELETON, FakeRecogniser, FakeState

LENGTHS = (40, 30, 50)
SEGMENTS = ((2, 10, 0), (10, 21, 1), (25, 40, 2), (40, 55, 1), (60, 70, 0), (75, 90, 2), (100, 120, 1), (70, 74, 0))


def raising_streams(*, people: int = 8, seconds: int = 12, fps: float = 10.0) -> StreamData:
    """Return a stream of each person, in which one of three joints is raised, and then none, a second each."""
    rng = np.random.default_rng(0)
    second, frames = int(fps), int(seconds * fps)
    positions = np.tile(POSE, (people, frames, 1, 1, 1))
    segments = []
    for person in range(people):
        for index in range(0, seconds, 2):
            begin, label = index * second, int(rng.integers(len(CLASS_NAMES)))
            positions[person, begin : begin + second, 0, label, 2] = 1.5
            segments.append((person * frames + begin, person * frames + begin + second, label))
    positions += 0.01 * rng.standard_normal(positions.shape)
    return StreamData(
        name="raising",
        positions=positions.reshape(-1, 1, *POSE.shape).astype(np.float32),
        offsets=np.arange(people + 1) * frames,
        class_names=CLASS_NAMES,
        sequence_names=tuple(f"stream-{person}" for person in range(people)),
        fps=fps,
        skeleton=SKELETON,
        is_test=np.arange(people) >= people - 2,
        subjects=np.arange(people)[:, None],
        segments=np.array(segments),
        missing=np.zeros(people * frames, dtype=bool),
        synthetic=True,
    )


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


class StreamRecogniser(FakeRecogniser):
    """A recogniser without a network that also knows no activity, and always finds it a little likely."""

    class_names = (*CLASS_NAMES, NO_ACTIVITY_NAME)

    def step(self, state: Any, sensed: Sensed, viewpoint: FloatArray) -> tuple[Recognition, FakeState]:
        seen, after = super().step(state, sensed, viewpoint)
        with_none = np.concatenate([seen.log_probs, np.full((*seen.log_probs.shape[:-1], 1), -1.0)], axis=-1)
        return Recognition(log_softmax(with_none, axis=-1).astype(np.float32), seen.embedding), after
