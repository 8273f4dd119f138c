"""What is in the way of a plan: the smooth formulas say what the exact ones do, and plans go by them."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.errors import UsageError
from ehar.flight.clearance import ASTRAY
from ehar.flight.motion import FlightMotion
from ehar.flight.vehicle import VEHICLES
from ehar.motion import GridMotion, Motion
from ehar.obstacles import Box, Cylinder, Obstacles, Surroundings
from ehar.obstacles.passers import passing_clearance
from ehar.rollout import rollout
from ehar.sensors.perfect import PerfectSensor
from ehar.viewpoint import cartesian, wrap_difference
from ehar.world import CROWD, PAPER, ROOM
from planners.search.next_best_view import NextBestView, scenes_of
from planners.search.problem import TrajectoryProblem
from planners.search.scene import Scene, SceneSymbols
from planners.search.solver import SolveStatus, TrajectorySolver
from planners.search.task import Trajectory
from planners.value.line_of_sight import seen_share
from planners.value.view_value import ViewValue
from tests.helpers.agents import random_observation
from tests.helpers.fakes import FakeRecogniser, tiny_batch, tiny_context
from tests.helpers.gain_models import model_of, peak_weights
from tests.helpers.passers import standing
from tests.helpers.trajectory_tasks import GRID, random_task

KEEP = 0.35  # [m]
PEOPLE = np.array([[0.2, -0.1, 0.0], [-0.5, 0.6, 0.05]])
WALKING = np.array([[2.0, 1.0, 0.5, -1.2], [-1.5, -2.5, 0.0, 1.4], [0.0, 3.0, -1.0, -0.5]])
BEYOND = Obstacles(
    walls=Box(centre=(0, 0, 2.0), size=(20, 13, 8), yaw_deg=20),
    boxes=(Box(centre=(6, 3, 0), size=(1, 2, 3), yaw_deg=40),),
    cylinders=(Cylinder(centre=(-7, 0, 1), radius=0.6, height=4.0),),
)


def at_cameras(scene: Scene, cameras: FloatArray, ahead: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Return the shares that are seen from cameras (n, 3), and their intrusions, (n,) each."""
    symbols, camera, time = SceneSymbols(scene.size), ca.SX.sym("camera", 3), ca.SX.sym("time")
    values = [symbols.seen(camera, time), symbols.intrusion(camera, KEEP, time)]
    function = ca.Function("scene", [camera, time, symbols.numbers], values)
    seen, intrusion = function(cameras.T, ahead, scene.numbers)
    return seen.full().ravel(), intrusion.full().ravel()


@pytest.mark.parametrize(
    ("obstacles", "passers", "ahead"),
    [(ROOM.obstacles, None, 0.0), (Obstacles(), WALKING, 0.0), (BEYOND, WALKING, 1.5)],
)
def test_what_is_seen_is_nearly_what_nine_lines_of_sight_say(
    obstacles: Obstacles, passers: FloatArray | None, ahead: float
) -> None:
    views = ROOM.sample_starts(np.random.default_rng(0), 3000)
    walking = None if passers is None else passers[None]
    exact = seen_share(views[None], PEOPLE[None], obstacles, walking, ahead)[0]
    seen, _ = at_cameras(Scene.of(PEOPLE, obstacles, passers), cartesian(views), ahead)
    assert (seen > -1e-3).all() and (seen <= 1).all()
    assert 0.05 < (exact < 0.9).mean() < 0.9
    assert np.abs(seen - exact).mean() < 0.06 and np.quantile(np.abs(seen - exact), 0.95) < 0.25
    assert np.corrcoef(seen, exact)[0, 1] > 0.9


@pytest.mark.parametrize("obstacles", [ROOM.obstacles, BEYOND])
def test_what_is_too_near_costs_at_least_as_much_as_it_is_and_what_is_not_nearly_nothing(obstacles: Obstacles) -> None:
    cameras = cartesian(PAPER.sample_starts(np.random.default_rng(0), 20_000))
    clearance = obstacles.clearance(cameras)
    _, intrusion = at_cameras(Scene.of(PEOPLE, obstacles, None), cameras)
    near = clearance < KEEP - 0.02
    assert 100 < near.sum() < 19_900
    assert (intrusion[near] >= (KEEP - np.maximum(clearance[near], -1)) ** 2).all()  # deep inside, several ways count
    assert intrusion[clearance > KEEP + 0.5].max() < 1e-3


