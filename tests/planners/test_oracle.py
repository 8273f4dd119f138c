"""The oracles: greedy is the argmin of the next cross-entropy, and the lookahead crosses hills."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.batch import Batch
from ehar.data.skeleton import Skeleton
from ehar.errors import EpisodeError
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion
from ehar.obstacles import Box, Obstacles, Surroundings
from ehar.planner import Context, Observation, Planner, Truth
from ehar.rollout import Record, rollout
from ehar.sensors.estimator import EstimatorSensor
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.sensor import Sensor
from ehar.viewpoint import AZIMUTH, POLAR, apply_moves, cartesian, wrap_difference
from ehar.world import PAPER
from planners import oracle
from planners.heuristic import NoAct
from planners.oracle import Oracle, OracleLookahead
from tests.helpers.fakes import FakeRecogniser, tiny_batch, tiny_context

EPISODES, LENGTH = 24, 20


def run(
    planner: Planner, batch: Batch, recogniser: FakeRecogniser | None = None, sensor: Sensor | None = None
) -> Record:
    context = tiny_context(episodes=len(batch.labels), length=LENGTH)
    return rollout(planner, batch, recogniser or FakeRecogniser(), sensor or PerfectSensor(), GridMotion(), context)


def episodes(seed: int = 0) -> Batch:
    return tiny_batch(episodes=EPISODES, length=LENGTH, seed=seed)


def true_class_probability(record: Record, batch: Batch) -> FloatArray:
    """Return the probability of the true label in each frame, (B, L)."""
    return np.exp(np.take_along_axis(record.log_probs, batch.labels[:, None, None], axis=2)[..., 0])


def hill(viewpoint: FloatArray) -> FloatArray:
    """Return evidence that is best at azimuth 0, nil five cells beside it, and a little better beyond."""
    cells = np.abs(wrap_difference(viewpoint[..., AZIMUTH])) / np.radians(3.6)
    return np.where(cells <= 2, 1.0, 0.01 * np.maximum(cells - 5, 0))


def foot_of_the_hill() -> Batch:
    """Return level episodes that start 8 cells from azimuth 0, on either side, where greed leads away from it."""
    cells = np.array([[50, 8, 25], [50, 92, 25]])
    return replace(episodes(), starts=PAPER.workspace.from_cells(np.resize(cells, (EPISODES, 3))))


@pytest.mark.parametrize("sensor", ["perfect", "estimator"])
def test_greedy_makes_the_move_of_the_lowest_cross_entropy(sensor: str) -> None:
    batch = episodes()
    made: Sensor = PerfectSensor()
    if sensor == "estimator":
        made = EstimatorSensor(skeleton=Skeleton(tiny_context().skeleton.joint_names, ()), noise_floor=40.0)
    record = run(Oracle(), batch, sensor=made)
    recogniser = FakeRecogniser()
    state = recogniser.start(EPISODES)
    for frame in range(LENGTH - 1):
        noise, later = batch.noise.frame(frame), batch.noise.frame(frame + 1)
        here = record.viewpoints[:, frame]
        _, state = recogniser.step(state, made.sense(batch.positions[:, frame], here, noise), here)
        entropies = []
        for move in range(7):  # one move after another, without a fork
            there = apply_moves(here, np.full(EPISODES, move), GridMotion().workspace)
            sensed = made.sense(batch.positions[:, frame + 1], there, later)
            imagined, _ = recogniser.step(state, sensed, there)
            entropies.append(-imagined.log_probs[np.arange(EPISODES), batch.labels])
        got = -record.log_probs[np.arange(EPISODES), frame + 1, batch.labels]
        np.testing.assert_allclose(got, np.min(entropies, axis=0), atol=1e-6)


def test_the_lookahead_crosses_a_hill_where_greed_turns_away() -> None:
    batch = foot_of_the_hill()
    greedy = run(Oracle(), batch, FakeRecogniser(quality=hill))
    ahead = run(OracleLookahead(horizon=12, commit=8), batch, FakeRecogniser(quality=hill))
    assert (hill(greedy.viewpoints[:, -1]) < 1).all()
    assert (hill(ahead.viewpoints[:, -1]) == 1).all()
    assert true_class_probability(ahead, batch).mean() > true_class_probability(greedy, batch).mean() + 0.1


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("horizon", "commit"), [(12, 8), (4, 1), (30, 30)])
def test_the_lookahead_is_on_average_not_below_greedy_nor_greedy_below_no_act(
    seed: int, horizon: int, commit: int
) -> None:
    batch = episodes(seed)

    def mean(planner: Planner) -> float:
        return float(true_class_probability(run(planner, batch), batch).mean())

    still, greedy = mean(NoAct()), mean(Oracle())
    assert greedy >= still
    assert mean(OracleLookahead(horizon=horizon, commit=commit)) >= greedy - 1e-6


def test_over_one_horizon_the_lookahead_is_worth_at_least_the_greedy_path_in_every_episode() -> None:
    batch = episodes(5)
    whole = OracleLookahead(horizon=LENGTH - 1, commit=LENGTH - 1)
    greedy, ahead = run(Oracle(), batch), run(whole, batch)

    def worth(record: Record) -> FloatArray:
        correct = np.argmax(record.log_probs, axis=2) == batch.labels[:, None]
        return (correct + true_class_probability(record, batch))[:, 1:].mean(axis=1)

    assert (worth(ahead) >= worth(greedy) - 1e-6).all()
    assert (worth(ahead) > worth(greedy) + 1e-3).any()


def test_what_the_lookahead_imagines_is_what_happens() -> None:
    """Where the greedy path is the best there is, the lookahead must get exactly what greed gets."""
    batch = replace(episodes(), starts=PAPER.workspace.from_cells(np.tile([50, 0, 20], (EPISODES, 1))))

    def descend(viewpoint: FloatArray) -> FloatArray:
        return viewpoint[..., POLAR]

    greedy = run(Oracle(), batch, FakeRecogniser(quality=descend))
    ahead = run(OracleLookahead(horizon=5, commit=3), batch, FakeRecogniser(quality=descend))
    np.testing.assert_array_equal(
        PAPER.workspace.to_cells(greedy.viewpoints[:, :6])[..., POLAR], np.tile(np.arange(20, 26), (EPISODES, 1))
    )
    np.testing.assert_allclose(true_class_probability(ahead, batch), true_class_probability(greedy, batch), atol=1e-6)


def test_among_obstacles_of_a_stream_the_lookahead_imagines_where_its_camera_gets() -> None:
    """A wall comes nearer in each frame, as people walk towards it: moves into it have no effect, or another one."""
    moved = np.zeros((EPISODES, LENGTH, 3))
    moved[:, :, 0] = np.linspace(0, 1.5, LENGTH)
    wall = Obstacles(boxes=(Box(centre=(14.0, 0.0, 0.0), size=(1.0, 60.0, 40.0)),))
    around = Surroundings(wall, moved)
    starts = PAPER.sample_starts(np.random.default_rng(0), 99 * EPISODES)
    east = cartesian(starts)[:, 0]
    starts = starts[(east > 11) & (around.obstacles.clearance(cartesian(starts)) > 0.5)][:EPISODES]
    planner = OracleLookahead(horizon=6, commit=6)
    planned: list[FloatArray] = []

    class Keeps(OracleLookahead):
        def act(self, observation: Observation) -> FloatArray:
            target = planner.act(observation)
            if observation.frame == planner._planned_at:
                planned.append(planner._path)
            return target

        def reset(self, context: Context) -> None:
            planner.reset(context)

    world = replace(PAPER, name="own", obstacles=wall)
    context = replace(tiny_context(episodes=EPISODES, length=LENGTH), length=None, world=world)
    batch = replace(episodes(), starts=starts, surroundings=around)
    record = rollout(Keeps(), batch, FakeRecogniser(), PerfectSensor(), GridMotion(), context)
    np.testing.assert_allclose(np.concatenate(planned, axis=1), record.viewpoints[:, 1:], atol=1e-9)
    assert around.clearance(record.viewpoints, slice(None)).min() >= 0.3 - 1e-6
    assert (around.clearance(starts, LENGTH - 1) < 0).any(), "some should have to give way"


def test_a_step_costs_at_most_20_recognised_frames() -> None:
    batch, recogniser = tiny_batch(episodes=2, length=60), FakeRecogniser()
    planner = OracleLookahead()
    rollout(planner, batch, recogniser, PerfectSensor(), GridMotion(), tiny_context(episodes=2, length=60))
    assert recogniser.frames_recognised / (2 * 59) <= 1 + 20


@pytest.mark.parametrize("planner", [Oracle(), OracleLookahead(horizon=10, commit=5)])
def test_in_flight_an_oracle_heads_far_enough_to_get_somewhere(planner: Planner) -> None:
    """The fake recogniser sees more the nearer to level the camera is: the vehicle has to go there, at a pace."""
    batch = replace(episodes(), starts=PAPER.workspace.from_cells(np.tile([50, 0, 10], (EPISODES, 1))))
    vehicle = VEHICLES["tracking-drone"]
    context = replace(
        tiny_context(episodes=EPISODES, length=LENGTH), frame_time=0.1, track=vehicle.name, vehicle=vehicle
    )
    record = rollout(planner, batch, FakeRecogniser(), PerfectSensor(), FlightMotion(vehicle=vehicle), context)
    still = rollout(NoAct(), batch, FakeRecogniser(), PerfectSensor(), GridMotion(), tiny_context())
    assert (record.viewpoints[:, -1, POLAR] > batch.starts[:, POLAR] + 0.4).all()
    assert true_class_probability(record, batch).mean() > true_class_probability(still, batch).mean()


def test_in_flight_the_lookahead_crosses_a_hill_that_the_vehicle_can_cross() -> None:
    """Eight cells, half a radian, from the best view: the next move leads away from it, two seconds of flight there."""
    vehicle, length = VEHICLES["tracking-drone"], 40
    context = replace(
        tiny_context(episodes=EPISODES, length=length), frame_time=0.1, track=vehicle.name, vehicle=vehicle
    )
    batch = replace(tiny_batch(episodes=EPISODES, length=length), starts=foot_of_the_hill().starts)

    def flown(planner: Planner) -> Record:
        seen = FakeRecogniser(quality=hill)
        return rollout(planner, batch, seen, PerfectSensor(), FlightMotion(vehicle=vehicle), context)

    ahead, greedy = flown(OracleLookahead()), flown(Oracle())
    nearest = [np.abs(wrap_difference(record.viewpoints[..., AZIMUTH])).min(axis=1) for record in (ahead, greedy)]
    assert nearest[0].max() < np.radians(10) < nearest[1].min()
    assert true_class_probability(ahead, batch).mean() > true_class_probability(greedy, batch).mean() + 0.05


def test_in_flight_the_lookahead_chooses_from_the_first_frame_on_and_then_twice_a_second() -> None:
    """At 60 frames/s, where half a second has more frames than a path on the grid is followed for."""
    vehicle, length = VEHICLES["px4-auto"], 62
    context = replace(
        tiny_context(episodes=EPISODES, length=length), frame_time=1 / 60, track=vehicle.name, vehicle=vehicle
    )
    goals: list[FloatArray] = []

    class Listening(OracleLookahead):
        def act(self, observation: Observation) -> FloatArray:
            goals.append(super().act(observation).copy())
            chosen = self._flight_ends(observation.viewpoint, vehicle)
            if observation.frame in (0, 30, 60):
                assert (np.abs(chosen - goals[-1][:, None]).max(axis=2).min(axis=1) == 0).all()
            return goals[-1]

    batch = tiny_batch(episodes=EPISODES, length=length)
    rollout(Listening(), batch, FakeRecogniser(), PerfectSensor(), FlightMotion(vehicle=vehicle), context)
    changed = [frame for frame in range(1, len(goals)) if (goals[frame] != goals[frame - 1]).any()]
    assert set(changed) <= {30, 60} and changed


def test_in_a_stream_a_path_is_worth_what_each_of_its_frames_shows() -> None:
    """From the fifth frame on another class is shown. Whoever took the next frame's label for all would go wrong."""
    labels = np.where(np.arange(LENGTH) < 5, 0, 1) * np.ones((EPISODES, 1), dtype=np.int64)
    truths: list[Truth] = []

    class Watching(OracleLookahead):
        def act(self, observation: Observation) -> FloatArray:
            assert observation.truth is not None
            truths.append(observation.truth)
            return observation.viewpoint

    batch = replace(episodes(), labels=labels)
    planner = Watching()
    context = replace(tiny_context(episodes=EPISODES, length=LENGTH), length=None)
    rollout(planner, batch, FakeRecogniser(), PerfectSensor(), GridMotion(), context)
    log_probs = np.log(np.array([0.6, 0.3, 0.1])) * np.ones((EPISODES, 1, 3))
    worth = [planner._worth(log_probs, truths[0], frame)[0, 0] for frame in (4, 5)]
    np.testing.assert_allclose(worth, [1.6, 0.3])
    nothing = replace(truths[0], frame_labels=np.full((EPISODES, LENGTH), 2))  # the last class is no activity
    assert not planner._worth(log_probs, nothing, 4).any()


