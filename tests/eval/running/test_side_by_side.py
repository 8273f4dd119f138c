"""Chunks in lockstep, as on a GPU: each keeps its noise and its planner's random numbers."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.errors import EharError, EpisodeError, UsageError
from ehar.planner import Context, Observation, Planner
from eval.records.config import read_config
from eval.records.episodes import EpisodeRecords
from eval.running.episodes import CHUNK, CHUNKS_ON_DEVICE
from eval.running.jobs import Workload
from eval.running.run import Run
from tests.helpers.tiny_benchmarks import HashedRecogniser, run

pytestmark = pytest.mark.usefixtures("fake_weights")


class Wanders(Planner):
    """Draws a new way in each frame, and remembers how many episodes it has."""

    name = "wanders"

    def reset(self, context: Context) -> None:
        self.rng, self.episodes = context.rng, context.episodes

    def act(self, observation: Observation) -> FloatArray:
        assert len(observation.viewpoint) == self.episodes <= CHUNK
        return observation.viewpoint + self.rng.normal(size=observation.viewpoint.shape) * [1.0, 0.2, 0.2]


class OneTooFew(Wanders):
    """Returns the targets of all episodes but one."""

    name = "one-too-few"

    def act(self, observation: Observation) -> FloatArray:
        return observation.viewpoint[1:]


@pytest.fixture
def in_lockstep(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every workload run three chunks at once, on the CPU."""

    class Together(Workload):
        def __init__(self, runner: Any, episodes: Any, belief: Any = None, together: int = 1) -> None:
            super().__init__(runner, episodes, belief, 3)

    monkeypatch.setattr("eval.running.benchmark.Workload", Together)


def assert_same(one: Run, other: Run) -> None:
    for name, held in one.records.items():
        again: EpisodeRecords = other.records[name]
        assert len(held) == 160 > 4 * CHUNK  # five chunks: three in lockstep, and two
        for key in ("sequence", "first", "label", "start", "viewpoint", "predicted"):
            np.testing.assert_array_equal(getattr(held, key), getattr(again, key), err_msg=f"{name}: {key}")
        np.testing.assert_allclose(held.true_probability, again.true_probability, atol=1e-6)


@pytest.mark.parametrize("sensor", ["perfect", "estimator"])
def test_chunks_in_lockstep_are_what_each_is_alone(sensor: str, request: pytest.FixtureRequest) -> None:
    planners = ["no-act", "random", "oracle", Wanders()]
    alone = run(planners, sensor=sensor)
    request.getfixturevalue("in_lockstep")
    assert_same(alone, run(planners, sensor=sensor))


@pytest.mark.usefixtures("in_lockstep")
def test_a_planner_that_forgets_an_episode_is_told_so() -> None:
    with pytest.raises(EpisodeError, match=r"'one-too-few', frame 0: .* \(32, 3\), got \(31, 3\)"):
        run([OneTooFew()])


def test_a_gpu_takes_at_least_512_episodes_at_once() -> None:
    assert CHUNK * CHUNKS_ON_DEVICE >= 512


def test_a_run_says_on_which_device_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run(["no-act"], out=tmp_path / "cpu")
    assert read_config(tmp_path / "cpu").device == "cpu"
    together: list[int] = []

    class Told(Workload):
        def __init__(self, *told: Any) -> None:
            together.append(told[3])
            super().__init__(*told)

    # A second device that there is here: the same fake recogniser, under the name of a GPU.
    monkeypatch.setattr("recognition.setting.check_device", lambda device: None)
    monkeypatch.setattr("eval.running.benchmark.Workload", Told)
    made: list[str] = []
    monkeypatch.setattr(
        "recognition.storage.load_recogniser", lambda *_, device: made.append(device) or HashedRecogniser()
    )
    run(["no-act"], out=tmp_path / "gpu", device="cuda")
    assert read_config(tmp_path / "gpu").device == "cuda"
    assert (made, together) == (["cuda"], [CHUNKS_ON_DEVICE])


def test_a_run_on_another_device_is_another_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run(["no-act"], out=tmp_path)
    monkeypatch.setattr("recognition.setting.check_device", lambda device: None)
    with pytest.raises(UsageError, match="differs in device"):
        run(["no-act"], out=tmp_path, device="cuda")


def test_a_device_that_is_missing_is_one_line() -> None:
    with pytest.raises(EharError, match=r"^--device tpu: expected cpu or cuda$"):
        run(["no-act"], device="tpu")


def test_your_own_recogniser_chooses_its_device_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("recognition.setting.check_device", lambda device: None)
    with pytest.raises(UsageError, match="beside your own recogniser"):
        run(["no-act"], recogniser=HashedRecogniser(), device="cuda")
