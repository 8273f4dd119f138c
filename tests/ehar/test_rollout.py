"""The one loop: what it records, and what it says of a planner that breaks its contract."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from ehar.arrays import FloatArray, IntArray
from ehar.batch import Batch, noise_of
from ehar.data.streams.scenario import StreamScenarios
from ehar.errors import EpisodeError
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion
from ehar.planner import Context, Observation, Planner
from ehar.rollout import Record, rollout
from ehar.runner import Runner
from ehar.sensors.estimator import EstimatorSensor
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.sensor import Sensor, SensorNoise
from ehar.world import PAPER
from tests.helpers.fakes import FakeRecogniser, tiny_batch, tiny_context, tiny_scenarios
from tests.helpers.streams import StreamRecogniser, raising_streams

EPISODES, LENGTH = 5, 6


class Answers(Planner):
    """A planner that answers what a test tells it to."""

    name = "answers"

    def __init__(self, answer: Callable[[Observation], FloatArray], *, privileged: bool = False) -> None:
        self.answer = answer
        self.privileged = privileged

    def reset(self, context: Context) -> None:
        self.context = context

    def act(self, observation: Observation) -> FloatArray:
        return self.answer(observation)


def run(
    answer: Callable[[Observation], FloatArray], *, privileged: bool = False, sensor: Sensor | None = None
) -> Record:
    batch, context = tiny_batch(episodes=EPISODES, length=LENGTH), tiny_context(episodes=EPISODES, length=LENGTH)
    planner = Answers(answer, privileged=privileged)
    return rollout(planner, batch, FakeRecogniser(), sensor or PerfectSensor(), GridMotion(), context)


def test_the_first_frame_is_seen_from_the_start_and_then_the_camera_moves() -> None:
    starts = tiny_batch(episodes=EPISODES, length=LENGTH).starts
    record = run(lambda observation: observation.viewpoint + np.array([0.1, 0.0, 0.0]))
    assert record.viewpoints.shape == (EPISODES, LENGTH, 3)
    np.testing.assert_array_equal(record.viewpoints[:, 0], starts)
    expected = np.minimum(starts[:, :1] + 0.1 * np.arange(LENGTH), 15.0)
    np.testing.assert_allclose(record.viewpoints[..., 0], expected)
    np.testing.assert_allclose(record.viewpoints[..., 1:], np.repeat(starts[:, None, 1:], LENGTH, axis=1))


def test_the_record_is_what_the_recogniser_says_of_the_frames_from_those_viewpoints() -> None:
    batch = tiny_batch(episodes=EPISODES, length=LENGTH)
    record = run(lambda observation: observation.viewpoint + np.array([0.0, 0.1, 0.1]))
    assert record.log_probs.dtype == np.float32
    assert record.plan_seconds > 0
    recogniser = FakeRecogniser()
    state = recogniser.start(EPISODES)
    for frame in range(LENGTH):
        viewpoint = record.viewpoints[:, frame]
        sensed = PerfectSensor().sense(batch.positions[:, frame], viewpoint, batch.noise.frame(frame))
        recognition, state = recogniser.step(state, sensed, viewpoint)
        np.testing.assert_array_equal(record.log_probs[:, frame], recognition.log_probs)


def test_in_a_stream_the_recogniser_is_told_of_onsets_only_if_asked_for() -> None:
    data = raising_streams(people=EPISODES, seconds=4)
    streams = StreamScenarios(data, 40, np.arange(EPISODES), np.zeros(EPISODES, dtype=np.int64))
    runner = Runner(data, StreamRecogniser(), PerfectSensor())
    batch = runner.batch(
        streams, np.arange(EPISODES), PAPER.sample_starts(np.random.default_rng(1), EPISODES), np.random.default_rng(2)
    )
    stays = Answers(lambda observation: observation.viewpoint)
    context = replace(tiny_context(episodes=EPISODES), class_names=StreamRecogniser.class_names, length=None)
    told, usual = (
        rollout(stays, batch, StreamRecogniser(), PerfectSensor(), GridMotion(), context, onset)
        for onset in ("known", "unknown")
    )
    recogniser = StreamRecogniser()
    state = recogniser.start(EPISODES)
    for frame in range(40):
        seen = batch.sense(PerfectSensor(), frame, batch.starts)
        recognition, state = recogniser.step(state, seen, batch.starts)
        np.testing.assert_array_equal(usual.log_probs[:, frame], recognition.log_probs)
    assert (told.log_probs != usual.log_probs).any()


def test_what_an_oracle_imagines_is_what_it_will_see() -> None:
    sensor = EstimatorSensor(skeleton=tiny_context().skeleton)
    imagined: list[FloatArray] = []
    seen: list[FloatArray] = []

    def answer(observation: Observation) -> FloatArray:
        assert observation.truth is not None
        seen.append(observation.joints_2d)
        there = observation.viewpoint[:, None]
        imagined.append(observation.truth.sense(observation.frame + 1, there).joints_2d[:, 0])
        return observation.viewpoint

    run(answer, privileged=True, sensor=sensor)
    for before, after in zip(imagined[:-1], seen[1:], strict=True):
        np.testing.assert_allclose(before, after, rtol=1e-5)


def test_all_arrays_are_copies_that_nobody_can_write_into() -> None:
    shown: list[FloatArray] = []

    def answer(observation: Observation) -> FloatArray:
        assert observation.truth is not None
        imagined = observation.truth.sense(observation.frame, observation.viewpoint[:, None])
        arrays = [value for value in vars(observation).values() if isinstance(value, np.ndarray)]
        assert len(arrays) == 7
        shown.extend([*arrays, observation.truth.labels, *imagined])
        return observation.viewpoint

    run(answer, privileged=True)
    assert len(shown) == 10 * (LENGTH - 1)
    for array in shown:
        assert isinstance(array.base, bytes)
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
        with pytest.raises(ValueError, match="cannot set WRITEABLE"):
            array.flags.writeable = True


def test_a_planner_has_a_context_of_its_own() -> None:
    told: list[Context] = []

    class Asked(Answers):
        def reset(self, context: Context) -> None:
            told.append(context)

    batch, context = tiny_batch(episodes=EPISODES, length=LENGTH), tiny_context(episodes=EPISODES, length=LENGTH)
    context = replace(context, vehicle=VEHICLES["px4-max"])
    rollout(Asked(lambda shown: shown.viewpoint), batch, FakeRecogniser(), PerfectSensor(), GridMotion(), context)
    assert vars(told[0]) == vars(context)
    for part in ("workspace", "skeleton", "vehicle"):
        assert getattr(told[0], part) is not getattr(context, part)
    assert told[0].rng is context.rng
    assert not told[0].skeleton.mirror.flags.writeable


def test_a_target_that_is_not_finite_names_planner_episode_and_frame() -> None:
    def answer(observation: Observation) -> FloatArray:
        target = np.array(observation.viewpoint)
        if observation.frame == 2:
            target[3, 1] = np.nan
        return target

    with pytest.raises(EpisodeError, match=r"planner 'answers', episode 'episode-3', frame 2: .* finite .*nan"):
        run(answer)


@pytest.mark.parametrize("start", [[4.9, 0, 1], [15.1, 0, 1], [10, 0, -0.1], [10, 0, 1.6], [10, np.nan, 1]])
def test_a_start_outside_of_the_workspace_names_the_episode(start: list[float]) -> None:
    batch = tiny_batch(episodes=EPISODES, length=LENGTH)
    batch.starts[2] = start
    planner, context = (
        Answers(lambda observation: observation.viewpoint),
        tiny_context(episodes=EPISODES, length=LENGTH),
    )
    with pytest.raises(EpisodeError, match=r"episode 'episode-2': expected a start viewpoint within 5 to 15 m.*got \["):
        rollout(planner, batch, FakeRecogniser(), PerfectSensor(), GridMotion(), context)


@pytest.mark.parametrize(
    "shape",
    [(5,), (5, 2), (4, 3), (5, 7, 3), (), (5, 3, 3), (5, 0, 3, 3)],
)
def test_a_target_of_a_wrong_shape_names_planner_episode_and_frame(shape: tuple[int, ...]) -> None:
    with pytest.raises(EpisodeError) as error:
        run(lambda observation: np.zeros(shape))
    for part in ("planner 'answers'", "episode 'episode-0'", "frame 0", "(5, 3)", str(shape)):
        assert part in str(error.value)


@pytest.mark.parametrize("answer", [None, "left", [[1.0], [2.0, 3.0]], {"target": 1}])
def test_a_target_that_is_no_array_names_planner_and_frame(answer: object) -> None:
    with pytest.raises(EpisodeError, match=r"planner 'answers'.*frame 0: expected target viewpoints of shape \(5, 3\)"):
        run(lambda observation: answer)  # type: ignore[arg-type, return-value]


def test_a_list_of_numbers_is_as_good_as_an_array() -> None:
    record = run(lambda observation: observation.viewpoint.tolist())  # type: ignore[arg-type, return-value]
    np.testing.assert_array_equal(record.viewpoints[:, -1], record.viewpoints[:, 0])


def arrays(batch: Batch) -> list[FloatArray]:
    return [batch.positions, batch.labels, batch.starts, *batch.noise]


def assert_same(first: Batch, second: Batch) -> None:
    for one, other in zip(arrays(first), arrays(second), strict=True):
        np.testing.assert_array_equal(one, other)
    assert first.names == second.names


def test_a_batch_of_scenarios_names_each_by_its_sequence_and_first_frame() -> None:
    scenarios, chosen = tiny_scenarios(length=LENGTH), np.array([16, 0, 2])  # each sequence has 15 windows
    starts, noise = np.ones((3, 3)), noise_of(scenarios, 3, np.random.default_rng(0))
    batch = Batch.of(scenarios, chosen, starts, noise)
    assert batch.names == ("sequence-1 from frame 1", "sequence-0 from frame 0", "sequence-0 from frame 2")
    np.testing.assert_array_equal(batch.positions, scenarios.positions(chosen))
    np.testing.assert_array_equal(batch.labels, [1, 0, 0])
    assert batch.starts is starts
    assert batch.noise is noise


def test_joined_batches_hold_the_episodes_of_one_after_those_of_another() -> None:
    first, second = tiny_batch(episodes=2, seed=0), tiny_batch(episodes=3, seed=1)
    joined = Batch.joined([first, second])
    assert len(joined.labels) == len(joined.names) == 5
    assert isinstance(joined.noise, SensorNoise)
    assert_same(joined.select(slice(2)), first)
    assert_same(joined.select(np.array([2, 3, 4])), second)
    assert_same(Batch.joined([first]), first)


@pytest.mark.parametrize("rows", [np.array([4, 0, 0]), slice(1, 3), np.array([], dtype=np.int64)])
@pytest.mark.parametrize("frames", [None, 1, 4])
def test_some_episodes_and_their_first_frames_are_selected(rows: IntArray | slice, frames: int | None) -> None:
    batch = tiny_batch(episodes=EPISODES, length=LENGTH)
    chosen = np.arange(EPISODES)[rows].tolist()
    selected = batch.select(rows, frames)
    assert selected.positions.shape[:2] == (len(chosen), frames or LENGTH)
    assert selected.names == tuple(f"episode-{row}" for row in chosen)
    for place, row in enumerate(chosen):
        np.testing.assert_array_equal(selected.positions[place], batch.positions[row, :frames])
        np.testing.assert_array_equal(selected.labels[place], batch.labels[row])
        np.testing.assert_array_equal(selected.starts[place], batch.starts[row])
        for drawn, whole in zip(selected.noise, batch.noise, strict=True):
            np.testing.assert_array_equal(drawn[place], whole[row, :frames])


def test_a_selected_episode_runs_as_it_does_among_others() -> None:
    batch, planner = tiny_batch(episodes=EPISODES, length=LENGTH), Answers(lambda seen: seen.viewpoint + 0.1)
    records = [
        rollout(
            planner,
            some,
            FakeRecogniser(),
            EstimatorSensor(skeleton=tiny_context().skeleton),
            GridMotion(),
            tiny_context(episodes=len(some.labels), length=LENGTH),
        )
        for some in (batch, batch.select(np.array([3, 1])))
    ]
    np.testing.assert_array_equal(records[0].viewpoints[[3, 1]], records[1].viewpoints)
    np.testing.assert_allclose(records[0].log_probs[[3, 1]], records[1].log_probs, rtol=1e-6)


def test_a_path_is_followed_by_what_can_and_headed_for_by_what_cannot() -> None:
    def ahead(observation: Observation) -> FloatArray:
        path = np.zeros((EPISODES, 4, 3, 3))
        path[:, :, 0] = observation.viewpoint[:, None] + np.arange(1, 5)[:, None] * [0.0, np.radians(3.6), 0.0]
        return path

    grid = run(ahead).viewpoints
    first = run(lambda observation: ahead(observation)[:, 0, 0]).viewpoints
    np.testing.assert_array_equal(grid, first)

    def broken(observation: Observation) -> FloatArray:
        path = ahead(observation)
        path[1, 2, 1, 0] = np.nan
        return path

    with pytest.raises(EpisodeError, match=r"expected a finite path, got \[nan, 0\.0, 0\.0\]"):
        run(broken)
