"""Searches over the gain field: what straight ways collect, and how far along them a camera is by when."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.errors import UsageError
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion
from ehar.obstacles import Cylinder, Obstacles, Surroundings
from ehar.planner import Context, Observation, Planner
from ehar.rollout import rollout
from ehar.sensors.perfect import PerfectSensor
from ehar.viewpoint import MOVES, Workspace, wrap_difference
from ehar.world import PAPER, World, load_world
from planners.search.view_search import NextBestViewGreedy, NextBestViewSearch, search_ways
from planners.value.belief.streams import StreamBeliefModel
from planners.value.situation import frame_gains
from planners.value.view_basis import BASIS_SIZE, PAPER_RANGE, field_value, mean_direction, view_basis
from planners.value.view_value import GRID, ViewValue, coarse_grid
from tests.helpers.fakes import FakeRecogniser, tiny_batch, tiny_context
from tests.helpers.gain_models import model_of, peak_weights


class Searcher(Planner):
    """Stays, and keeps what a search finds after one frame."""

    name = "searcher"

    def __init__(self, value: ViewValue, at: int) -> None:
        self.value, self.at = value, at

    def reset(self, context: Context) -> None:
        self.context = context
        self.value.reset(context)

    def act(self, observation: Observation) -> FloatArray:
        self.value.update(observation)
        if observation.frame == self.at:
            found = search_ways(self.value, observation, self.context)
            self.goals, self.collected = found.ways.goals, found.collected
            self.again = [
                search_ways(self.value, observation, self.context, plans=lambda _, goal=goal: found.places[:, :, goal])
                for goal in PLANNED
            ]
        return observation.viewpoint


PLANNED = (0, 7, 200)  # goals


def searched(
    weights: FloatArray, start: FloatArray, *, at: int, length: int, spread: float = 0.0, world: World = PAPER
) -> Searcher:
    searcher = Searcher(ViewValue(model_of(weights, spread=spread)), at)
    around = Surroundings(world.obstacles) if world.obstacles else None
    batch = replace(tiny_batch(episodes=1, length=length), starts=start[None], surroundings=around)
    context = replace(tiny_context(episodes=1, length=length), world=world)
    rollout(searcher, batch, FakeRecogniser(), PerfectSensor(), GridMotion(), context)
    return searcher


def test_goals_span_the_workspace() -> None:
    grid = coarse_grid(Workspace())
    assert grid.shape == (np.prod(GRID), 3)
    np.testing.assert_allclose(grid.min(axis=0), [5, 0, 0])
    np.testing.assert_allclose(grid.max(axis=0), [15, 2 * np.pi * 15 / 16, np.pi / 2])
    assert len(np.unique(grid.round(9), axis=0)) == len(grid)


@pytest.mark.parametrize(("at", "length"), [(0, 16), (3, 12), (12, 14)])  # up to 15 frames are left: a node each
def test_what_is_collected_is_the_field_along_the_way(at: int, length: int) -> None:
    rng = np.random.default_rng(0)
    weights, start = rng.normal(size=BASIS_SIZE), PAPER.workspace.from_cells(np.array([33, 97, 20]))
    searcher = searched(weights, start, at=at, length=length, spread=0.3)
    gains = frame_gains(at, length)
    np.testing.assert_array_equal(searcher.goals[0, 0], start)
    np.testing.assert_array_equal(searcher.goals[0, 1:], coarse_grid(Workspace()))
    for goal, collected in zip(searcher.goals[0, ::29], searcher.collected[0, ::29], strict=True):
        way = goal - start
        way[1] = wrap_difference(way[1])
        moves = np.abs(way / PAPER.workspace.step).sum()
        share = np.minimum(np.arange(1, length - at) / max(moves, 1e-9), 1)
        visited = start + share[:, None] * way
        direction = mean_direction(gains @ np.stack(view_basis(*visited.T, PAPER_RANGE, np), axis=-1))
        expected = gains @ field_value(weights, visited, PAPER_RANGE) + 0.3 * (1 - direction @ direction)
        np.testing.assert_allclose(collected, expected, atol=1e-9)


def test_views_that_are_hidden_do_not_count_as_views_that_spread() -> None:
    """A pillar hides people from one side, and is in nobody's way."""
    pillar = replace(
        PAPER, name="own", obstacles=Obstacles(cylinders=(Cylinder(centre=(1.5, 0, 0), radius=0.9, height=6),))
    )
    start = np.array([8.0, 0.3, 1.2])
    hidden = searched(np.zeros(BASIS_SIZE), start, at=1, length=20, spread=1.0, world=pillar)
    shown = searched(np.zeros(BASIS_SIZE), start, at=1, length=20, spread=1.0)
    assert hidden.value.seen(start[None], 0.0) < 0.5
    np.testing.assert_allclose(hidden.goals, shown.goals)
    behind = hidden.value.seen(hidden.goals, 0.0)[0] == 0
    assert behind.any() and not behind.all()
    assert (hidden.collected <= shown.collected + 1e-12).all()
    assert hidden.collected[0, 0] == pytest.approx(0) and hidden.collected[0, behind].max() < shown.collected.max() / 2
    start[1] += np.pi
    free = searched(np.zeros(BASIS_SIZE), start, at=1, length=20, spread=1.0, world=pillar)
    far = searched(np.zeros(BASIS_SIZE), start, at=1, length=20, spread=1.0)
    assert free.collected.max() == pytest.approx(far.collected.max(), rel=0.05), "there is enough to see elsewhere"


