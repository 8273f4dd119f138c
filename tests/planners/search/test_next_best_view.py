"""The planners over gain fields: they find a known best view, stay where there is none, and answer for themselves."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cloudpickle
import numpy as np
import pytest

from ehar.batch import Batch
from ehar.conditions import Conditions
from ehar.data.scenario import part_of
from ehar.data.streams.data import StreamData
from ehar.data.streams.scenario import StreamScenarios
from ehar.errors import EpisodeError, UsageError
from ehar.flight.costs import FlightCosts
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion, Motion
from ehar.planner import Context, Observation, Planner, Truth
from ehar.processes import payload
from ehar.rollout import Record, rollout
from ehar.sensors.perfect import PerfectSensor
from ehar.sensors.sensor import SensorNoise
from ehar.viewpoint import Workspace, wrap_difference
from ehar.world import PAPER, load_world
from planners.search import next_best_view
from planners.search.next_best_view import NextBestView
from planners.search.scene import SceneSize
from planners.search.solver import Solution, SolveStatus, TrajectorySolver
from planners.search.task import TrajectoryTask
from planners.search.view_search import NextBestViewGreedy, NextBestViewSearch
from planners.value.belief.clips import BeliefModel
from planners.value.field import GainField
from planners.value.model import FULL, GainModel, load_gain_model
from planners.value.view_basis import BASIS_SIZE
from recognition.setting import load_setting
from tests.helpers.fakes import FakeRecogniser, tiny_batch, tiny_context
from tests.helpers.gain_models import PAIRS, model_of, peak_weights, random_field

PLANNERS: list[Callable[..., Planner]] = [NextBestView, NextBestViewSearch, NextBestViewGreedy]
WORKSPACE = Workspace()
PEAK = np.array([5 + 10 / 3, np.pi / 4, 0.3 * np.pi])  # one of the goals that nbv-search chooses from
EVERYWHERE = np.array([[10, 20, 20], [40, 90, 5], [60, 12, 25], [33, 30, 15]])  # cells up to 51 moves away from it


def run(planner: Planner, batch: Batch, *, motion: Motion | None = None, **changes: Any) -> Record:
    episodes, length = batch.positions.shape[:2]
    context = replace(tiny_context(episodes=episodes, length=length), **changes)
    return rollout(planner, batch, FakeRecogniser(), PerfectSensor(), motion or GridMotion(), context)


def starting(cells: Any, *, length: int = 60) -> Batch:
    """Return episodes from start cells (B, 3)."""
    batch = tiny_batch(episodes=len(cells), length=length)
    return replace(batch, starts=PAPER.workspace.from_cells(np.array(cells)))


def part(batch: Batch, row: int) -> Batch:
    """Return one episode of a batch, as a batch."""
    inside = slice(row, row + 1)
    noise = SensorNoise(*(draws[inside] for draws in batch.noise))
    return Batch(batch.positions[inside], batch.labels[inside], batch.starts[inside], noise, batch.names[inside])


def cells_off(viewpoint: np.ndarray, peak: np.ndarray) -> np.ndarray:
    """Return how many cells viewpoints (..., 3) are off, along each axis."""
    way = viewpoint - peak
    way[..., 1] = wrap_difference(way[..., 1])
    return np.abs(way / PAPER.workspace.step)


def situated_model() -> GainModel:
    """Return a model that depends on all that is known of the tiny data."""
    field = random_field(np.random.default_rng(0), persons=1)
    without_last = [*range(1 + 1 + 9 + 3), *range(15, 15 + 3 + 5)]  # the fake's embedding has 3 numbers, not 4
    field = GainField(field.parts, field.absolute[without_last] / 9, field.relative[without_last] / 9, 0.1)
    return GainModel({FULL: field}, BeliefModel(), PAIRS)


@pytest.mark.parametrize("make", PLANNERS)
def test_the_camera_ends_at_the_best_view(make: Callable[..., Planner]) -> None:
    viewpoints = run(make(model=model_of(peak_weights(PEAK))), starting(EVERYWHERE)).viewpoints
    assert cells_off(viewpoints[:, 0], PEAK).max(axis=1).min() > 8
    assert cells_off(viewpoints[:, -1], PEAK).max() <= 2.5


@pytest.mark.parametrize("options", [{"max_iterations": 6}, {"solver": "ipopt"}, {"replan": 1}, {"replan": 25}])
def test_so_it_does_with_every_way_to_solve_and_period(options: dict[str, Any]) -> None:
    planner = NextBestView(model=model_of(peak_weights(PEAK)), **options)
    viewpoints = run(planner, starting(EVERYWHERE[:2])).viewpoints
    assert cells_off(viewpoints[:, -1], PEAK).max() <= 2.5
    assert planner.statistics.fallbacks == 0
    assert planner.statistics.violation <= (1e-3 if "max_iterations" in options else 1e-6)


@pytest.mark.parametrize("make", PLANNERS)
@pytest.mark.parametrize("start", [90, 8])
def test_the_short_way_leads_across_azimuth_0(make: Callable[..., Planner], start: int) -> None:
    # Both ways lead across the azimuths where cells are counted from anew.
    end = (98 - start) % 100  # 90 -> 8, 8 -> 90
    peak = PAPER.workspace.from_cells(np.array([33, end, 20]))
    azimuth = PAPER.workspace.to_cells(
        run(make(model=model_of(peak_weights(peak, 3.0))), starting([[33, start, 20]])).viewpoints
    )[0, :, 1]
    way = np.cumsum((np.diff(azimuth) + 50) % 100 - 50) * (1 if start == 90 else -1)
    assert way[-1] >= 13
    assert way.min() >= 0


@pytest.mark.parametrize("make", PLANNERS)
def test_straight_above_is_reached_without_a_turn(make: Callable[..., Planner]) -> None:
    peak = np.array([25 / 3, 0.0, 0.0])
    cells = PAPER.workspace.to_cells(
        run(make(model=model_of(peak_weights(peak))), starting([[33, 70, 20], [33, 3, 12]])).viewpoints
    )
    assert (cells[:, -1, 2] <= 1).all()
    turned = (cells[:, :, 1] - cells[:, :1, 1] + 50) % 100 - 50
    if make is not NextBestViewSearch:  # of whose goals straight above only one lies straight ahead
        assert np.abs(turned).max() <= 1


@pytest.mark.parametrize("make", PLANNERS)
def test_a_flat_field_is_no_reason_to_move(make: Callable[..., Planner]) -> None:
    constant = np.eye(BASIS_SIZE)[0]
    batch = starting(EVERYWHERE, length=20)
    for weights in (0 * constant, constant):
        viewpoints = run(make(model=model_of(weights)), batch).viewpoints
        np.testing.assert_array_equal(viewpoints, np.repeat(viewpoints[:, :1], 20, axis=1))


@pytest.mark.parametrize("make", [NextBestView, NextBestViewSearch])
def test_a_good_view_near_by_is_left_for_a_better_one_behind_worse_ones(make: Callable[..., Planner]) -> None:
    weights = np.zeros(BASIS_SIZE)
    weights[15], weights[3] = 1.0, 1.0  # cos(3 azimuth) and cos(azimuth): peaks at 0, and lower at a third of a turn
    start = [33, 33, 25]
    cells = PAPER.workspace.to_cells(run(make(model=model_of(weights)), starting([start], length=100)).viewpoints)[0]
    assert abs((cells[-1, 1] + 50) % 100 - 50) <= 2
    greedy = NextBestViewGreedy(model=model_of(weights))
    assert abs(PAPER.workspace.to_cells(run(greedy, starting([start], length=100)).viewpoints)[0, -1, 1] - 33) <= 5


def test_views_that_spread_are_worth_a_move_where_the_field_is_flat() -> None:
    batch = starting([[33, 30, 22]], length=40)
    for make in (NextBestView, NextBestViewSearch):
        viewpoints = run(make(model=model_of(np.zeros(BASIS_SIZE), spread=1.0)), batch).viewpoints
        assert np.abs(np.diff(PAPER.workspace.to_cells(viewpoints), axis=1)).sum() > 15


@pytest.mark.parametrize("horizon", [1, 4, 30, 100])
def test_any_horizon_moves_in_an_episode_of_any_length(horizon: int) -> None:
    planner = NextBestView(model=model_of(peak_weights(PEAK)), horizon=horizon)
    for length in (1, 2, 3, 20):
        viewpoints = run(planner, starting(EVERYWHERE[:2], length=length)).viewpoints
        assert planner.statistics.fallbacks == 0
    before, after = cells_off(viewpoints[:, 0], PEAK).sum(axis=1), cells_off(viewpoints[:, -1], PEAK).sum(axis=1)
    assert (after < before - 3).all()


def test_effort_is_traded_for_gain_and_too_much_of_it_for_nothing() -> None:
    moves = []
    for weight in (0.0, 0.3, 3.0, 1e6):
        planner = NextBestView(model=model_of(peak_weights(PEAK)), effort_weight=weight)
        cells = PAPER.workspace.to_cells(run(planner, starting(EVERYWHERE)).viewpoints)
        moves.append(np.any(np.diff(cells, axis=1) != 0, axis=2).sum())
    assert moves[0] > moves[1] > moves[2] > moves[3] == 0


def not_finite(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the field of the second of four episodes one that is not finite."""
    weights = GainField.weights
    second = np.arange(4)[:, None] == 1
    monkeypatch.setattr(GainField, "weights", lambda *arguments: np.where(second, np.nan, weights(*arguments)))


