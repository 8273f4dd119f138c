"""What anybody is shown in a frame depends on the frames so far: another future changes nothing before it begins.

Two data sets are equal up to a frame of each window, and differ after it; so does the noise. Windows are cut from both,
so the origin of the world is covered too.
"""

import hashlib
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.batch import Batch, noise_of
from ehar.conditions import Conditions
from ehar.data.motion_data import MotionData
from ehar.data.scenario import Scenarios, part_of, windows
from ehar.data.source import load_data
from ehar.data.streams.data import StreamData
from ehar.data.streams.scenario import StreamScenarios
from ehar.errors import ModelError
from ehar.flight.vehicle import VEHICLES
from ehar.planner import Context, Observation, Planner
from ehar.rollout import Record
from ehar.runner import Runner
from ehar.sensors.registry import SENSORS, make_sensor
from ehar.sensors.sensor import SensorNoise
from ehar.track import IDEAL, load_track
from ehar.world import CROWD, PAPER, ROOM
from eval.running.choice import ModelPlace, choose_planners
from eval.running.recorder import Recorder, array_names
from planners.registry import LEARNED, planner_names
from planners.value.belief.clips import BeliefModel, readout
from recognition.calibration import Temperature
from recognition.networks.causal import CausalCTRGCN
from recognition.networks.spec import NetworkSpec
from recognition.setting import load_setting
from recognition.streaming import StreamingRecogniser
from tests.helpers.places import SHARED
from tests.helpers.random_networks import randomised
from tests.helpers.streams import StreamRecogniser, raising_streams

LENGTH, LAST = 12, 5  # frames of an episode, and the last one that both futures share
EPISODES = 3
SHARED_SETS = tuple(
    pytest.param(name, marks=pytest.mark.skipif(not (SHARED / f"{name}.npz").is_file(), reason="needs shared data"))
    for name in ("hdm05", "bandai2", "sbu")
)


class Everything(Planner):
    """Goes where a hash of all that it is shown leads it: any other digit leads it elsewhere."""

    name = "everything"

    def reset(self, context: Context) -> None:
        """Do nothing."""

    def act(self, observation: Observation) -> FloatArray:
        shown = b"".join(getattr(observation, name).tobytes() for name in array_names(observation))
        rng = np.random.default_rng(int.from_bytes(hashlib.sha256(shown).digest(), "little"))
        return observation.viewpoint + rng.normal(size=observation.viewpoint.shape)


class World(NamedTuple):
    """Some data, and the same with another future in each of the windows."""

    data: MotionData
    windows: Scenarios
    other: Scenarios

    def batches(self) -> tuple[Batch, Batch]:
        """Return episodes of both; starts are equal, and noise up to the last frame that they share."""
        starts = PAPER.sample_starts(np.random.default_rng(1), EPISODES)
        noise, later = (noise_of(self.windows, EPISODES, np.random.default_rng(seed)) for seed in (2, 3))
        changed = (np.where(_after(one), b, one) for one, b in zip(noise, later, strict=True))
        every = np.arange(EPISODES)
        return (
            Batch.of(self.windows, every, starts, noise),
            Batch.of(self.other, every, starts, SensorNoise(*changed)),
        )


def _after(draws: FloatArray) -> FloatArray:
    """Return which frames of draws (B, L, ...) lie after the last frame in common, in a shape that broadcasts."""
    return (np.arange(LENGTH) > LAST).reshape(1, -1, *[1] * (draws.ndim - 2))


@cache
def world_of(name: str) -> World:
    data = load_data(SHARED / f"{name}.npz" if (SHARED / f"{name}.npz").is_file() else name)
    every = windows(data, np.arange(len(data.labels)), LENGTH, LENGTH)
    _, firsts = np.unique(every.sequence, return_index=True)  # one window a sequence: the rest of it may change
    chosen = firsts[np.linspace(0, len(firsts) - 1, EPISODES).astype(int)]
    cut = Scenarios(data, LENGTH, every.sequence[chosen], every.first[chosen])
    positions = data.positions.copy()
    for sequence, first in zip(cut.sequence, cut.first, strict=True):
        begin, end = data.offsets[sequence] + first + LAST + 1, data.offsets[sequence + 1]
        positions[begin:end] = 1 - positions[begin:end][..., [1, 0, 2]]  # they stand on their heads, elsewhere
    other = replace(data, positions=positions.astype(np.float32))
    return World(data, cut, Scenarios(other, LENGTH, cut.sequence, cut.first))


