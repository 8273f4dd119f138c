"""A planner that tries to move the camera by hand gains nothing by it, or is stopped with its name."""

import ctypes
import gc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.batch import Batch
from ehar.camera import Camera
from ehar.conditions import Conditions
from ehar.data.motion_file import save_motion
from ehar.data.skeleton import Skeleton
from ehar.errors import EpisodeError
from ehar.flight.motion import FlightMotion
from ehar.motion import GridMotion
from ehar.planner import Context, Observation, Planner
from ehar.sensors.estimator import EstimatorSensor
from ehar.sensors.perfect import PerfectSensor
from ehar.world import PAPER
from eval import benchmark
from eval.records.episodes import COLUMNS, SECOND, EpisodeRecords
from eval.running.run import Run
from eval.verification.checks import FAILED
from eval.verification.verify import verify
from tests.helpers.fakes import tiny_data
from tests.helpers.tiny_benchmarks import HashedRecogniser, Log
from tests.helpers.tiny_benchmarks import run as run_tiny

pytestmark = pytest.mark.usefixtures("fake_weights")
ARRAYS = ("viewpoint", "joints_2d", "confidence", "log_probs", "embedding", "velocity", "acceleration")


def run(planners: list[Any], **options: Any) -> Run:
    return run_tiny(planners, data=tiny_data(), starts=2, **options)


class Honest(Planner):
    """Goes round the people, and tries nothing."""

    name = "mine"

    def reset(self, context: Context) -> None:
        self.context = context
        self.begun(context)

    def act(self, observation: Observation) -> FloatArray:
        self.tries(observation)
        return observation.viewpoint + np.array([0.0, 0.1, 0.0])

    def begun(self, context: Context) -> None:
        """Do nothing."""

    def tries(self, observation: Observation) -> None:
        """Do nothing."""


class Writes(Honest):
    """Writes into one of the arrays that it is shown."""

    def __init__(self, array: str) -> None:
        self.array = array

    def tries(self, observation: Observation) -> None:
        getattr(observation, self.array)[:] = 0.0


class MakesWriteable(Honest):
    def tries(self, observation: Observation) -> None:
        observation.viewpoint.flags.writeable = True


class WritesIntoTheSkeleton(Honest):
    def begun(self, context: Context) -> None:
        context.skeleton.mirror[:] = 0


class WritesIntoTheSteps(Honest):
    def begun(self, context: Context) -> None:
        context.world.workspace.step[:] = 2.0


class MovesTheMotion(Honest):
    def tries(self, observation: Observation) -> None:
        for motion in alive(GridMotion):
            motion._viewpoint[:, 0] = 5.0
        for flight in alive(FlightMotion):
            flight._state.viewpoint[:, 0] += 1.0


class HurriesTheVehicle(Honest):
    def begun(self, context: Context) -> None:
        for flight in alive(FlightMotion):
            flight.advance = flight.workspace.clip

    def act(self, observation: Observation) -> FloatArray:
        return np.full_like(observation.viewpoint, 1.0)


class ChangesTheBatch(Honest):
    def __init__(self, part: str) -> None:
        self.part = part

    def tries(self, observation: Observation) -> None:
        for batch in alive(Batch):
            array = getattr(batch, self.part) if hasattr(batch, self.part) else getattr(batch.noise, self.part)
            if array.flags.writeable:
                array[:] = 0


class RaisesItsRank(Honest):
    def begun(self, context: Context) -> None:
        self.privileged = True


class PatchesTheMoves(Honest):
    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.patch = patch

    def begun(self, context: Context) -> None:
        self.patch.setattr("ehar.motion.apply_moves", lambda viewpoint, moves, workspace: viewpoint * [0.9, 1.0, 1.0])


def alive(kind: type[Any]) -> Iterator[Any]:
    """Yield the objects of a class that Python knows of."""
    return (found for found in gc.get_objects() if type(found) is kind)


STOPPED: list[tuple[Honest, dict[str, Any], str]] = [
    *((Writes(array), {}, "ValueError: assignment destination is read-only (") for array in ARRAYS),
    (MakesWriteable(), {}, "ValueError: cannot set WRITEABLE flag to True of this array ("),
    (WritesIntoTheSkeleton(), {}, "reset: ValueError: assignment destination is read-only ("),
    (WritesIntoTheSteps(), {}, "reset: ValueError: assignment destination is read-only ("),
    (MovesTheMotion(), {}, "expected a move of the grid within 5 to 15 m,"),
    (MovesTheMotion(), {"track": "px4-max"}, "expected at most 12 of 'px4-max'"),
    (HurriesTheVehicle(), {"track": "px4-max"}, "expected at most 12 of 'px4-max'"),
    (ChangesTheBatch("positions"), {}, "positions of the episodes changed during the rollout, expected no change"),
    (ChangesTheBatch("swap"), {}, "swap of the episodes changed during the rollout, expected no change"),
    (RaisesItsRank(), {}, "privileged was False at first, expected no change, got True"),
]