def test_a_field_that_is_not_finite_holds_the_camera_and_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    planner = NextBestView(model=model_of(peak_weights(PEAK)))
    not_finite(monkeypatch)
    viewpoints = run(planner, starting(EVERYWHERE)).viewpoints
    np.testing.assert_array_equal(viewpoints[1], np.repeat(viewpoints[1, :1], 60, axis=0))
    assert cells_off(viewpoints[[0, 2, 3], -1], PEAK).max() <= 2.5
    plans = len(range(0, 59, planner.replan))
    assert planner.statistics.counts == {SolveStatus.NAN_FIELD: plans, SolveStatus.OPTIMAL: 3 * plans}
    assert planner.statistics.fallbacks == plans


@pytest.mark.parametrize("make", [NextBestViewSearch, NextBestViewGreedy])
def test_a_search_over_a_field_that_is_not_finite_says_so(
    make: Callable[..., Planner], monkeypatch: pytest.MonkeyPatch
) -> None:
    not_finite(monkeypatch)
    planner = make(model=model_of(peak_weights(PEAK)))
    with pytest.raises(EpisodeError, match=f"^planner '{planner.name}', episode 1 of the batch, frame 0: .* got NaN"):
        run(planner, starting(EVERYWHERE))


def test_a_plan_is_made_every_so_often_and_counted_since_the_reset() -> None:
    planner = NextBestView(model=model_of(peak_weights(PEAK)), replan=5)
    assert planner.statistics.counts.total() == 0
    for _ in range(2):
        run(planner, starting(EVERYWHERE[:2], length=17))
        assert planner.statistics.counts.total() == 2 * 4  # after frames 0, 5, 10, 15
    assert len(planner.statistics.plan_seconds) == 8
    assert planner.statistics.violation <= 1e-6