@pytest.mark.parametrize("ahead", [0.4, 3.0])
def test_people_who_walk_leave_what_stands_behind(ahead: float) -> None:
    cameras = cartesian(PAPER.sample_starts(np.random.default_rng(0), 500))
    going = np.array([0.9, -0.4, 0.1])
    way = going * 3 * (1 - np.exp(-ahead / 3))  # they are expected to keep on for about three seconds
    walking = Scene.of(PEOPLE, BEYOND, WALKING, going)
    arrived = Scene.of(PEOPLE, BEYOND.relative_to(way), WALKING)
    for found, expected in zip(at_cameras(walking, cameras, ahead), at_cameras(arrived, cameras, ahead), strict=True):
        np.testing.assert_allclose(found, expected, atol=3e-4)  # lengths that are divided by are rounded
    now = Scene.of(PEOPLE, BEYOND, WALKING)
    for found, expected in zip(at_cameras(walking, cameras, 0.0), at_cameras(now, cameras, 0.0), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_passers_by_walk_where_no_camera_is_and_are_not_kept_clear_of() -> None:
    cameras = cartesian(PAPER.sample_starts(np.random.default_rng(0), 100))
    assert not at_cameras(Scene.of(PEOPLE, Obstacles(), WALKING), cameras)[1].any()


@pytest.mark.parametrize("ahead", [0.0, 1.5])
def test_those_whom_cameras_may_meet_are_kept_clear_of_where_they_will_be(ahead: float) -> None:
    rng = np.random.default_rng(0)
    cameras = rng.uniform([-9, -9, -1], [9, 9, 2], (20_000, 3))
    going = np.array([0.9, -0.4, 0.1])  # people's way is not theirs: they are seen from the centre
    scene = Scene.of(PEOPLE, Obstacles(), WALKING, going, met=True)
    clearance = passing_clearance(cameras, WALKING[:, :2] + ahead * WALKING[:, 2:])
    _, intrusion = at_cameras(scene, cameras, ahead)
    near = clearance < KEEP + ASTRAY - 0.02
    assert 50 < near.sum() < 19_900
    assert (intrusion[near] >= (KEEP + ASTRAY - np.maximum(clearance[near], -1)) ** 2).all()
    assert intrusion[clearance > KEEP + 0.7].max() < 1e-3


def test_a_plan_collects_the_field_as_far_as_it_sees_people() -> None:
    rng = np.random.default_rng(0)
    scene = Scene.of(PEOPLE, ROOM.obstacles, WALKING)
    task = random_task(rng, limits=GRID, node_time=0.16, spread_weight=0.2, scene=scene)
    task = replace(task, position=np.array([6.0, 0.3, 1.3]))
    stay = task.hold()
    problem = TrajectoryProblem(task.horizon, scene=scene.size)
    seen = [at_cameras(scene, cartesian(task.position)[None], node * 0.16)[0][0] for node in range(1, 16)]
    value = float(replace(task, spread_weight=0.0).objective(stay))  # the weights of the nodes add up to 1
    assert problem.objective(task, [stay])[0] == pytest.approx(np.mean(seen) * value, abs=0.02)


def test_views_spread_as_far_as_they_see_people() -> None:
    """Of the worth of a pair of views a quarter is left where each shows half of the people."""
    rng = np.random.default_rng(0)
    pillars = Obstacles(cylinders=tuple(Cylinder(centre=(x, 0, 0), radius=0.5, height=4.0) for x in (2.0, -2.0)))
    scene = Scene.of(PEOPLE, pillars, None)
    problem = TrajectoryProblem(15, scene=scene.size)
    for _ in range(20):
        task = random_task(rng, limits=GRID, node_time=0.16, spread_weight=0.2, scene=scene)
        task = replace(task, field_weights=np.zeros_like(task.field_weights), effort_weight=0.0)
        position = rng.uniform([5, -4, 0.1], [15, 4, np.pi / 2], (16, 3))
        position[0] = task.position
        tried = Trajectory(position, np.zeros((16, 3)), np.zeros((16, 3)), np.zeros((15, 3)))
        directions = cartesian(position[1:]) / position[1:, :1]
        seen, _ = at_cameras(scene, cartesian(position[1:]))
        pairs = (1 - directions @ directions.T) * np.outer(seen, seen) / 15**2
        assert problem.objective(task, [tried])[0] == pytest.approx(0.2 * pairs.sum(), abs=1e-4)


def test_a_plan_along_a_way_is_no_worse_than_the_way_or_the_plan_before() -> None:
    rng = np.random.default_rng(1)
    scene = Scene.of(PEOPLE, ROOM.obstacles, None)
    solver = TrajectorySolver(scene=scene.size)
    better = 0
    for _ in range(10):
        task = random_task(rng, limits=GRID, node_time=0.16, spread_weight=0.2, scene=scene)
        task = replace(task, position=ROOM.sample_starts(rng, 1)[0])
        before, *ways = (solver.solve_best(task, ROOM.sample_starts(rng, 1)) for _ in range(3))
        for way in ways:
            plan = solver.solve_along(task, way.trajectory, before)
            assert plan.objective >= max(way.objective, before.objective) - 1e-3 * task.stake
            better += plan.objective > before.objective + 1e-2 * task.stake
        same = solver.solve_along(task, None, before)
        assert same.objective >= before.objective - 1e-3 * task.stake
    assert better > 0


def test_a_task_among_other_things_is_refused() -> None:
    task = random_task(np.random.default_rng(0), limits=GRID, scene=Scene.of(PEOPLE, ROOM.obstacles, None))
    with pytest.raises(UsageError, match=r"expected a scene with None, got SceneSize\(people=2, walls=1, boxes=1"):
        TrajectorySolver().solve(task, task.hold())


def test_planners_know_what_stands_around_where_the_centre_is_now() -> None:
    observation = random_observation(np.random.default_rng(0), episodes=2)
    walking = np.stack([WALKING, WALKING + 1])
    for world, passers, centre in ((ROOM, None, np.array([[0, 0, 0], [1.0, 2.0, 0.5]])), (CROWD, walking, None)):
        value = ViewValue(model_of(np.zeros(21)))
        value.reset(replace(tiny_context(episodes=2), world=world))
        shown = replace(observation, passers=passers, centre=centre)
        value.update(shown)
        going = np.array([[0.0, 0.0, 0.0], [0.3, -0.2, 0.0]])
        held = scenes_of(value, shown, going)
        np.testing.assert_array_equal([scene.numbers[:3] for scene in held], going)
        assert [scene.size.passers for scene in held] == [0 if passers is None else 3] * 2
        difference = held[1].numbers[6:] - held[0].numbers[6:]  # but for how the centre walks, and the people
        if centre is not None:
            np.testing.assert_allclose(difference[:3], -centre[1])  # the walls
            np.testing.assert_allclose(difference[3:8], 0, atol=1e-12)
        else:
            np.testing.assert_allclose(difference.reshape(3, 7), np.tile([1, 1, 0, 0, 0, 1, 1], (3, 1)))


ALONG = Obstacles(
    walls=Box(centre=(0, 0, 3.0), size=(18, 13, 8)),
    boxes=(Box(centre=(0, 5.8, 0), size=(1.2, 1.2, 8)),),
    cylinders=(
        Cylinder(centre=(-5.6, -2.2, 1), radius=0.5, height=8.0),
        Cylinder(centre=(2.4, 0, 0), radius=0.4, height=4),
    ),
)


@pytest.mark.parametrize("motion", ["grid", "tracking-drone"])
@pytest.mark.parametrize("walk", [0.0, 0.6])
def test_plans_in_a_room_keep_the_margin_and_get_to_where_people_are_seen(motion: str, walk: float) -> None:
    """The field is best at 13 m, behind a pillar and far outside of the walls; the room may move past the camera."""
    length, world = 60, replace(PAPER, name="own", obstacles=ALONG)
    vehicle = VEHICLES.get(motion)
    starts = np.array([[6.0, 2.5, 1.4], [5.6, 0.4, 1.2], [6.0, 4.6, 1.4]])
    made = tiny_batch(episodes=3, length=length)
    centre = np.zeros((3, length, 3))
    centre[..., 1] = -walk * np.arange(length) / 25
    around = Surroundings(ALONG, centre if walk else None)
    batch = replace(made, starts=starts, surroundings=around)
    context = replace(
        tiny_context(episodes=3, length=length), world=world, vehicle=vehicle, follows=vehicle is not None
    )
    planner = NextBestView(model=model_of(peak_weights(np.array([13.0, 0.0, 1.4]))))
    body: Motion = GridMotion() if vehicle is None else FlightMotion(vehicle=vehicle)
    record = rollout(planner, batch, FakeRecogniser(), PerfectSensor(), body, context)
    if not (walk and vehicle):  # flights do not expect where people walk
        assert (around.clearance(record.viewpoints, slice(None)) >= 0.3 - 1e-6).all()
    assert planner.statistics.fallbacks <= 1  # of 18
    assert planner.statistics.counts[SolveStatus.INFEASIBLE] == 0
    seen = seen_share(record.viewpoints[:, -1], np.zeros((3, 1, 3)), ALONG, centre=centre[:, -1])
    assert (seen > 0.6).all()
    if not walk:
        away = np.abs(wrap_difference(record.viewpoints[1:, -1, 1]))
        assert (away < 1.4).all() and (record.viewpoints[1:, -1, 0] > 6.5).all()  # a box stands in the way of the first


def test_passers_by_are_planned_with() -> None:
    """Somebody stands between the camera and people where the field is best: the plan ends beside."""
    passers = np.array([[[2.0, 0.0, 0.0, 0.0]]])
    made = tiny_batch(episodes=1, length=40)
    walkers = standing(passers[0, :, :2], length=40)
    batch = replace(
        made, starts=np.array([[6.0, 0.3, np.pi / 2]]), surroundings=Surroundings(Obstacles(), None, walkers)
    )
    context = replace(tiny_context(episodes=1, length=40), world=CROWD)
    planner = NextBestView(model=model_of(peak_weights(np.array([6.0, 0.0, np.pi / 2]))))
    record = rollout(planner, batch, FakeRecogniser(), PerfectSensor(), GridMotion(), context)
    assert seen_share(record.viewpoints[:, -1], np.zeros((1, 1, 3)), Obstacles(), passers)[0] > 0.8