@cache
def untrained(name: str) -> StreamingRecogniser:
    spec = NetworkSpec.of(world_of(name).data, form="causal", size="small", length=LENGTH)
    network = randomised(spec.build())
    assert isinstance(network, CausalCTRGCN)
    return StreamingRecogniser(network=network, spec=spec, temperature=Temperature(), sha256="0")


def runner_of(name: str, sensor: str, track: str) -> Runner:
    data = world_of(name).data
    return Runner(data, untrained(name), make_sensor(sensor, data), load_track(track))


def rolled(planner: Planner, runner: Runner, batch: Batch) -> tuple[Recorder, Record]:
    recorder = Recorder(planner)
    return recorder, runner.roll(recorder, batch, np.random.default_rng(4))


def assert_causal(planner: Planner, runner: Runner, world: World, belief: BeliefModel | None = None) -> None:
    """Assert that another future changes nothing before it begins, and that it changes something then."""
    (one, first), (other, second) = (rolled(planner, runner, batch) for batch in world.batches())
    for frame in range(LAST + 1):
        here, there = one.observations[frame], other.observations[frame]
        for name in array_names(here):
            np.testing.assert_array_equal(getattr(here, name), getattr(there, name), f"{name} in frame {frame}")
        np.testing.assert_array_equal(one.targets[frame], other.targets[frame], f"targets in frame {frame}")
    past = LAST + 1
    np.testing.assert_array_equal(first.log_probs[:, :past], second.log_probs[:, :past])
    np.testing.assert_array_equal(first.viewpoints[:, : past + 1], second.viewpoints[:, : past + 1])
    believed = [readout(belief or BeliefModel(), record.log_probs, record.viewpoints) for record in (first, second)]
    np.testing.assert_array_equal(believed[0][:, :past], believed[1][:, :past])
    assert (one.observations[past].joints_2d != other.observations[past].joints_2d).any(), "the futures differ"
    assert (first.log_probs[:, past:] != second.log_probs[:, past:]).any()


@pytest.mark.parametrize("name", ["duo", "solo", *SHARED_SETS])
def test_nobody_is_shown_the_future(name: str) -> None:
    for sensor in SENSORS:
        for track in (IDEAL, *VEHICLES):
            assert_causal(Everything(), runner_of(name, sensor, track), world_of(name))


PLANNERS = [name for name in planner_names() if not name.startswith("oracle") and name not in LEARNED[1:]]
RULES = {"no-act", "random", "towards", "h-rotate", "v-rotate", "near-level", "front", "side", "fixed-best"}
PLANNING = {"nbv-greedy", "nbv-search", "nbv"}


@pytest.mark.parametrize(("data", "sensor", "track"), [("duo", "estimator", "px4-auto"), ("solo", "perfect", IDEAL)])
def test_no_planner_acts_on_the_future(data: str, sensor: str, track: str) -> None:
    setting = load_setting(Conditions(data=data, sensor=sensor, track=track))
    place, world, acted = ModelPlace.of(setting), world_of(data), set()
    for name in PLANNERS:
        try:
            planner = choose_planners([name], place, readout="recogniser", note=lambda _: None).planners[0]
        except ModelError:
            continue  # what does not ship cannot act
        assert_causal(planner, setting.runner, world, place.load_gain_model().belief)
        acted.add(name)
    assert acted >= RULES | PLANNING


@pytest.mark.parametrize("track", [IDEAL, "px4-auto"])
def test_in_a_stream_nobody_is_told_where_the_centre_will_be(track: str) -> None:
    data = raising_streams(people=EPISODES, seconds=3)
    positions = data.positions.reshape(EPISODES, 30, *data.positions.shape[1:]).copy()
    positions[..., 0] += np.linspace(0, 2, 30, dtype=np.float32)[:, None, None]
    later = positions.copy()
    later[:, 20:, ..., 1] += 0.9
    recorders = []
    for motion in (positions, later):
        streams = replace(data, positions=motion.reshape(data.positions.shape))
        windows_of = StreamScenarios(streams, 30, np.arange(EPISODES), np.zeros(EPISODES, dtype=np.int64))
        runner = Runner(streams, StreamRecogniser(), make_sensor("perfect", streams), load_track(track), ROOM)
        starts = ROOM.sample_starts(np.random.default_rng(1), EPISODES)
        batch = runner.batch(windows_of, np.arange(EPISODES), starts, np.random.default_rng(2))
        recorders.append(rolled(Everything(), runner, batch)[0])
        assert batch.surroundings is not None and batch.surroundings.moved is not None
        for observation in recorders[-1].observations:
            np.testing.assert_array_equal(observation.centre, batch.surroundings.moved[:, observation.frame])
    one, other = (recorder.observations for recorder in recorders)
    assert "centre" in array_names(one[0])
    for here, there in zip(one[:20], other[:20], strict=True):
        for name in array_names(here):
            np.testing.assert_array_equal(getattr(here, name), getattr(there, name), f"{name} in frame {here.frame}")
    assert (one[-1].centre != other[-1].centre).any(), "the futures differ"