def test_a_planner_that_has_planned_can_be_sent_and_problems_are_built_once(monkeypatch: pytest.MonkeyPatch) -> None:
    batch = starting(EVERYWHERE[:2], length=17)
    planner = NextBestView(model=model_of(peak_weights(PEAK)))
    first = run(planner, batch)
    counted = planner.statistics.counts.total()

    def refuse(**_: Any) -> None:
        raise AssertionError("expected no problem to be built: this process has it")

    monkeypatch.setattr(next_best_view, "TrajectorySolver", refuse)
    sent = cloudpickle.loads(payload(planner, "nbv"))
    np.testing.assert_array_equal(run(sent, batch).viewpoints, first.viewpoints)
    assert planner.statistics.counts.total() == sent.statistics.counts.total() == counted


def test_in_the_open_nothing_is_left_of_a_room_before(monkeypatch: pytest.MonkeyPatch) -> None:
    planner, room, asked = NextBestView(model=model_of(peak_weights(PEAK))), load_world("room"), list[bool]()
    made = next_best_view._solver_of

    def solver_of(*problem: Any) -> TrajectorySolver:
        asked.append(any(isinstance(part, SceneSize) for part in problem))
        return made(*problem)

    monkeypatch.setattr(next_best_view, "_solver_of", solver_of)
    batch = replace(starting(EVERYWHERE[:1], length=2), starts=room.sample_starts(np.random.default_rng(0), 1))
    run(planner, batch, motion=GridMotion(workspace=room.workspace), workspace=room.workspace, world=room)
    assert asked and all(asked)
    asked.clear()
    planner.reset(tiny_context())
    assert asked == [False]


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("horizon", 0),
        ("replan", 0),
        ("replan", -3),
        ("max_iterations", 0),
        ("effort_weight", -0.1),
        ("effort_weight", float("nan")),
        ("effort_weight", float("inf")),
        ("energy_weight", -1.0),
        ("noise_weight", float("nan")),
        ("distance_weight", -0.5),
        ("horizon", 2.5),
        ("replan", float("nan")),
    ],
)
def test_numbers_that_make_no_sense(option: str, value: Any) -> None:
    with pytest.raises(UsageError, match=rf"^nbv: expected .*{option}.* at least \d, got {value}"):
        NextBestView(model=model_of(peak_weights(PEAK)), **{option: value})