@pytest.mark.parametrize(("cheat", "options", "said"), STOPPED)
def test_it_is_stopped_with_its_name(cheat: Honest, options: dict[str, Any], said: str) -> None:
    with pytest.raises(EpisodeError) as error:
        run([cheat, "no-act"], **options)
    assert str(error.value).startswith("planner 'mine'")
    assert said in str(error.value)


def test_other_moves_than_the_grid_s_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(EpisodeError, match=r"planner 'mine', episode .*, frame 1: the camera got from .* of the grid"):
        run([PatchesTheMoves(monkeypatch), "no-act"])


class Weighted(HashedRecogniser):
    """A recogniser with weights, and a hash of them."""

    def __init__(self) -> None:
        self.weights = np.ones(1)
        super().__init__(quality=lambda viewpoint: np.full(viewpoint.shape[:-1], self.weights[0]))

    def fingerprint(self) -> bytes:
        return self.weights.tobytes()


class ImprovesTheRecogniser(Honest):
    def tries(self, observation: Observation) -> None:
        for recogniser in alive(Weighted):
            recogniser.weights[:] = 9.0


def test_other_weights_of_the_recogniser_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("recognition.storage.load_recogniser", lambda *_, **__: Weighted())
    run([Honest(), "no-act"])
    with pytest.raises(EpisodeError, match=r"planner 'mine': recogniser Weighted changed during the rollout"):
        run([ImprovesTheRecogniser(), "no-act"])


class SilencesTheSensor(Honest):
    def __init__(self, patch: pytest.MonkeyPatch, part: str, value: Any) -> None:
        self.patch, self.part, self.value = patch, part, value

    def begun(self, context: Context) -> None:
        for sensor in alive(EstimatorSensor):
            self.patch.setattr(sensor, self.part, self.value)


@pytest.mark.parametrize(
    ("part", "value"),
    [
        ("relative_noise", 0.0),
        ("camera", Camera(focal_length=1000.0)),
        ("skeleton", Skeleton(("one",), ())),
        ("sense", PerfectSensor().sense),
    ],
)
def test_another_sensor_is_noticed(part: str, value: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(EpisodeError, match="planner 'mine': sensor EstimatorSensor changed during the rollout"):
        run([SilencesTheSensor(monkeypatch, part, value), "no-act"], sensor="estimator")


class MovesTheWorld(Honest):
    """Writes into the very world that everybody shares, and keeps what was there."""

    def __init__(self, held: Any, name: str, value: float) -> None:
        self.held, self.name_of, self.value, self.before = held, name, value, getattr(held, name)

    def begun(self, context: Context) -> None:
        object.__setattr__(self.held, self.name_of, self.value)


@pytest.mark.parametrize(
    ("held", "name", "value"), [(PAPER.camera, "focal_length", 1000.0), (PAPER.workspace, "distance_min", 4.0)]
)
def test_another_world_is_noticed(held: Any, name: str, value: float) -> None:
    cheat = MovesTheWorld(held, name, value)
    try:
        with pytest.raises(EpisodeError, match=r"planner 'mine'.*changed during the rollout, expected no change"):
            run([cheat, "no-act"], sensor="estimator")
    finally:
        object.__setattr__(held, name, cheat.before)
        for cached in {"origin", "step", "cells"} & vars(held).keys():
            del vars(held)[cached]


def quietly(trick: Callable[[], Any]) -> None:
    """Try something, and say nothing if it fails."""
    try:
        trick()
    except (ValueError, TypeError, AttributeError, BufferError):
        return


class FollowsTheBase(Honest):
    def tries(self, observation: Observation) -> None:
        for name in ARRAYS:
            array = getattr(observation, name)
            while array is not None:
                quietly(lambda array=array: array.__setitem__(slice(None), 0))
                quietly(lambda array=array: array.setflags(write=True))
                quietly(lambda array=array: memoryview(array).cast("B").__setitem__(0, 1))
                array = getattr(array, "base", None)


class WritesIntoMemory(Honest):
    """Writes by ctypes, past all that Python forbids; it reaches its own copies only."""

    def act(self, observation: Observation) -> FloatArray:
        target = super().act(observation)
        for name in ARRAYS:
            array = getattr(observation, name)
            ctypes.memset(array.ctypes.data, 0, array.nbytes)
        return target


class KeepsWhatItWasShown(Honest):
    def begun(self, context: Context) -> None:
        self.kept: list[Observation] = []

    def tries(self, observation: Observation) -> None:
        for shown in self.kept:
            object.__setattr__(shown, "viewpoint", np.full(observation.viewpoint.shape, 5.0))
            object.__setattr__(shown, "frame", 0)
            quietly(lambda shown=shown: shown.joints_2d.__setitem__(slice(None), 0))
        self.kept.append(observation)


class ChangesItsTarget(Honest):
    """Keeps the target that it returned, and writes into it in the next frame."""

    def begun(self, context: Context) -> None:
        self.target = np.zeros((context.episodes, 3))

    def act(self, observation: Observation) -> FloatArray:
        self.target[:] = 5.0
        self.target[:] = observation.viewpoint + np.array([0.0, 0.1, 0.0])
        return self.target


class DrawsAndDraws(Honest):
    def tries(self, observation: Observation) -> None:
        self.context.rng.random(1000)
        self.context.rng.bit_generator.state = np.random.PCG64(0).state


class ChangesItsContext(Honest):
    def begun(self, context: Context) -> None:
        for held, name, value in (
            (context.workspace, "distance_min", 0.1),
            (context.workspace, "polar_max", 3.0),
            (context.world.workspace, "distance_min", 0.1),
            (context.world.camera, "focal_length", 1000.0),
            (context.vehicle, "speed", 900.0),
            (context.vehicle, "yaw_rate", 900.0),
            (context, "length", 2),
            (context, "class_names", ("one",)),
            (context, "frame_time", 9.0),
        ):
            if held is not None:
                object.__setattr__(held, name, value)


NOTHING_GAINED = [
    (FollowsTheBase(), "ideal"),
    (WritesIntoMemory(), "ideal"),
    (KeepsWhatItWasShown(), "ideal"),
    (ChangesItsTarget(), "ideal"),
    (ChangesItsTarget(), "px4-max"),
    (DrawsAndDraws(), "ideal"),
    (ChangesItsContext(), "ideal"),
    (ChangesItsContext(), "px4-max"),
]


def same(one: EpisodeRecords, other: EpisodeRecords) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in (*COLUMNS, SECOND))


