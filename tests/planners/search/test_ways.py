"""Ways to goals: straight in the open, around obstacles where something stands, and as long as they are."""

import numpy as np
import pytest

from ehar import Workspace
from ehar.obstacles import Cylinder, FreeSpace, Obstacles
from planners.search.ways import NEVER, Ways
from planners.value.view_value import coarse_grid

SPACE = Workspace(distance_max=9.0, polar_min=0.9, distance_step=0.2)
PILLARS = Obstacles(
    cylinders=tuple(Cylinder(centre=(7 * np.cos(a), 7 * np.sin(a), 0), radius=0.8, height=30) for a in (0.3, 2.0, 4.4))
)
FREE = FreeSpace.of(SPACE, PILLARS)
HERE = SPACE.from_cells(np.array([[10, 0, 9], [2, 60, 3]]))
GOALS = np.broadcast_to(coarse_grid(SPACE), (2, 384, 3))


def test_in_the_open_all_ways_are_straight() -> None:
    ways = Ways.to(GOALS, HERE, None)
    assert (ways.longer == 1).all() and ways.goals is GOALS
    np.testing.assert_allclose(ways.at(np.full((2, 384), 0.5)), HERE[:, None] + 0.5 * ways.straight)


def test_ways_are_free_and_lead_to_their_goals() -> None:
    ways = Ways.to(GOALS, HERE, FREE)
    blocked = ways.longer != 1
    assert 0.02 < blocked.mean() < 0.5
    for share in np.linspace(0, 1, 12):
        free = FREE.is_free(ways.at(np.full((2, 384), share)))
        assert free[blocked].all() and free.mean() > 0.98  # a straight way may graze a cell between two samples
    ends = SPACE.to_cells(ways.at(np.ones((2, 384))))
    np.testing.assert_array_equal(ends, SPACE.to_cells(ways.goals))
    np.testing.assert_allclose(ways.at(np.zeros((2, 384))), np.repeat(HERE[:, None], 384, axis=1), atol=1e-9)
    assert (ways.longer[blocked] >= 0.9).all() and ways.longer.max() < 3


def test_a_way_around_is_as_long_as_the_shortest_one() -> None:
    goal = SPACE.from_cells(np.array([[10, 10, 9]]))
    ways = Ways.to(goal[None], HERE[:1], FREE)
    moves = len(FREE.way(HERE[0], goal[0], 999))
    assert moves > 10 and ways.longer[0, 0] == pytest.approx(moves / 10)


def test_where_no_way_leads_a_camera_stays() -> None:
    cut_off = FreeSpace.of(SPACE, PILLARS)
    inside = np.array([[7.0, 0.3, 1.5]])  # a camera in a pillar, from which no way leads; it begins at the nearest cell
    ways = Ways.to(GOALS[:1], inside, cut_off)
    assert FREE.is_free(ways.at(np.ones((1, 384)))).all() and (ways.longer < NEVER).all()
    numbers = cut_off.ways(inside[0], GOALS[0, :2])
    np.testing.assert_array_equal(numbers, np.repeat(SPACE.from_cells(SPACE.to_cells(inside))[None], 2, axis=0))