def test_an_unknown_solver() -> None:
    with pytest.raises(UsageError, match=r"^nbv: expected the solver fatrop or ipopt, got 'snopt'"):
        NextBestView(model=model_of(peak_weights(PEAK)), solver="snopt")  # type: ignore[arg-type]


def test_a_plan_that_takes_several_tries_is_counted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where none begins at the state that the camera has, the next begins at one near it."""
    solve = TrajectorySolver.solve_best
    tries = []

    def first_fails(self: TrajectorySolver, task: TrajectoryTask, *told: Any) -> Solution:
        solution = solve(self, task, *told)
        tries.append(solution.seconds)
        return solution if len(tries) % 2 == 0 else replace(solution, status=SolveStatus.INFEASIBLE)

    monkeypatch.setattr(TrajectorySolver, "solve_best", first_fails)
    monkeypatch.setattr(next_best_view, "_starts", lambda previous, elapsed, task: [task, task])
    planner, vehicle = NextBestView(model=model_of(peak_weights(PEAK))), VEHICLES["px4-auto"]
    motion = FlightMotion(vehicle=vehicle)
    run(planner, starting(EVERYWHERE[:1], length=22), motion=motion, track=vehicle.name, vehicle=vehicle)
    assert len(tries) == 6
    assert planner.statistics.counts == {SolveStatus.OPTIMAL: 3} and planner.statistics.fallbacks == 0
    np.testing.assert_allclose(planner.statistics.plan_seconds, np.reshape(tries, (3, 2)).sum(axis=1))
    assert len(planner.statistics.solve_seconds) >= 6


@pytest.mark.parametrize("make", PLANNERS)
def test_an_episode_s_views_do_not_depend_on_its_neighbours(make: Callable[..., Planner]) -> None:
    batch = tiny_batch(episodes=7, length=14)
    planner = make(model=situated_model())
    together = run(planner, batch).viewpoints
    assert len({tuple(row) for row in PAPER.workspace.to_cells(together[:, -1]).tolist()}) == 7
    for row in range(7):
        np.testing.assert_allclose(run(planner, part(batch, row)).viewpoints[0], together[row], atol=1e-9)


@pytest.mark.parametrize("make", PLANNERS)
def test_the_same_episodes_give_the_same_views(make: Callable[..., Planner]) -> None:
    planner, batch = make(model=situated_model()), tiny_batch(length=14)
    first = run(planner, batch)
    run(planner, tiny_batch(length=14, seed=1))  # which is forgotten
    for again in (run(planner, batch), run(make(model=situated_model()), batch)):
        np.testing.assert_array_equal(again.viewpoints, first.viewpoints)
    assert not np.array_equal(first.viewpoints[:, 0], first.viewpoints[:, -1])


class Told:
    """Tells a planner the truth, which it has not asked for."""

    privileged = True

    def __init__(self, planner: Planner, lie: bool) -> None:
        self.planner, self.name, self.lie = planner, planner.name, lie

    def reset(self, context: Context) -> None:
        self.planner.reset(context)

    def act(self, observation: Observation) -> np.ndarray:
        truth = observation.truth
        assert truth is not None
        lie = Truth((truth.labels + 1) % 3, truth.recogniser, truth.state, truth.sense, truth.frame_labels)
        return self.planner.act(replace(observation, truth=lie if self.lie else None))


@pytest.mark.parametrize("make", PLANNERS)
def test_the_truth_does_not_matter(make: Callable[..., Planner]) -> None:
    planner, batch = make(model=situated_model()), tiny_batch(length=14)
    assert not planner.privileged
    honest, lied_to = (run(Told(planner, lie), batch).viewpoints for lie in (False, True))
    np.testing.assert_array_equal(honest, lied_to)


class Watched:
    """Keeps a planner's targets."""

    privileged = False

    def __init__(self, planner: Planner) -> None:
        self.planner, self.name = planner, planner.name
        self.targets: list[np.ndarray] = []

    def reset(self, context: Context) -> None:
        self.planner.reset(context)

    def act(self, observation: Observation) -> np.ndarray:
        self.targets.append(self.planner.act(observation).copy())
        return self.targets[-1]