@pytest.mark.parametrize("track", [IDEAL, "px4-auto"])
def test_in_a_stream_in_a_room_no_planner_acts_on_the_future(track: str) -> None:
    frames, last, rows = 24, 14, np.arange(EPISODES)
    setting = load_setting(Conditions(data="solo-stream", sensor="estimator", world="room", track=track))
    place, data, runner = ModelPlace.of(setting), setting.recordings, setting.runner
    assert isinstance(data, StreamData)
    streams = part_of(data, "test")[:EPISODES]
    later = data.positions.copy()
    for stream in streams:
        now, end = data.offsets[stream] + 100 + last, data.offsets[stream + 1]
        here = data.positions[now].mean(axis=(0, 1))
        later[now + 1 : end] = (data.positions[now + 1 : end] - here)[..., [1, 0, 2]] * [-1, 1, 1] + here  # they turn
    batches = []
    for motion in (data.positions, later):
        windows_of = StreamScenarios(replace(data, positions=motion), frames, streams, np.full(EPISODES, 100))
        starts = ROOM.sample_starts(np.random.default_rng(1), EPISODES)
        batches.append(runner.batch(windows_of, rows, starts, np.random.default_rng(2)))
    for name in sorted(RULES | PLANNING):
        planner = choose_planners([name], place, readout="recogniser", note=lambda _: None).planners[0]
        (one, first), (other, second) = (rolled(planner, runner, batch) for batch in batches)
        for frame in range(last + 1):
            np.testing.assert_array_equal(one.targets[frame], other.targets[frame], f"{name}: targets in frame {frame}")
        np.testing.assert_array_equal(first.viewpoints[:, : last + 2], second.viewpoints[:, : last + 2])
        np.testing.assert_array_equal(first.log_probs[:, : last + 1], second.log_probs[:, : last + 1])
        assert (first.log_probs[:, last + 1 :] != second.log_probs[:, last + 1 :]).any(), "the futures differ"


def test_nobody_is_told_where_passers_by_will_walk() -> None:
    data = world_of("duo").data
    runner = Runner(data, untrained("duo"), make_sensor("perfect", data), load_track(IDEAL), CROWD)
    starts = CROWD.sample_starts(np.random.default_rng(1), EPISODES)
    batch = runner.batch(world_of("duo").windows, np.arange(EPISODES), starts, np.random.default_rng(2))
    assert batch.surroundings is not None and batch.surroundings.passers is not None
    passers = batch.surroundings.passers
    changed = {name: part.copy() for name, part in passers.arrays.items()}
    for name, part in changed.items():
        part[:, LAST + 1 :] = 0 if name == "posture" else part[:, LAST + 1 :] + 0.5  # elsewhere, in another pose
    later = replace(batch, surroundings=replace(batch.surroundings, passers=replace(passers, **changed)))
    one, other = (rolled(Everything(), runner, each)[0].observations for each in (batch, later))
    assert "passers" in array_names(one[0])
    for here, there in zip(one[: LAST + 1], other[: LAST + 1], strict=True):
        np.testing.assert_array_equal(here.passers, passers.tracked[:, here.frame])
        for name in array_names(here):
            np.testing.assert_array_equal(getattr(here, name), getattr(there, name), f"{name} in frame {here.frame}")
    assert (one[LAST + 1].passers != other[LAST + 1].passers).any(), "the futures differ"


def test_an_origin_that_knows_the_whole_window_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = Scenarios.positions

    def centred(scenarios: Scenarios, indices: FloatArray) -> FloatArray:
        motion = honest(scenarios, indices)
        return (motion - motion.mean(axis=(1, 2, 3), keepdims=True)).astype(np.float32)

    monkeypatch.setattr(Scenarios, "positions", centred)
    with pytest.raises(AssertionError, match="joints_2d in frame 0"):
        assert_causal(Everything(), runner_of("duo", "perfect", IDEAL), world_of("duo"))
