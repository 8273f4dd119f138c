"""Ways to goals: straight in the open, around obstacles where something stands, and as long as they are."""

from dataclasses import replace

import numpy as np
import pytest

from ehar import Workspace
from ehar.obstacles import Box, Cylinder, FreeSpace, Obstacles
from ehar.world import PAPER
from planners.search.ways import NEVER, Ways, free_spaces
from planners.value.view_value import coarse_grid
from tests.helpers.agents import random_observation
from tests.helpers.fakes import tiny_context

SPACE = Workspace(distance_max=9.0, polar_min=0.9, distance_step=0.2)
PILLARS = Obstacles(
    cylinders=tuple(Cylinder(centre=(7 * np.cos(a), 7 * np.sin(a), 0), radius=0.8, height=30) for a in (0.3, 2.0, 4.4))
)
FREE = FreeSpace.of(SPACE, PILLARS)
HERE = SPACE.from_cells(np.array([[10, 0, 9], [2, 60, 3]]))
GOALS = np.broadcast_to(coarse_grid(SPACE), (2, 384, 3))


def test_in_the_open_all_ways_are_straight() -> None:
    ways = Ways.to(GOALS, HERE)
    assert (ways.longer == 1).all() and ways.goals is GOALS
    np.testing.assert_allclose(ways.at(np.full((2, 1, 384), 0.5))[:, 0], HERE[:, None] + 0.5 * ways.straight)


def test_ways_are_free_and_lead_to_their_goals() -> None:
    ways = Ways.to(GOALS, HERE, [FREE, FREE])
    blocked = ways.longer != 1
    assert 0.02 < blocked.mean() < 0.5
    places = ways.at(np.broadcast_to(np.linspace(0, 1, 12)[:, None], (2, 12, 384)))
    for free in np.moveaxis(FREE.is_free(places), 1, 0):
        assert free[blocked].all() and free.mean() > 0.98  # a straight way may graze a cell between two samples
    np.testing.assert_array_equal(SPACE.to_cells(places[:, -1]), SPACE.to_cells(ways.goals))
    np.testing.assert_allclose(places[:, 0], np.repeat(HERE[:, None], 384, axis=1), atol=1e-9)
    assert (ways.longer[blocked] >= 0.9).all() and ways.longer.max() < 3


def test_a_way_around_is_as_long_as_the_shortest_one() -> None:
    goal = SPACE.from_cells(np.array([[10, 10, 9]]))
    ways = Ways.to(goal[None], HERE[:1], [FREE])
    moves = len(FREE.way(HERE[0], goal[0], 999))
    assert moves > 10 and ways.longer[0, 0] == pytest.approx(moves / 10)


def test_where_no_way_leads_a_camera_stays() -> None:
    cut_off = FreeSpace.of(SPACE, PILLARS)
    inside = np.array([[7.0, 0.3, 1.5]])  # a camera in a pillar, from which no way leads; it begins at the nearest cell
    ways = Ways.to(GOALS[:1], inside, [cut_off])
    assert FREE.is_free(ways.at(np.ones((1, 1, 384)))).all() and (ways.longer < NEVER).all()
    numbers = cut_off.ways(inside[0], GOALS[0, :2])
    np.testing.assert_array_equal(numbers, np.repeat(SPACE.from_cells(SPACE.to_cells(inside))[None], 2, axis=0))


def test_cameras_head_for_a_corner_of_a_way_around_and_else_for_their_goals() -> None:
    goal = SPACE.from_cells(np.array([[10, 10, 9], [10, 99, 9]]))
    ways = Ways.to(np.repeat(goal[None], 2, axis=0), np.repeat(HERE[:1], 2, axis=0), [FREE, None])
    heads = ways.heads(np.array([0, 0]))
    assert ways.longer[0].tolist() == [pytest.approx(ways.longer[0, 0]), 1] and ways.longer[0, 0] > 1
    assert FREE.is_free(heads[0]) and np.abs(heads[0] - HERE[0]).max() > 0.05
    np.testing.assert_array_equal(heads[1], goal[0])  # nobody knows what is free
    np.testing.assert_array_equal(ways.heads(np.array([1, 1])), goal[[1, 1]])


def test_in_a_stream_what_is_free_is_found_around_where_the_centre_is() -> None:
    world = replace(PAPER, name="own", workspace=SPACE, start_cells=None, obstacles=PILLARS)
    context = replace(tiny_context(episodes=3), world=world, workspace=SPACE)
    observation = random_observation(np.random.default_rng(0), episodes=3)
    assert free_spaces(context, observation) == [world.free_space] * 3
    streams, lost = replace(context, length=None), replace(observation, length=None)
    assert free_spaces(streams, lost) == []
    centres = np.array([[0, 0, 0], [7 * np.cos(0.3), 7 * np.sin(0.3), 0], [0, 0, 900.0]])
    still, beside, away = free_spaces(streams, replace(lost, centre=centres))
    assert still is not None and beside is not None and away is not None
    view = np.array([7.0, 0.3, 1.5])
    assert not still.is_free(view) and beside.is_free(view) and away.free.all()
    walled = replace(world, obstacles=Obstacles(walls=Box(centre=(0, 0, 0), size=(20, 20, 60))))
    nowhere = free_spaces(replace(streams, world=walled), replace(lost, centre=centres))
    assert nowhere[0] is not None and nowhere[2] is None
