"""What is seen of people from a viewpoint, and that planners go where something is seen."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.batch import Batch
from ehar.motion import GridMotion
from ehar.obstacles import Box, Cylinder, Obstacles, Surroundings
from ehar.planner import Context
from ehar.rollout import rollout
from ehar.sensors.perfect import PerfectSensor
from ehar.world import PAPER
from planners.search.next_best_view import NextBestView
from planners.search.view_search import NextBestViewGreedy, NextBestViewSearch
from planners.value.line_of_sight import seen_share
from planners.value.view_value import ViewValue
from tests.helpers.fakes import FakeRecogniser, tiny_batch, tiny_context
from tests.helpers.gain_models import model_of, peak_weights

PILLAR = Obstacles(cylinders=(Cylinder(centre=(2.5, 0.0, 0.0), radius=0.6, height=9.0),))
BEHIND, ASIDE = np.array([6.0, 0.0, np.pi / 2]), np.array([6.0, np.pi / 2, np.pi / 2])
CENTRE = np.zeros((1, 1, 3))


def test_behind_a_pillar_nothing_is_seen_and_beside_it_all() -> None:
    views = np.stack([BEHIND, ASIDE])[None]
    assert seen_share(views, CENTRE, PILLAR).tolist() == [[0, 1]]
    beside = np.array([[[0.0, 0.9, 0.0]]])  # a person who has stepped aside is seen from there
    assert seen_share(BEHIND[None], beside, PILLAR)[0] == pytest.approx(2 / 3, abs=0.34)
    both = np.concatenate([CENTRE, beside + np.array([0, 0.6, 0])], axis=1)
    assert seen_share(BEHIND[None], both, PILLAR).tolist() == [0.5]


def test_a_pillar_stays_while_people_walk_past_it() -> None:
    centres = np.array([[0.0, 0.0, 0.0], [0.0, 1.5, 0.0]])
    shares = seen_share(np.stack([BEHIND, BEHIND]), np.zeros((2, 1, 3)), PILLAR, centre=centres)
    assert shares.tolist() == [0, 1]


def test_a_table_hides_a_third_of_a_person() -> None:
    table = Obstacles(boxes=(Box(centre=(1.5, 0.0, -0.575), size=(0.8, 1.8, 0.75)),))
    assert seen_share(BEHIND[None], CENTRE, table)[0] == pytest.approx(2 / 3)
    assert seen_share(np.array([[6.0, 0.0, 0.3]]), CENTRE, table)[0] == 1


def test_a_passer_by_is_expected_to_walk_straight_on() -> None:
    walker = np.array([[[2.5, -1.0, 0.0, 1.0]]])  # a second from the line of sight
    shares = [float(seen_share(BEHIND[None], CENTRE, Obstacles(), walker, ahead)[0]) for ahead in (0.0, 1.0, 2.0)]
    assert shares == [1, pytest.approx(0, abs=0.4), 1]
    views = np.stack([BEHIND, ASIDE])[None]
    assert seen_share(views, CENTRE, Obstacles(), walker, 1.0).tolist() == [[shares[1], 1]]
    at_once = seen_share(np.repeat(views[:, None], 3, axis=1), CENTRE, Obstacles(), walker, np.array([0.0, 1.0, 2.0]))
    assert at_once.tolist() == [[[share, 1] for share in shares]]


def context_in(obstacles: Obstacles) -> Context:
    context = tiny_context(episodes=3, length=30)
    return replace(context, world=replace(PAPER, name="own", obstacles=obstacles))


def test_in_an_open_world_values_are_as_they_were_and_a_field_that_knows_what_is_hidden_is_not_raised() -> None:
    model = model_of(peak_weights(np.array([6.0, 0.5, 1.2])))
    weights = peak_weights(np.array([6.0, 0.5, 1.2]))
    weights[0] = 0.3  # what it is worth to see people
    value, among, knows = ViewValue(model), ViewValue(model), ViewValue(model_of(weights))
    shown: list[tuple[np.ndarray, ...]] = []

    class Looks(NextBestViewGreedy):
        def act(self, observation):  # type: ignore[no-untyped-def]
            for one in (value, among, knows):
                one.update(observation)
            shown.append((value.weights, among.weights, knows.weights))
            assert (value.seen(observation.viewpoint, 0.0) == 1).all()
            return observation.viewpoint

    value.reset(tiny_context(episodes=3, length=5))
    among.reset(context_in(PILLAR))
    knows.reset(context_in(PILLAR))
    planner, batch = Looks(model=model), tiny_batch(episodes=3, length=5)
    rollout(planner, batch, FakeRecogniser(), PerfectSensor(), GridMotion(), tiny_context(episodes=3, length=5))
    plain, shifted, known = shown[-1]
    np.testing.assert_allclose(plain[:, 1:], shifted[:, 1:])
    assert not np.allclose(plain[:, 0], shifted[:, 0])
    np.testing.assert_allclose(known, np.tile(weights, (3, 1)))


@pytest.mark.parametrize("planner", [NextBestViewGreedy, NextBestViewSearch, NextBestView])
def test_planners_leave_a_shadow_for_a_view_that_shows_people(
    planner: type[NextBestViewGreedy | NextBestViewSearch | NextBestView],
) -> None:
    """The field is best where the pillar hides all: a planner that did not know would stay there."""
    model = model_of(peak_weights(BEHIND))
    made = tiny_batch(episodes=3, length=30)
    near = np.tile(PAPER.workspace.from_cells(np.array([10, 3, 25])), (3, 1))  # in half of the shadow
    seen = {}
    for obstacles in (PILLAR, Obstacles()):
        around = Surroundings(PILLAR)
        batch = Batch(made.positions, made.labels, near, made.noise, made.names, around)
        record = rollout(
            planner(model=model), batch, FakeRecogniser(), PerfectSensor(), GridMotion(), context_in(obstacles)
        )
        seen[bool(obstacles)] = seen_share(record.viewpoints[:, -1], np.zeros((3, 1, 3)), PILLAR).mean()
    assert seen[True] > seen[False] + 0.3 and seen[True] > 0.9
