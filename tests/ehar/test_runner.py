"""The runner sets up what a rollout by hand would: the same context, the same batch, the same record."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.batch import Batch
from ehar.data.scenario import Scenarios, windows
from ehar.data.streams.followed import following_centre
from ehar.data.streams.scenario import StreamScenarios
from ehar.errors import EpisodeError, UsageError
from ehar.flight.centre import around_centre, centre_limits
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.localisation import Localisation
from ehar.motion import GridMotion, Motion
from ehar.planner import Context, Observation, Planner
from ehar.rollout import rollout
from ehar.runner import Runner
from ehar.sensors.estimator import EstimatorSensor
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.sensor import draw_noise
from ehar.track import Track, load_track
from ehar.viewpoint import Workspace
from ehar.world import PAPER
from tests.helpers.fakes import CLASS_NAMES, SKELETON, FakeRecogniser, tiny_data
from tests.helpers.streams import raising_streams

EPISODES, LENGTH, FPS = 5, 8, 20.0
NARROW = Workspace(distance_max=12.0)


class Drawing(Planner):
    """Goes where its generator says, and keeps what it was told."""

    name = "drawing"

    def reset(self, context: Context) -> None:
        self.context = context

    def act(self, observation: Observation) -> FloatArray:
        return observation.viewpoint + self.context.rng.normal(size=observation.viewpoint.shape)


def runner(track: Track | None = None) -> Runner:
    chosen = {} if track is None else {"track": track}
    return Runner(tiny_data(fps=FPS, persons=2), FakeRecogniser(), EstimatorSensor(skeleton=SKELETON), **chosen)


def scenarios(made: Runner) -> Scenarios:
    return windows(made.data, np.arange(len(made.data.labels)), LENGTH, 1)


def batch_of(made: Runner, *, seed: int = 0) -> Batch:
    rng = np.random.default_rng(seed)
    return made.batch(scenarios(made), np.array([3, 0, 30, 7, 7]), PAPER.sample_starts(rng, EPISODES), rng)


def by_hand(made: Runner, motion: Motion, **told: Any) -> Context:
    return Context(
        episodes=EPISODES,
        length=LENGTH,
        frame_time=1 / FPS,
        class_names=CLASS_NAMES,
        skeleton=SKELETON,
        **{"workspace": motion.workspace, "track": "ideal", "rng": np.random.default_rng(9), "vehicle": None, **told},
    )


def assert_same_context(got: Context, expected: Context) -> None:
    for field in fields(Context):
        one, other = getattr(got, field.name), getattr(expected, field.name)
        if field.name == "rng":
            assert one.bit_generator.state == other.bit_generator.state
        else:
            assert one == other, field.name


def test_the_batch_is_that_of_the_scenarios_with_noise_from_the_generator() -> None:
    chosen, rng = np.array([3, 0, 30, 7, 7]), np.random.default_rng(0)
    starts = PAPER.sample_starts(rng, EPISODES)
    expected = draw_noise(rng, (EPISODES, LENGTH), 2, len(SKELETON.joint_names))
    batch, cut = batch_of(runner()), scenarios(runner())
    np.testing.assert_array_equal(batch.positions, cut.positions(chosen))
    np.testing.assert_array_equal(batch.labels, cut.labels[chosen])
    np.testing.assert_array_equal(batch.starts, starts)
    for drawn, wanted in zip(batch.noise, expected, strict=True):
        np.testing.assert_array_equal(drawn, wanted)


@pytest.mark.parametrize("workspace", [None, NARROW])
def test_the_context_on_the_grid(workspace: Workspace | None) -> None:
    context = runner().context(EPISODES, LENGTH, np.random.default_rng(9), workspace)
    assert_same_context(context, by_hand(runner(), GridMotion(workspace=workspace)))


def test_the_context_of_a_vehicle() -> None:
    vehicle = VEHICLES["px4-auto"]
    context = runner(load_track("px4-auto")).context(EPISODES, LENGTH, np.random.default_rng(9))
    expected = by_hand(runner(), GridMotion(), track="px4-auto", vehicle=vehicle)
    assert_same_context(context, expected)


@pytest.mark.parametrize("name", ["ideal", "px4-auto"])
def test_a_roll_is_a_rollout_by_hand(name: str) -> None:
    made, vehicle = runner(load_track(name)), VEHICLES.get(name)
    batch, planner = batch_of(made), Drawing()
    record = made.roll(planner, batch, np.random.default_rng(9))
    motion = GridMotion() if vehicle is None else FlightMotion(vehicle=vehicle)
    context = by_hand(made, motion, track=name, vehicle=vehicle)
    again = rollout(Drawing(), batch, FakeRecogniser(), made.sensor, motion, context)
    np.testing.assert_array_equal(record.viewpoints, again.viewpoints)
    np.testing.assert_array_equal(record.log_probs, again.log_probs)
    assert (record.viewpoints[:, 1:] != record.viewpoints[:, :1]).any()
    assert planner.context.workspace == motion.workspace


def test_every_roll_has_a_body_of_its_own() -> None:
    made = runner(load_track("px4-max"))
    batch = batch_of(made)
    first, second = (made.roll(Drawing(), batch, np.random.default_rng(9)) for _ in range(2))
    np.testing.assert_array_equal(first.viewpoints, second.viewpoints)


def test_a_motion_that_is_handed_in_carries_the_camera_and_bounds_the_planner() -> None:
    made, motion, planner = runner(), GridMotion(workspace=NARROW), Drawing()
    batch = batch_of(made)
    batch.starts[:, 0] = 11.0
    record = made.roll(planner, batch, np.random.default_rng(9), motion)
    assert planner.context.workspace == NARROW
    assert NARROW.contains(record.viewpoints).all()
    batch.starts[2, 0] = 14.0
    with pytest.raises(EpisodeError, match="expected a start viewpoint within"):
        made.roll(planner, batch, np.random.default_rng(9), GridMotion(workspace=NARROW))


def test_people_who_get_away_behind_the_last_whole_window_are_told_of() -> None:
    data = raising_streams()
    frames, length = int(data.lengths[0]), 2 * int(data.lengths[0]) // 3
    positions = data.positions.copy()
    run = frames // 4  # of the last third, which no window that begins at a multiple of its length shows
    positions[frames - run : frames] += np.linspace(0, 60, run)[:, None, None, None] * np.float32((1, 0, 0))
    made = Runner(
        replace(data, positions=positions), FakeRecogniser(), PerfectSensor(), track=load_track("tracking-drone")
    )
    with pytest.raises(UsageError, match=f"too slow for the people of '{data.sequence_names[0]}'"):
        made.followed_everywhere(windows(made.data, np.arange(len(data.lengths)), length, 1))
    unmoved = Runner(data, FakeRecogniser(), PerfectSensor(), track=load_track("tracking-drone"))
    unmoved.followed_everywhere(windows(data, np.arange(len(data.lengths)), length, 1))


def test_around_people_who_walk_a_vehicle_has_what_following_them_leaves() -> None:
    data, vehicle = raising_streams(), VEHICLES["px4-auto"]
    made = Runner(data, FakeRecogniser(), PerfectSensor(), track=load_track("px4-auto"))
    scenarios = StreamScenarios(data, 60, np.arange(3), np.full(3, 20))
    batch = made.batch(
        scenarios, np.arange(3), PAPER.sample_starts(np.random.default_rng(0), 3), np.random.default_rng(1)
    )
    assert batch.centre is not None
    followed = following_centre(data, Localisation(), centre_limits(vehicle)).position.reshape(8, -1, 3)[:3, 20:80]
    there = data.positions.reshape(8, -1, 1, 6, 3)[:3, 20:80] - followed[:, :, None, None]
    np.testing.assert_allclose(batch.around_centre, there, atol=1e-6)
    context, motion = made.context(3, None, np.random.default_rng(9), follows=True), made.new_motion()
    assert context.vehicle == around_centre(vehicle) and context.follows
    assert isinstance(motion, FlightMotion) and motion.vehicle == around_centre(vehicle)
    cut = Runner(data, FakeRecogniser(), PerfectSensor()).batch(
        scenarios, np.arange(3), batch.starts, np.random.default_rng(1)
    )
    assert cut.centre is None and cut.gaze is None
    np.testing.assert_array_equal(batch.positions, cut.positions)  # a gimbal looks where a camera of the grid does


def test_people_who_are_too_fast_for_a_vehicle_end_the_run() -> None:
    data = raising_streams()
    data.positions[:, :, :, 0] += (0.2 * (np.arange(len(data.positions)) % 120))[:, None, None]  # 2 m/s
    made = Runner(data, FakeRecogniser(), PerfectSensor(), track=load_track("ground-robot"))
    scenarios = StreamScenarios(data, 60, np.arange(3), np.full(3, 20))
    with pytest.raises(
        UsageError, match=r"track ground-robot: too slow for the people of 'stream-\d', frame \d+: .* 2.5 m"
    ):
        made.batch(scenarios, np.arange(3), PAPER.sample_starts(np.random.default_rng(0), 3), np.random.default_rng(1))
