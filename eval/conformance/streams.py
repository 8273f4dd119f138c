"""Streams of a recogniser over the few episodes of a conformance kit, frame by frame."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.motion_data import MotionData
from ehar.errors import EpisodeError
from ehar.plugins.blame import blamed
from ehar.recogniser import Recogniser
from ehar.sensors.registry import make_sensor
from ehar.sensors.sensor import Sensed
from ehar.world import PAPER, World
from eval.conformance.checks import first_difference
from eval.conformance.world import small_batch
from recognition.training.views import training_viewpoints

TOLERANCE = 1e-4  # for log-probabilities and embeddings: batches of another size may differ by rounding


class GivenFrame(NamedTuple):
    """One frame of B episodes, or of F alternatives of each episode."""

    sensed: Sensed
    viewpoint: FloatArray  # (B, 3) or (B, F, 3)

    def rows(self, rows: IntArray) -> "GivenFrame":
        """Return copies of some of the episodes."""
        return GivenFrame(Sensed(*(array[rows] for array in self.sensed)), self.viewpoint[rows])


class Stream(NamedTuple):
    """The recognition of T frames."""

    log_probs: FloatArray  # (T, B, K)
    embedding: FloatArray  # (T, B, D)


def small_frames(data: MotionData, world: World = PAPER) -> list[GivenFrame]:
    """Return the frames of 14 episodes, seen by a perfect sensor from cameras that move at random."""
    batch = small_batch(data, world)
    episodes, length = batch.positions.shape[:2]
    viewpoints = training_viewpoints("moving", world, np.random.default_rng(0), episodes, length)
    sensor = make_sensor("perfect", data, world)
    return [
        GivenFrame(
            sensor.sense(batch.positions[:, frame], viewpoints[:, frame], batch.noise.frame(frame)),
            viewpoints[:, frame],
        )
        for frame in range(length)
    ]


def episodes_of(frames: Sequence[GivenFrame], rows: IntArray) -> list[GivenFrame]:
    """Return some of the episodes of several frames."""
    return [frame.rows(rows) for frame in frames]


def side_by_side(frames: Sequence[GivenFrame]) -> GivenFrame:
    """Return F frames (B, ...) as one frame with F alternatives (B, F, ...)."""
    sensed = Sensed(*(np.stack(arrays, axis=1) for arrays in zip(*(frame.sensed for frame in frames), strict=True)))
    return GivenFrame(sensed, np.stack([frame.viewpoint for frame in frames], axis=1))


class Streamer:
    """Steps a recogniser; an error names the line of the recogniser that raised it.

    Args:
        recogniser: the recogniser to check.
    """

    def __init__(self, recogniser: Recogniser) -> None:
        """Create it; nothing is stepped yet."""
        self.recogniser = recogniser
        self.classes = len(recogniser.class_names)
        self.changed: set[str] = set()  # names of the arrays that the recogniser changed

    def start(self, episodes: int) -> Any:
        """Return a new state."""
        with blamed(self.recogniser, "start"):
            return self.recogniser.start(episodes)

    def step(self, state: Any, frame: GivenFrame) -> tuple[Stream, Any]:
        """See one frame; the arrays are checked against the contract, and become float64."""
        leading = frame.viewpoint.shape[:-1]
        shown = GivenFrame(Sensed(*(array.copy() for array in frame.sensed)), frame.viewpoint.copy())
        with blamed(self.recogniser, "step"):
            recognition, after = self.recogniser.step(state, shown.sensed, shown.viewpoint)
        self._note_changes(shown, frame)
        expected = {"log_probs": (*leading, self.classes), "embedding": (*leading, self.recogniser.embedding_size)}
        arrays = []
        for name, shape in expected.items():
            array = np.asarray(getattr(recognition, name, None))
            if array.shape != shape or array.dtype.kind != "f" or not np.isfinite(array).all():
                values = "values" if np.isfinite(np.asarray(array, dtype=np.float64)).all() else "NaN or infinity"
                raise EpisodeError(f"{name}: {values} of {array.dtype} in shape {array.shape}, for shape {shape}")
            arrays.append(np.array(array, dtype=np.float64))
        return Stream(*arrays), after

    def stream(self, frames: Sequence[GivenFrame], state: Any = None) -> tuple[Stream, Any]:
        """See several frames, from a new state or a given one."""
        state = self.start(len(frames[0].viewpoint)) if state is None else state
        seen = []
        for frame in frames:
            recognised, state = self.step(state, frame)
            seen.append(recognised)
        return Stream(*(np.stack(arrays) for arrays in zip(*seen, strict=True))), state

    def _note_changes(self, shown: GivenFrame, frame: GivenFrame) -> None:
        pairs = zip(
            (*Sensed._fields, "viewpoint"),
            (*shown.sensed, shown.viewpoint),
            (*frame.sensed, frame.viewpoint),
            strict=True,
        )
        self.changed |= {name for name, one, other in pairs if not np.array_equal(one, other)}


def difference_of(one: Stream, other: Stream, names: tuple[str, str], tolerance: float = TOLERANCE) -> str | None:
    """Return in words where two streams first differ; None if they do not."""
    for what, a, b in zip(Stream._fields, one, other, strict=True):
        difference = first_difference(a, b, names, tolerance=tolerance, what=what)
        if difference is not None:
            return difference
    return None


def cut(stream: Stream, rows: Any, frames: Any = slice(None)) -> Stream:
    """Return some rows and frames of a stream."""
    return Stream(*(array[frames][:, rows] for array in stream))