@pytest.mark.parametrize(("cheat", "track"), NOTHING_GAINED)
def test_it_gains_nothing_and_others_meet_the_same(cheat: Honest, track: str) -> None:
    rivals = ["random", "oracle"] if track == "ideal" else ["random"]
    honest, tried = (run([one, *rivals], track=track, sensor="estimator") for one in (Honest(), cheat))
    assert list(honest.records) == ["mine", *rivals]
    for name, records in honest.records.items():
        assert same(records, tried.records[name]), name


class Dreams(Honest):
    """Is handed the truth, and writes into it."""

    privileged = True

    def __init__(self, part: str) -> None:
        self.part = part

    def tries(self, observation: Observation) -> None:
        truth = observation.truth
        assert truth is not None
        sensed = truth.sense(observation.frame + 1, observation.viewpoint[:, None])
        {"labels": truth.labels, "joints": sensed.joints_2d, "confidence": sensed.confidence}[self.part][:] = 0


@pytest.mark.parametrize("part", ["labels", "joints", "confidence"])
def test_the_truth_is_read_only_too(part: str) -> None:
    with pytest.raises(EpisodeError, match=r"planner 'mine', frame 0: ValueError: assignment destination is read-only"):
        run([Dreams(part)])


DREAMER = """
import gc
import numpy as np
from ehar import Planner
from tests.helpers.fakes import FakeState

class Dreamer(Planner):
    name = "dreamer"
    def reset(self, context): pass
    def act(self, observation):
        for state in gc.get_objects():
            if type(state) is FakeState:
                state.evidence[:, 0] += 1
        return observation.viewpoint + np.array([0.0, 0.1, 0.0])
"""


@pytest.mark.usefixtures("own_modules")
def test_what_was_written_into_the_recogniser_s_state_is_not_seen_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own_dreamer.py").write_text(DREAMER)
    save_motion(tmp_path / "tiny.npz", tiny_data())
    monkeypatch.chdir(tmp_path)
    conditions = Conditions(data="tiny.npz", length=10)
    benchmark(["no-act", "./own_dreamer.py:Dreamer"], conditions, out="run", reporter=Log())
    assert verify("run", reporter=Log()).difference is None
    found = verify("run", rerun_episodes=12, reporter=Log())
    assert [check.name for check in found.checks if check.result == FAILED] == ["seen again"]
    assert "dreamer, episode " in str(found.difference)
