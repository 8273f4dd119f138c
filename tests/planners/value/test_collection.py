"""Branching rollouts: every path is what a rollout that flies it gives, and workers change no number."""

from dataclasses import fields, replace

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.data.motion_data import MotionData
from ehar.errors import DataError
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion
from ehar.planner import Context, Observation, Planner, Truth
from ehar.processes import Processes
from ehar.rollout import rollout
from ehar.runner import Runner
from ehar.sensors.registry import make_sensor
from ehar.viewpoint import Workspace, wrap_difference
from ehar.world import CROWD, PAPER, World
from planners.value import collection as gain_collection
from planners.value import situation
from planners.value.collection import (
    Collection,
    CollectionTask,
    collect_batch,
    follow_paths,
    join,
    random_viewpoints,
    run_batches,
)
from planners.value.situation import frame_gains
from planners.value.view_basis import PAPER_RANGE, basis_at
from tests.helpers.fakes import FakeRecogniser, tiny_batch, tiny_context, tiny_data
from tests.helpers.gain_models import PAIRS
from tests.helpers.streams import StreamRecogniser, raising_streams

LENGTH = 10


@pytest.fixture(autouse=True)
def few_episodes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gain_collection, "EPISODES", 6)


def task(sensor: str = "estimator", data: MotionData | None = None, **changes: object) -> CollectionTask:
    data = data or tiny_data()
    whole = CollectionTask(
        runner=Runner(data, FakeRecogniser(), make_sensor(sensor, data)),
        sequences=np.arange(6),
        length=LENGTH,
        pairs=PAIRS,
        seed=3,
    )
    return replace(whole, **changes)  # type: ignore[arg-type]


def nearness(viewpoint: FloatArray) -> FloatArray:
    """Return more evidence from near by and from above: whatever a path does, it changes."""
    near: FloatArray = (20 - viewpoint[..., 0] + np.cos(viewpoint[..., 2])) / 60
    return near


def assert_same(first: Collection, second: Collection) -> None:
    for field in fields(Collection):
        np.testing.assert_array_equal(getattr(first, field.name), getattr(second, field.name), err_msg=field.name)


class Brancher(Planner):
    """Stays until frame `at`, follows paths there by `follow_paths`, and then flies to the goal itself."""

    name = "brancher"
    privileged = True

    def __init__(self, goals: FloatArray, at: int, path: int) -> None:
        self.goals, self.at, self.path = goals, at, path

    def reset(self, context: Context) -> None:
        self.workspace = context.workspace

    def act(self, observation: Observation) -> FloatArray:
        if observation.frame < self.at:
            return observation.viewpoint
        if observation.frame == self.at:
            truth = observation.truth
            assert isinstance(truth, Truth)
            self.worth, self.visited = follow_paths(
                truth, observation, self.goals, frames=LENGTH - 1 - self.at, classes=3
            )
        return self.goals[:, self.path]


class FlyingBrancher(Brancher):
    """Flies to the last goal until frame `at`, and tries the paths there."""

    def __init__(self, goals: FloatArray, at: int, path: int, length: int) -> None:
        super().__init__(goals, at, path)
        self.length = length

    def act(self, observation: Observation) -> FloatArray:
        if observation.frame == self.at:
            truth, left = observation.truth, self.length - 1 - self.at
            assert isinstance(truth, Truth)
            self.worth, self.visited = follow_paths(truth, observation, self.goals, frames=left, classes=3)
        return self.goals[:, self.path]


@pytest.mark.parametrize("at", [0, 4, LENGTH - 2])
@pytest.mark.parametrize("sensor", ["perfect", "estimator"])
def test_a_path_is_worth_what_a_rollout_along_it_gives(at: int, sensor: str) -> None:
    batch = tiny_batch(length=LENGTH)
    goals = random_viewpoints(np.random.default_rng(1), (6, 3), Workspace())
    goals[:, 0] = batch.starts
    for path in range(3):
        brancher = Brancher(goals, at, path)
        recogniser = FakeRecogniser(quality=nearness)
        record = rollout(
            brancher, batch, recogniser, task(sensor).runner.sensor, GridMotion(), tiny_context(length=LENGTH)
        )
        right = np.exp(record.log_probs[np.arange(6), :, batch.labels])
        np.testing.assert_allclose(brancher.worth[:, path], right[:, at + 1 :].mean(axis=1), atol=1e-6)
        np.testing.assert_allclose(brancher.visited[:, path], record.viewpoints[:, at + 1 :], atol=1e-12)
    assert np.ptp(brancher.worth, axis=1).max() > 1e-4, "paths should differ"


