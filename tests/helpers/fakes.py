"""A tiny data set and a recogniser without a network, for tests of everything that is not recognition.

In class k joint k is raised above all others; the recogniser sees which joint is highest in the image, and
weighs that evidence by a quality of the viewpoint that each test chooses.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.batch import Batch
from ehar.data.motion_data import MotionData
from ehar.data.scenario import Scenarios, windows
from ehar.data.skeleton import Skeleton
from ehar.motion import GridMotion
from ehar.planner import Context
from ehar.recogniser import Recognition
from ehar.sensors.sensor import Sensed, draw_noise
from ehar.viewpoint import POLAR
from ehar.world import PAPER

SKELETON = Skeleton(
    ("head", "left_shoulder", "right_shoulder", "pelvis", "left_foot", "right_foot"),
    ((0, 3), (1, 2), (3, 4), (3, 5), (0, 1), (0, 2)),
)
POSE = np.array(
    [[0, 0, 0.7], [0, 0.2, 0.5], [0, -0.2, 0.5], [0, 0, 0], [0, 0.1, -0.9], [0, -0.1, -0.9]], dtype=np.float32
)
CLASS_NAMES = ("nod", "left", "right")


def tiny_data(*, sequences: int = 12, frames: int = 20, persons: int = 1, fps: float = 25.0) -> MotionData:
    """Return sequences whose label is the joint that is raised; the labels take turns."""
    rng = np.random.default_rng(0)
    labels = np.arange(sequences) % len(CLASS_NAMES)
    positions = np.tile(POSE, (sequences, frames, persons, 1, 1))
    positions[np.arange(sequences), :, :, labels, 2] = 1.5
    positions += 0.01 * rng.standard_normal(positions.shape, dtype=np.float32)
    positions[..., 1] += 0.8 * np.arange(persons, dtype=np.float32)[:, None]
    return MotionData(
        name="tiny",
        positions=positions.reshape(-1, persons, len(POSE), 3),
        offsets=np.arange(sequences + 1) * frames,
        labels=labels,
        class_names=CLASS_NAMES,
        sequence_names=tuple(f"sequence-{i}" for i in range(sequences)),
        fps=fps,
        skeleton=SKELETON,
        is_test=np.arange(sequences) >= sequences // 2,
        subjects=np.full((sequences, persons), -1),
        synthetic=True,
    )


def tiny_scenarios(*, length: int = 10, persons: int = 1) -> Scenarios:
    """Return all windows of the tiny data."""
    data = tiny_data(frames=max(20, length), persons=persons)
    return windows(data, np.arange(len(data.labels)), length, 1)


def tiny_batch(*, episodes: int = 6, length: int = 10, persons: int = 1, seed: int = 0) -> Batch:
    """Return episodes of the tiny data from random starts."""
    rng = np.random.default_rng(seed)
    scenarios = tiny_scenarios(length=length, persons=persons)
    indices = rng.integers(0, len(scenarios), size=episodes)
    return Batch(
        positions=scenarios.positions(indices),
        labels=scenarios.labels[indices],
        starts=PAPER.sample_starts(rng, episodes),
        noise=draw_noise(rng, (episodes, length), persons, len(POSE)),
        names=tuple(f"episode-{i}" for i in range(episodes)),
    )


def tiny_context(*, episodes: int = 6, length: int = 10, seed: int = 0) -> Context:
    """Return the context of `tiny_batch`."""
    return Context(
        episodes=episodes,
        length=length,
        frame_time=0.04,
        class_names=CLASS_NAMES,
        skeleton=SKELETON,
        workspace=GridMotion().workspace,
        track="ideal",
        rng=np.random.default_rng(seed),
    )


def level_quality(viewpoint: FloatArray) -> FloatArray:
    """Return more evidence the nearer to level the camera is."""
    quality: FloatArray = np.sin(viewpoint[..., POLAR])
    return quality


@dataclass(frozen=True)
class FakeState:
    """The evidence for each class, (B, K), or (B, F, K) when forked."""

    evidence: FloatArray

    def fork(self, forks: int) -> "FakeState":
        return FakeState(np.repeat(self.evidence[:, None], forks, axis=1))

    def select(self, choice: IntArray) -> "FakeState":
        return FakeState(self.evidence[np.arange(len(choice)), choice])

    def reset(self, mask: BoolArray) -> "FakeState":
        return FakeState(np.where(mask[:, None], 0.0, self.evidence))


class FakeRecogniser:
    """Adds up evidence: +quality(viewpoint) for the class whose joint is highest in the first person's image."""

    data_sha256: str | None = None
    sensor_sha256: str | None = None
    in_the_way = False
    class_names = CLASS_NAMES
    embedding_size = len(CLASS_NAMES)

    def __init__(self, *, quality: Callable[[FloatArray], FloatArray] = level_quality) -> None:
        self.quality = quality
        self.frames_recognised = 0

    def start(self, episodes: int) -> FakeState:
        return FakeState(np.zeros((episodes, len(CLASS_NAMES))))

    def step(self, state: Any, sensed: Sensed, viewpoint: FloatArray) -> tuple[Recognition, FakeState]:
        assert sensed.joints_2d.shape[:-3] == viewpoint.shape[:-1] == state.evidence.shape[:-1]
        height = np.where(sensed.confidence > 0, -sensed.joints_2d[..., 1], -np.inf)
        seen = np.argmax(height[..., 0, : len(CLASS_NAMES)], axis=-1)
        evidence = state.evidence + self.quality(viewpoint)[..., None] * np.eye(len(CLASS_NAMES))[seen]
        self.frames_recognised += seen.size
        log_probs = evidence - np.log(np.exp(evidence).sum(axis=-1, keepdims=True))
        return Recognition(log_probs.astype(np.float32), evidence.astype(np.float32)), FakeState(evidence)


def stopped(*_: object, **__: object) -> None:
    """Stand in for something during which the user presses Ctrl-C."""
    raise KeyboardInterrupt