@pytest.mark.parametrize("make", PLANNERS)
def test_targets_lie_in_the_workspace(make: Callable[..., Planner]) -> None:
    corners = [[0, 0, 0], [100, 99, 25], [0, 50, 25], [100, 20, 0]]
    for corner in corners:
        watched = Watched(make(model=model_of(peak_weights(PAPER.workspace.from_cells(np.array(corner))))))
        run(watched, starting(corners, length=20))
        assert WORKSPACE.contains(np.array(watched.targets), tolerance=1e-5).all()


@pytest.mark.parametrize("make", PLANNERS)
def test_a_vehicle_flies_towards_the_best_view(make: Callable[..., Planner]) -> None:
    vehicle = VEHICLES["px4-auto"]
    planner = make(model=model_of(peak_weights(PEAK)))
    watched = Watched(planner)
    batch = starting([[33, 2, 15], [33, 12, 24]], length=100)  # 4 s, 10 cells away
    viewpoints = run(
        watched, batch, motion=FlightMotion(vehicle=vehicle), track=vehicle.name, vehicle=vehicle
    ).viewpoints
    assert WORKSPACE.contains(np.array(watched.targets), tolerance=1e-5).all()
    before, after = (cells_off(viewpoints[:, frame], PEAK).max(axis=1) for frame in (0, -1))
    assert (after < 0.7 * before).all()
    if isinstance(planner, NextBestView):
        nearest = np.min([cells_off(viewpoints[:, frame], PEAK).max(axis=1) for frame in range(100)], axis=0)
        assert (nearest < 4).all()  # the last views of a clip hardly count
        assert planner.statistics.fallbacks == 0
        assert planner.statistics.counts.total() == 2 * len(range(0, 99, planner.replan))


@pytest.mark.parametrize("name", ["px4-auto", "tracking-drone"])
def test_what_is_planned_is_what_is_flown(name: str) -> None:
    """A motion that follows paths gets the plans themselves, and stays on them."""
    vehicle, motion = VEHICLES[name], FlightMotion(vehicle=VEHICLES[name])
    planner = NextBestView(model=model_of(peak_weights(PEAK)))
    watched = Watched(planner)
    batch = starting([[33, 2, 15], [33, 12, 24], [10, 20, 20]], length=100)
    viewpoints = run(watched, batch, motion=motion, track=name, vehicle=vehicle, follows=True).viewpoints
    assert all(target.shape[2:] == (3, 3) and not target[:, -1, 1:].any() for target in watched.targets)
    error = motion.telemetry.tracking_error
    assert np.median(error) < 1e-6 and np.percentile(error, 95) < 0.2
    assert planner.statistics.fallbacks == 0
    assert (cells_off(viewpoints[:2, -1], PEAK) < 3).all()
    assert (motion.telemetry.peak_jerk <= vehicle.jerk).all()


def test_a_flight_that_no_plan_continues_goes_on_from_a_little_slower(monkeypatch: pytest.MonkeyPatch) -> None:
    solve, refused, begun = TrajectorySolver.solve_best, [False], [np.zeros(3)]

    def refusing(solver: TrajectorySolver, task: TrajectoryTask, *told: Any) -> Solution:
        """Refuse the first try of each plan of a camera that moves."""
        refused.append(bool(task.velocity.any()) and not refused[-1])
        begun.append(task.position)
        solution = solve(solver, task, *told)
        return replace(solution, trajectory=task.hold(), status=SolveStatus.INFEASIBLE) if refused[-1] else solution

    monkeypatch.setattr(TrajectorySolver, "solve_best", refusing)
    motion = FlightMotion(vehicle=VEHICLES["tracking-drone"])
    told = {"track": "tracking-drone", "vehicle": motion.vehicle, "follows": True}
    batch = starting([[33, 2, 15]], length=100)
    run(NextBestView(model=model_of(peak_weights(PEAK))), batch, motion=motion, **told)
    again = np.flatnonzero(refused) + 1
    assert len(again) >= 5
    for one in again:
        np.testing.assert_array_equal(begun[one], begun[one - 1])  # at once, and not after it has braked