def test_in_a_stream_the_greedy_path_goes_by_the_label_of_each_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    labels = np.where(np.arange(LENGTH) < 5, 0, 1) * np.ones((EPISODES, 1), dtype=np.int64)
    asked: dict[int, set[int]] = {}

    def try_moves(
        truth: Truth, state: Any, frame: int, viewpoint: FloatArray, context: Context, motion: GridMotion | None
    ) -> Any:
        asked.setdefault(frame, set()).update(truth.labels.tolist())
        return made(truth, state, frame, viewpoint, context, motion)

    made = oracle.try_moves
    monkeypatch.setattr(oracle, "try_moves", try_moves)
    rollout(
        OracleLookahead(horizon=8, commit=4),
        replace(episodes(), labels=labels),
        FakeRecogniser(),
        PerfectSensor(),
        GridMotion(),
        tiny_context(episodes=EPISODES, length=LENGTH),
    )
    assert asked == {frame: {int(frame >= 5)} for frame in range(1, LENGTH)}


@pytest.mark.parametrize("planner", [Oracle(), OracleLookahead()])
def test_an_oracle_without_the_truth_says_so(planner: Planner) -> None:
    planner.reset(tiny_context(episodes=1))
    blind = Observation(
        3, 10, *[np.zeros((1, 1))] * 2, PAPER.workspace.from_cells(np.array([[5, 5, 5]])), *[np.zeros((1, 1))] * 4
    )
    with pytest.raises(EpisodeError, match=f"planner '{planner.name}', frame 3: expected the truth"):
        planner.act(blind)
