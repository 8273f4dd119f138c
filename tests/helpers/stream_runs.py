"""Runs of streams with a recogniser that has learned nothing: it sees which joint is raised, and forgets."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.data.streams.data import NO_ACTIVITY_NAME, StreamData
from ehar.data.streams.file import save_streams
from ehar.planner import Planner
from ehar.recogniser import Recognition
from ehar.sensors.sensor import Sensed
from tests.helpers.fakes import CLASS_NAMES, FakeState
from tests.helpers.streams import raising_streams
from tests.helpers.tiny_benchmarks import HashedRecogniser
from tests.helpers.tiny_benchmarks import run as run_tiny

FRAMES = 50  # of an episode, 5 s; two episodes of each of the two test streams
KEPT = 0.7  # of the evidence, from one frame to the next


class ForgetfulRecogniser(HashedRecogniser):
    """Evidence for the class whose joint is raised fades; without any, no activity is the answer."""

    class_names = (*CLASS_NAMES, NO_ACTIVITY_NAME)
    embedding_size = len(class_names)

    def start(self, episodes: int) -> FakeState:
        return FakeState(np.zeros((episodes, len(self.class_names))))

    def step(self, state: Any, sensed: Sensed, viewpoint: FloatArray) -> tuple[Recognition, FakeState]:
        height = -sensed.joints_2d[..., 0, :, 1]  # of the first person's joints in the image
        size = np.ptp(height, axis=-1, keepdims=True)
        seen = size > 0  # not where the tracker lost people
        above = np.where(seen, (height - height[..., 3:4]) / np.where(seen, size, 1), 0)  # the pelvis
        evidence = np.zeros((*viewpoint.shape[:-1], len(self.class_names)))
        evidence[..., :-1] = 4 * above[..., : len(CLASS_NAMES)]
        evidence[..., -1] = 2.1
        evidence = KEPT * state.evidence + (1 - KEPT) * evidence * self.quality(viewpoint)[..., None]
        log_probs = evidence - np.log(np.exp(evidence).sum(axis=-1, keepdims=True))
        return Recognition(log_probs.astype(np.float32), evidence.astype(np.float32)), FakeState(evidence)


def forgetful(patch: pytest.MonkeyPatch) -> None:
    """Let every run load the recogniser."""
    patch.setattr("recognition.storage.load_recogniser", lambda *_, **__: ForgetfulRecogniser())


def stream_run(
    folder: Path, planners: tuple[str | Planner, ...], *, streams: StreamData | None = None, **options: Any
) -> Path:
    """Write raising.npz, or other streams, let planners watch its test streams, and return the run's folder."""
    save_streams(folder / "raising.npz", raising_streams() if streams is None else streams)
    out = folder / "run"
    run_tiny(planners, **{"data": folder / "raising.npz", "length": FRAMES, "starts": 1, "out": out, **options})
    return out
