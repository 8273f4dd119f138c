"""What every planner must do, over all of the registry."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion
from ehar.planner import Context, Observation
from ehar.rollout import Record, rollout
from ehar.sensors.perfect import PerfectSensor
from ehar.viewpoint import MOVES, Workspace, wrap_difference
from planners.registry import is_privileged, make_planner, planner_names
from tests.helpers.agents import untrained_agent
from tests.helpers.fakes import CLASS_NAMES, FakeRecogniser, tiny_batch, tiny_context
from tests.helpers.fixed_places import fixed_place
from tests.helpers.gain_models import model_of, peak_weights

PAPER = Workspace()
PRIVILEGED = ("oracle", "oracle-lookahead")
FAR_SIGHTED = (
    "near-level",
    "side",
    "front",
    "fixed-best",
    "nbv-search",
    "nbv",
)  # head for more than a neighbouring cell
NAMES = (*planner_names(), "il-ppo-no-recognition", "il-ppo-no-vision", "il-ppo-no-position")
SINGLE_MOVES = tuple(name for name in NAMES if name not in FAR_SIGHTED)


class Spy:
    """Passes everything on to a planner, and keeps what it was shown and what it answered."""

    def __init__(self, name: str) -> None:
        model = model_of(peak_weights(np.array([8.0, 1.0, 1.2])))
        self.planner = make_planner(name, lambda: model, untrained_agent, fixed_place)
        self.name = self.planner.name
        self.privileged = self.planner.privileged
        self.observations: list[Observation] = []
        self.targets: list[FloatArray] = []

    def reset(self, context: Context) -> None:
        self.planner.reset(context)

    def act(self, observation: Observation) -> FloatArray:
        before = observation.viewpoint.copy()
        target = self.planner.act(observation)
        np.testing.assert_array_equal(observation.viewpoint, before)
        self.observations.append(observation)
        self.targets.append(np.array(target))
        return target


def run(planner: Spy, *, length: int = 12, seed: int = 0) -> Record:
    batch = tiny_batch(episodes=7, length=length)
    corners = PAPER.from_cells(np.array([[0, 0, 0], [100, 99, 25], [0, 50, 25]]))
    batch = replace(batch, starts=np.concatenate([corners, batch.starts[3:]]))
    context = tiny_context(episodes=7, length=length, seed=seed)
    return rollout(planner, batch, FakeRecogniser(), PerfectSensor(), GridMotion(), context)


@pytest.mark.parametrize("name", SINGLE_MOVES)
def test_targets_are_finite_neighbouring_cells_inside_the_workspace(name: str) -> None:
    spy = Spy(name)
    run(spy)
    assert len(spy.targets) == 11, "a planner acts after every frame but the last"
    for observation, target in zip(spy.observations, spy.targets, strict=True):
        assert target.shape == (7, 3)
        assert np.isfinite(target).all()
        assert PAPER.contains(target).all()
        steps = (target - observation.viewpoint) / PAPER.step
        steps[:, 1] = wrap_difference(target[:, 1] - observation.viewpoint[:, 1]) / PAPER.step[1]
        for step in np.rint(steps).astype(int).tolist():
            assert step in MOVES.tolist()


@pytest.mark.parametrize("name", FAR_SIGHTED)
def test_targets_are_finite_and_inside_the_workspace(name: str) -> None:
    spy = Spy(name)
    run(spy)
    assert len(spy.targets) == 11
    for target in spy.targets:
        assert target.shape == (7, 3)
        assert np.isfinite(target).all()
        assert PAPER.contains(target, tolerance=1e-6).all()


@pytest.mark.parametrize("name", NAMES)
def test_every_planner_flies_and_keeps_the_vehicle_s_limits(name: str) -> None:
    vehicle = VEHICLES["px4-max"]
    motion, context = FlightMotion(vehicle=vehicle), tiny_context(episodes=7, length=12)
    context = replace(context, frame_time=0.1, track=vehicle.name, vehicle=vehicle)
    record = rollout(Spy(name), tiny_batch(episodes=7, length=12), FakeRecogniser(), PerfectSensor(), motion, context)
    assert PAPER.contains(record.viewpoints).all()
    assert (motion.telemetry.peak_speed <= vehicle.speed * (1 + 1e-6)).all()
    assert (motion.telemetry.peak_jerk <= vehicle.jerk * (1 + 1e-6)).all()
    assert (motion.telemetry.peak_speed.max() > 0.1) == (name != "no-act")


@pytest.mark.parametrize("name", SINGLE_MOVES)
def test_the_camera_gets_where_the_planner_wants_it(name: str) -> None:
    spy = Spy(name)
    viewpoints = run(spy).viewpoints
    for frame, target in enumerate(spy.targets):
        np.testing.assert_array_equal(PAPER.to_cells(viewpoints[:, frame + 1]), PAPER.to_cells(target))


@pytest.mark.parametrize("name", NAMES)
def test_the_truth_is_for_privileged_planners_only(name: str) -> None:
    spy = Spy(name)
    assert spy.privileged == is_privileged(name) == (name in PRIVILEGED)
    run(spy)
    for observation in spy.observations:
        assert (observation.truth is not None) == spy.privileged


@pytest.mark.parametrize("name", NAMES)
def test_observations_are_what_the_contract_says(name: str) -> None:
    spy = Spy(name)
    run(spy)
    for frame, observation in enumerate(spy.observations):
        assert observation.frame == frame
        assert observation.ratio == pytest.approx((frame + 1) / 12)
        assert observation.joints_2d.shape == (7, 1, 6, 2)
        assert observation.confidence.shape == (7, 1, 6)
        assert observation.log_probs.shape == (7, len(CLASS_NAMES))
        assert observation.embedding.shape == (7, FakeRecogniser.embedding_size)


@pytest.mark.parametrize("name", NAMES)
def test_the_same_episodes_and_generator_give_the_same_and_a_planner_can_be_used_again(name: str) -> None:
    spy = Spy(name)
    once, again = run(spy), run(spy)
    np.testing.assert_array_equal(once.viewpoints, again.viewpoints)
    np.testing.assert_array_equal(once.log_probs, again.log_probs)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("length", [1, 2, 3])
def test_short_episodes(name: str, length: int) -> None:
    assert run(Spy(name), length=length).viewpoints.shape == (7, length, 3)


@pytest.mark.parametrize(("name", "axis", "sign"), [("towards", 0, -1), ("h-rotate", 1, 1), ("v-rotate", 2, 1)])
def test_the_paper_s_directions(name: str, axis: int, sign: int) -> None:
    viewpoints = run(Spy(name)).viewpoints[3:]  # the first three start in corners
    cells = PAPER.to_cells(viewpoints)
    change = np.diff(cells, axis=1)
    change[..., 1] = (change[..., 1] + 50) % 100 - 50
    others = np.delete(change, axis, axis=2)
    assert (others == 0).all()
    bound = {0: 0, 1: -1, 2: 25}[axis]
    expected = np.where(cells[:, :-1, axis] == bound, 0, sign)
    np.testing.assert_array_equal(change[..., axis], expected)


def test_no_act_stays() -> None:
    viewpoints = run(Spy("no-act")).viewpoints
    np.testing.assert_array_equal(viewpoints, np.repeat(viewpoints[:, :1], 12, axis=1))


def test_random_makes_all_seven_moves_equally_often_and_by_its_generator() -> None:
    context = tiny_context(episodes=7000)
    spy = Spy("random")
    spy.reset(context)
    viewpoint = PAPER.from_cells(np.tile([50, 50, 12], (7000, 1)))
    shown = Observation(0, 10, *[np.zeros((7000, 1))] * 2, viewpoint, *[np.zeros((7000, 1))] * 4)
    steps = PAPER.to_cells(spy.act(shown)) - [50, 50, 12]
    counts = [int((steps == move).all(axis=1).sum()) for move in MOVES]
    assert sum(counts) == 7000
    np.testing.assert_allclose(counts, 1000, atol=150)
    assert not np.array_equal(run(Spy("random"), seed=0).viewpoints, run(Spy("random"), seed=1).viewpoints)