def test_a_plan_is_worth_what_the_same_way_is() -> None:
    pillar = replace(
        PAPER, name="own", obstacles=Obstacles(cylinders=(Cylinder(centre=(1.5, 0, 0), radius=0.9, height=6),))
    )
    weights = np.random.default_rng(3).normal(size=BASIS_SIZE)
    searcher = searched(weights, np.array([8.0, 0.3, 1.2]), at=1, length=20, spread=1.0, world=pillar)
    for goal, again in zip(PLANNED, searcher.again, strict=True):
        assert again.planned is not None
        assert again.planned[0] == pytest.approx(searcher.collected[0, goal], abs=1e-12)
        np.testing.assert_allclose(again.collected, searcher.collected, atol=1e-12)


def test_to_stay_collects_the_field_where_one_is() -> None:
    weights, start = np.random.default_rng(1).normal(size=BASIS_SIZE), PAPER.workspace.from_cells(np.array([10, 5, 20]))
    for length in (2, 10, 60):
        searcher = searched(weights, start, at=0, length=length)
        np.testing.assert_allclose(searcher.collected[0, 0], field_value(weights, start, PAPER_RANGE), atol=1e-9)


@pytest.mark.parametrize("vehicle", [None, VEHICLES["px4-auto"]])
def test_greedy_takes_the_best_neighbour(vehicle: object) -> None:
    rng = np.random.default_rng(2)
    weights, workspace = rng.normal(size=BASIS_SIZE), Workspace()
    planner = NextBestViewGreedy(model=model_of(weights))
    batch = tiny_batch(episodes=7, length=2)
    context = replace(tiny_context(episodes=7, length=2), vehicle=vehicle)
    targets: list[FloatArray] = []
    act = planner.act
    planner.act = lambda observation: targets.append(act(observation)) or targets[-1]  # type: ignore[method-assign,func-returns-value]
    rollout(planner, batch, FakeRecogniser(), PerfectSensor(), GridMotion(), context)
    for start, target in zip(batch.starts, targets[0], strict=True):
        # The vehicle could go 5 m, or turn by 5 m seen from where it is, but by no more than 45 degrees, in a second.
        pace = PAPER.workspace.step if vehicle is None else np.array([5.0, min(5 / start[0], np.pi / 4), 5 / start[0]])
        values = field_value(weights, workspace.clip(start + MOVES * pace), PAPER_RANGE)
        np.testing.assert_allclose(target, workspace.clip(start + MOVES[np.argmax(values)] * pace), atol=1e-12)


def test_greedy_stays_at_the_peak() -> None:
    peak = PAPER.workspace.from_cells(np.array([33, 0, 20]))
    planner = NextBestViewGreedy(model=model_of(peak_weights(peak)))
    batch = replace(tiny_batch(episodes=1, length=5), starts=peak[None])
    viewpoints = rollout(
        planner, batch, FakeRecogniser(), PerfectSensor(), GridMotion(), tiny_context(episodes=1, length=5)
    ).viewpoints
    np.testing.assert_array_equal(viewpoints[0], np.tile(peak, (5, 1)))


def test_where_all_views_are_alike_no_camera_moves_in_a_room() -> None:
    """In a stream cells are large there, and few of them are free as a whole."""
    world, streams, frames = load_world("room"), 40, 12
    batch = tiny_batch(episodes=streams, length=frames)
    batch = replace(
        batch,
        labels=np.repeat(batch.labels[:, None], frames, axis=1),
        starts=world.sample_starts(np.random.default_rng(0), streams),
        surroundings=Surroundings(world.obstacles, np.zeros((streams, frames, 3))),
    )
    context = replace(tiny_context(episodes=streams), length=None, world=world, workspace=world.workspace)
    model = replace(model_of(np.zeros(BASIS_SIZE)), belief=StreamBeliefModel.believing((1 / 3, 1 / 3, 1 / 3)))
    planner = NextBestViewSearch(model=model)
    motion = GridMotion(workspace=world.workspace)
    found = rollout(planner, batch, FakeRecogniser(), PerfectSensor(), motion, context).viewpoints
    np.testing.assert_array_equal(found, np.repeat(found[:, :1], frames, axis=1))


def test_a_search_is_made_every_frame_or_more_rarely() -> None:
    with pytest.raises(UsageError, match=r"^nbv-search: expected .* every 1 frame or more, got 0$"):
        NextBestViewSearch(model=model_of(np.zeros(BASIS_SIZE)), replan=0)