@pytest.mark.parametrize("at", [0, 30])
def test_a_flight_is_worth_what_a_rollout_along_it_gives(at: int) -> None:
    """Forked in the middle of a flight too: at frame 30 the cameras are on their way."""
    length, vehicle = 60, VEHICLES["tracking-drone"]
    batch = tiny_batch(length=length)
    context = replace(tiny_context(length=length), track=vehicle.name, vehicle=vehicle)
    goals = random_viewpoints(np.random.default_rng(1), (6, 3), Workspace())
    brancher = FlyingBrancher(goals, at, 2, length)
    record = rollout(
        brancher,
        batch,
        FakeRecogniser(quality=nearness),
        task("perfect").runner.sensor,
        FlightMotion(vehicle=vehicle),
        context,
    )
    right = np.exp(record.log_probs[np.arange(6), :, batch.labels])
    np.testing.assert_allclose(brancher.visited[:, 2], record.viewpoints[:, at + 1 :], atol=1e-9)
    np.testing.assert_allclose(brancher.worth[:, 2], right[:, at + 1 :].mean(axis=1), atol=1e-6)
    steps = np.abs(np.diff(brancher.visited[:, 1, :, 0], axis=1))
    assert 0.01 < steps.max() <= vehicle.speed * context.frame_time, "a vehicle should fly the other paths too"


def test_forks_hold_what_their_paths_gave(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[tuple[Observation, FloatArray, FloatArray, FloatArray]] = []

    def watched(
        truth: Truth,
        observation: Observation,
        goals: FloatArray,
        *,
        frames: int,
        classes: int,
    ) -> tuple[FloatArray, FloatArray]:
        worth, visited = follow_paths(truth, observation, goals, frames=frames, classes=classes)
        calls.append((observation, goals, worth, visited))
        return worth, visited

    monkeypatch.setattr(gain_collection, "follow_paths", watched)
    collection = collect_batch(task(), 0)
    assert 1 <= len(calls) <= 3
    for fork, (observation, goals, worth, visited) in enumerate(calls):
        rows = slice(6 * fork, 6 * fork + 6)
        np.testing.assert_array_equal(goals[:, 0], observation.viewpoint)
        np.testing.assert_allclose(visited[:, 0], np.repeat(observation.viewpoint[:, None], visited.shape[2], axis=1))
        np.testing.assert_array_equal(collection.episode[rows], np.arange(6))
        np.testing.assert_array_equal(collection.frame[rows], observation.frame)
        np.testing.assert_array_equal(collection.worth[rows], worth)
        np.testing.assert_array_equal(collection.embedding[rows], observation.embedding)
        np.testing.assert_array_equal(collection.viewpoints[:, observation.frame], observation.viewpoint)
        gains = frame_gains(observation.frame, LENGTH)
        along = sum(gains[step] * basis_at(visited[:, :, step], PAPER_RANGE) for step in range(len(gains)))
        np.testing.assert_allclose(collection.path[rows], along, atol=1e-12)
    # The first path stays, so that its mean basis is that of the viewpoint.
    here = collection.viewpoints[collection.episode, collection.frame]
    np.testing.assert_allclose(collection.path[:, 0], basis_at(here, PAPER_RANGE), atol=1e-9)


@pytest.mark.parametrize("world", [PAPER, CROWD])
def test_views_count_as_far_as_they_show_people(world: World) -> None:
    data = tiny_data()
    runner = Runner(data, FakeRecogniser(), make_sensor("estimator", data), world=world)
    collection = collect_batch(task(runner=runner), 0)
    seen = collection.path[..., 0]  # of a function that is 1 everywhere
    if world.is_open:
        np.testing.assert_allclose(seen, 1)
    else:
        assert seen.min() < 0.95 and seen.max() <= 1 + 1e-9


def test_what_a_batch_holds() -> None:
    collection = collect_batch(task(), 0)
    forks = len(collection.episode)
    assert forks in (6, 12, 18)
    assert collection.log_probs.shape == (6, LENGTH, 3)
    assert collection.viewpoints.shape == (6, LENGTH, 3)
    assert collection.worth.shape == (forks, 8)
    assert collection.path.shape == (forks, 8, 21)
    assert collection.facing.shape == collection.facing_std.shape == (forks, 1)
    assert collection.position.shape == (forks, 1, 3)
    assert ((collection.worth > 0) & (collection.worth < 1)).all()
    np.testing.assert_array_equal(collection.labels, tiny_data().labels[collection.sequences])
    assert (collection.frame < LENGTH - 1).all()


def test_some_cameras_wander_and_some_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gain_collection, "EPISODES", 40)
    viewpoints = collect_batch(task("perfect"), 0).viewpoints
    moved = (viewpoints != viewpoints[:, :1]).any(axis=(1, 2))
    assert 0.3 < moved.mean() < 0.9


def test_only_given_sequences_are_used_as_often_as_they_are_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gain_collection, "EPISODES", 400)
    data = tiny_data(sequences=3, frames=40)
    # The first sequence has 10 of the frames, the second 70, the third 40, of which windows of 10 are cut.
    data = replace(data, offsets=np.array([0, 10, 80, 120]))
    chosen = collect_batch(task("perfect", data=data, sequences=np.array([0, 1])), 0)
    shares = np.bincount(chosen.sequences, minlength=3) / 400
    np.testing.assert_allclose(shares, [1 / 8, 7 / 8, 0], atol=0.06)