def test_a_workspace_of_one_polar_angle_is_flown_in_without_a_word(capfd: pytest.CaptureFixture[str]) -> None:
    def flight(workspace: Workspace) -> np.ndarray:
        vehicle, planner = VEHICLES["px4-auto"], NextBestView(model=model_of(peak_weights(PEAK)))
        batch = replace(starting([[33, 2, 15]]), starts=np.array([[8.0, 0.5, WORKSPACE.polar_max]]))
        motion = FlightMotion(vehicle=vehicle, workspace=workspace)
        told = {"track": vehicle.name, "vehicle": vehicle, "follows": True, "workspace": workspace}
        viewpoints = run(planner, batch, motion=motion, **told).viewpoints
        assert planner.statistics.fallbacks == 0
        return viewpoints

    before = flight(WORKSPACE)
    level = flight(replace(WORKSPACE, polar_min=WORKSPACE.polar_max))
    assert np.ptp(level[..., 1]) > 0.1
    assert capfd.readouterr() == ("", "")  # CasADi warns of problems with more equations than variables
    np.testing.assert_array_equal(flight(WORKSPACE), before)  # the solver is the same one


def test_in_streams_flights_are_planned_for_three_seconds() -> None:
    setting = load_setting(Conditions(data="solo-stream", sensor="estimator", track="px4-auto"))
    data = setting.recordings
    assert isinstance(data, StreamData)
    model = load_gain_model(setting.conditions, data, setting.recogniser_sha256)
    watched, nobody = Watched(NextBestView(model=model)), np.zeros(1, dtype=np.int64)
    windows = StreamScenarios(data, 3, part_of(data, "test")[:1], nobody)
    batch = setting.runner.batch(
        windows, nobody, PAPER.sample_starts(np.random.default_rng(0), 1), np.random.default_rng(1)
    )
    setting.runner.roll(watched, batch, np.random.default_rng(2))
    assert watched.targets[0].shape == (1, 3 * 60, 3, 3)  # at 60 frames/s


def costs_of_flights(**weights: float) -> FlightCosts:
    """Return what flights of nbv with some weights cost."""
    vehicle = VEHICLES["px4-auto"]
    motion, planner = FlightMotion(vehicle=vehicle), NextBestView(model=model_of(peak_weights(PEAK)), **weights)
    batch = starting([[33, 2, 15], [33, 12, 24]], length=40)
    run(planner, batch, motion=motion, track=vehicle.name, vehicle=vehicle, follows=True)
    assert planner.statistics.fallbacks == 0
    assert motion.telemetry.costs is not None
    return motion.telemetry.costs


def test_energy_noise_and_distance_are_traded_for_gain() -> None:
    free, saving = costs_of_flights(), costs_of_flights(energy_weight=1.0)
    quiet, short = costs_of_flights(noise_weight=0.4), costs_of_flights(distance_weight=0.1)
    assert free.energy is not None and saving.energy is not None and free.noise is not None and quiet.noise is not None
    assert (saving.energy < free.energy - 50).all()  # [J]
    assert (quiet.noise < free.noise - 0.5).all()  # [dB]
    assert (short.distance < free.distance - 1).all()  # [m]


@pytest.mark.parametrize("track", ["ideal", "ground-robot"])
def test_what_flights_cost_needs_a_vehicle_with_a_body(track: str) -> None:
    planner = NextBestView(model=model_of(peak_weights(PEAK)), noise_weight=0.1)
    context = replace(tiny_context(), track=track, vehicle=VEHICLES.get(track))
    with pytest.raises(UsageError, match=f"^nbv: expected a vehicle with a body .*, got the track '{track}'"):
        planner.reset(context)