def test_the_seed_and_the_batch_decide_everything() -> None:
    first = collect_batch(task(), 1)
    assert_same(first, collect_batch(task(), 1))
    for other in (collect_batch(task(), 2), collect_batch(task(seed=4), 1)):
        assert not np.array_equal(first.viewpoints, other.viewpoints)


def test_led_cameras_watch_what_was_not_watched_before() -> None:
    led = collect_batch(task(lead=Leader()), 1)
    first = collect_batch(task(), 1)
    assert not np.array_equal(led.viewpoints[:, 0], first.viewpoints[:, 0])


def test_two_workers_give_the_same_numbers_as_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gain_collection, "EPISODES", 32)  # as in the workers, which import the module anew
    alone = dict(run_batches(task(), [0, 3]))
    together = dict(run_batches(task(), [0, 3], engine=Processes(2)))
    assert sorted(together) == [0, 3]
    for index, collection in alone.items():
        assert_same(collection, together[index])


def test_joined_forks_belong_to_their_episodes() -> None:
    pieces = [collect_batch(task(), index) for index in range(3)]
    joined = join(pieces)
    assert len(joined.labels) == 18
    begin = 0
    for index, piece in enumerate(pieces):
        forks = slice(begin, begin + len(piece.episode))
        begin = forks.stop
        np.testing.assert_array_equal(joined.episode[forks], piece.episode + 6 * index)
        np.testing.assert_array_equal(joined.worth[forks], piece.worth)
        np.testing.assert_array_equal(
            joined.viewpoints[joined.episode[forks], joined.frame[forks]], piece.viewpoints[piece.episode, piece.frame]
        )
    assert begin == len(joined.episode)


def test_no_sequence_is_long_enough() -> None:
    with pytest.raises(DataError, match=r"^tiny: expected policy .* of at least 10 frames, got none"):
        list(run_batches(task(sequences=np.array([], dtype=np.int64)), [0]))


def test_random_viewpoints_lie_all_over_the_workspace() -> None:
    drawn = random_viewpoints(np.random.default_rng(0), (50, 40), Workspace())
    assert drawn.shape == (50, 40, 3)
    assert Workspace().contains(drawn).all()
    spans = (drawn.reshape(-1, 3).max(axis=0) - drawn.reshape(-1, 3).min(axis=0)) / [10, 2 * np.pi, np.pi / 2]
    assert (spans > 0.98).all()


class Leader(Planner):
    """Flies straight to one place, and remembers what it was shown."""

    name = "leader"

    def reset(self, context: Context) -> None:
        self.shown: list[Observation] = []

    def act(self, observation: Observation) -> FloatArray:
        self.shown.append(observation)
        return np.tile([5.0, 1.0, 1.0], (len(observation.viewpoint), 1))


def test_a_led_camera_follows_and_its_leader_is_not_told_the_truth() -> None:
    leader = Leader()
    led = collect_batch(task(lead=leader), 0)
    assert len(leader.shown) == LENGTH - 1
    assert all(observation.truth is None for observation in leader.shown)
    moved = (led.viewpoints != led.viewpoints[:, :1]).any(axis=(1, 2))
    assert moved.any() and not moved.all()  # some stay
    away = np.abs(led.viewpoints[moved][:, [0, -1]] - [5.0, 1.0, 1.0])
    away[..., 1] = np.abs(wrap_difference(led.viewpoints[moved][:, [0, -1], 1] - 1.0))
    assert (away[:, 1] <= away[:, 0] + 1e-9).all()


def test_paths_in_a_stream_are_as_long_as_planners_look_ahead(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(situation, "STREAM_LOOKAHEAD", 0.8)
    data = raising_streams()
    runner = Runner(data, StreamRecogniser(quality=nearness), make_sensor("perfect", data))
    collection = collect_batch(CollectionTask(runner, np.arange(4), 40, PAIRS, seed=0, memory=0.3), 0)
    assert (collection.frames == 8).all()
    assert collection.frame.max() <= 40 - 1 - 8
    assert collection.labels.shape == (6, 40)
    # What is right in a frame without activity is worth nothing: staying is as good as its activities are recognised.
    for fork, (episode, frame) in enumerate(zip(collection.episode, collection.frame, strict=True)):
        labels = collection.labels[episode, frame + 1 : frame + 9]
        said = np.exp(collection.log_probs[episode, frame + 1 : frame + 9])
        moved = np.ptp(collection.viewpoints[episode, frame : frame + 9], axis=0).any()
        if not moved:
            worth = np.where(labels < 3, said[np.arange(8), labels], 0).mean()
            assert collection.worth[fork, 0] == pytest.approx(worth, abs=1e-6)
        assert collection.worth[fork].max() <= (labels < 3).mean() + 1e-6
