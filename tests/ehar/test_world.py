"""Worlds: those of ehar, files, what is impossible, and that cameras stay inside whatever the world."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar import Camera, EharError, GridMotion, Localisation, Workspace, World
from ehar.data.scenario import windows
from ehar.data.surroundings import surroundings_of
from ehar.motion import move_towards
from ehar.obstacles import MARGIN, Box, Cylinder, Obstacles
from ehar.viewpoint import AZIMUTH, HOVER, MOVES, apply_moves, cartesian, wrap_difference
from ehar.world import INDOOR, PAPER, ROOM, WORLDS, by_name, load_world
from tests.helpers.fakes import tiny_data

CONTENT = {
    "distance_min": 2,
    "distance_max": 3.05,
    "polar_min_deg": 40,
    "polar_max_deg": 100,
    "distance_step": 0.1,
    "angle_step_deg": 7.2,
    "start_cells": [5, 50, 3],
    "camera": {"width": 320, "height": 240, "focal_length": 300},
}


TABLE = {"centre": [1.2, 0, -0.6], "size": [0.5, 0.5, 0.7], "yaw_deg": 30}


def written(folder: Path, content: Any, name: str = "lab") -> Path:
    path = folder / f"{name}.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


@st.composite
def worlds(draw: st.DrawFn) -> World:
    """Draw a world whose bounds are no multiples of its steps."""
    near = draw(st.floats(0.3, 20))
    high = draw(st.floats(0, 175))
    workspace = Workspace(
        distance_min=near,
        distance_max=near + draw(st.floats(0, 20)),
        polar_min=math.radians(high),
        polar_max=math.radians(draw(st.floats(high, 180))),
        distance_step=draw(st.floats(0.02, 3)),
        angle_step=2 * math.pi / draw(st.integers(1, 360)),
    )
    starts = tuple(draw(st.integers(1, most)) for most in workspace.cells)
    return World("drawn", workspace, Camera(), draw(st.sampled_from([None, starts])))


def test_the_paper_s_world_is_the_default_everywhere() -> None:
    assert PAPER.workspace == Workspace() and PAPER.camera == Camera()
    assert math.prod(PAPER.start_cells or ()) == 250_000
    assert PAPER.workspace.cells == (101, 100, 26)


def test_the_indoor_world_is_a_room() -> None:
    space = INDOOR.workspace
    assert (space.distance_min, space.distance_max) == (1.5, 4.0)
    assert np.degrees([space.polar_min, space.polar_max]) == pytest.approx([40, 95])
    assert INDOOR.camera == Camera(width=640, height=480, focal_length=525.0)
    assert space.cells == (101, 100, 16)
    below = cartesian(space.from_cells(np.array([0, 0, 15])))
    assert below[2] == pytest.approx(1.5 * math.cos(math.radians(94))) and below[2] < 0


@given(worlds(), st.integers(0, 2**32 - 1))
def test_starts_moves_and_hovering_stay_inside_and_steps_are_exact(world: World, seed: int) -> None:
    space, rng = world.workspace, np.random.default_rng(seed)
    here = world.sample_starts(rng, 20)
    assert space.contains(here).all()
    for _ in range(5):
        moves = rng.integers(len(MOVES), size=20)
        there = apply_moves(here, moves, space)
        assert space.contains(there).all()
        change = there - here
        change[:, AZIMUTH] = np.where(space.cells[AZIMUTH] == 1, 0.0, wrap_difference(change[:, AZIMUTH]))
        turns = MOVES[moves] * (np.arange(3) != AZIMUTH if space.cells[AZIMUTH] == 1 else 1)
        made = np.abs(change - turns * space.step).max(axis=1) < 1e-9
        if space.cells[AZIMUTH] == 2:  # half a turn either way is the same place
            made |= np.abs(np.abs(change) - np.abs(turns) * space.step).max(axis=1) < 1e-9
        stayed = np.abs(change).max(axis=1) < 1e-12
        assert (made | stayed).all()
        here = there
    # From anywhere, bounds included, hovering stays inside, and so does any way to any target.
    low, high = [space.distance_min, -7, space.polar_min], [space.distance_max, 7, space.polar_max]
    anywhere = rng.uniform(low, high, (20, 3))
    bounds = np.where(rng.random((20, 3)) < 0.5, low, high)
    for viewpoint in (anywhere, bounds):
        assert space.contains(apply_moves(viewpoint, np.full(20, HOVER), space)).all()
    motion = GridMotion(workspace=space)
    motion.reset(here, 0.04)
    target = rng.uniform(-30, 30, (20, 3))
    for _ in range(10):
        assert space.contains(motion.advance(target)).all()


@given(worlds(), st.integers(0, 2**32 - 1))
def test_a_target_is_reached_to_within_half_a_cell_or_the_last_one(world: World, seed: int) -> None:
    space, rng = world.workspace, np.random.default_rng(seed)
    coarse = replace(space, distance_step=max(space.distance_step, 0.5), angle_step=2 * math.pi / 12)
    motion = GridMotion(workspace=coarse)
    motion.reset(World("coarse", coarse, Camera()).sample_starts(rng, 8), 0.04)
    target = rng.uniform([0, -7, 0], [45, 7, np.pi], (8, 3))
    for _ in range(sum(coarse.cells)):
        reached = motion.advance(target)
    assert (move_towards(reached, target, coarse) == HOVER).all()
    np.testing.assert_array_equal(coarse.to_cells(reached), coarse.to_cells(coarse.clip(target)))


def test_hovering_at_a_bound_that_is_no_multiple_of_the_step_stays() -> None:
    at_the_bound = np.array([4.0, 1.0, math.radians(40)])
    space = Workspace(distance_min=1.55, distance_max=4.0, polar_min=math.radians(40))
    hovered = apply_moves(at_the_bound, np.array(HOVER), space)
    assert space.contains(hovered)
    assert np.degrees(hovered[2]) == pytest.approx(40)  # not 39.6, the nearest multiple of 3.6 degrees


def test_a_world_file(tmp_path: Path) -> None:
    world = load_world(written(tmp_path, CONTENT))
    space = Workspace(2, 3.05, math.radians(40), math.radians(100), 0.1, math.radians(7.2))
    assert world == World("lab", space, Camera(320, 240, 300), (5, 50, 3))
    assert space.cells == (11, 50, 9)
    assert str(world) == (
        "lab (2 to 3.05 m, polar 40 to 100 deg, steps of 0.1 m and 7.2 deg, 5 x 50 x 3 starts, "
        "320 x 240 px, focal length 300 px)"
    )
    all_cells = load_world(written(tmp_path, {key: CONTENT[key] for key in CONTENT if key != "start_cells"}))
    assert all_cells.start_cells is None


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"colour": "red"}, "unknown colour"),
        ({"distance_min": "near"}, "distance_min: expected a number, got 'near'"),
        ({"distance_min": 0}, "distance_min: expected a number above 0, got 0"),
        ({"distance_max": 1}, "expected 0 < distance_min <= distance_max, got 2 and 1 m"),
        ({"polar_min_deg": 101}, "expected polar angles 0 <= min <= max <= 180 deg, got 101 and 100"),
        ({"polar_max_deg": 181}, "expected polar angles 0 <= min <= max <= 180 deg, got 40 and 181"),
        ({"angle_step_deg": 7}, "expected an angle_step that divides 360 deg, got 7"),
        ({"distance_step": -0.1}, "distance_step: expected a number above 0"),
        ({"start_cells": [12, 50, 3]}, r"start_cells: expected 3 numbers from 1 to 11, 50, 9, .* got \[12, 50, 3\]"),
        ({"start_cells": [5, 50]}, "start_cells"),
        ({"camera": {"width": 320, "height": 240}}, "camera: missing focal_length"),
        ({"camera": {"width": 320.5, "height": 240, "focal_length": 300}}, "camera.width: expected a whole number"),
        ({"camera": {"width": 320, "height": 0, "focal_length": 300}}, "camera.height: expected at least 1, got 0"),
        ({"camera": {"width": 10**400, "height": 240, "focal_length": 300}}, "camera.width: expected at most 100000, "),
        ({"camera": {"width": 320, "height": 240, "focal_length": 1e300}}, "focal_length: expected at most 1e\\+06"),
        ({"distance_step": 1e-9}, "expected a grid of at most 100,000,000 cells, got more, by steps of 1e-09 m"),
        ({"distance_step": 1e-320}, "expected a grid of at most 100,000,000 cells"),
        ({"distance_step": 1e4, "angle_step_deg": 0.0036}, "expected a grid of at most 100,000,000 cells, got more"),
        ({"distance_step": 1e300}, "distance_step: expected at most 10000"),
        ({"angle_step_deg": 0.001}, "expected a grid of at most 100,000,000 cells, got more"),
        ({"angle_step_deg": 1e-320}, "expected a grid of at most 100,000,000 cells, got more"),
        ({"distance_max": 1e300}, "distance_max: expected at most 10000"),
        ({"passers_by": 10**400}, "passers_by: expected at most 100, got 1000"),
        ({"obstacles": {"boxes": [TABLE]}, "distance_step": 4e-5}, "a grid of at most 10,000,000 cells around them"),
    ],
)
def test_what_is_wrong_with_a_file_is_said_in_one_line(tmp_path: Path, changes: dict[str, Any], complaint: str) -> None:
    with pytest.raises(EharError, match=complaint) as error:
        load_world(written(tmp_path, CONTENT | changes))
    assert str(tmp_path / "lab.json") in str(error.value) and "\n" not in str(error.value)


ROUND_TABLE = {"centre": [1.2, 0, -0.6], "radius": 0.5, "height": 0.7}


def test_a_world_file_with_obstacles(tmp_path: Path) -> None:
    inside = {"boxes": [TABLE], "cylinders": [ROUND_TABLE]}
    world = load_world(written(tmp_path, CONTENT | {"obstacles": inside}))
    assert world.obstacles == Obstacles(
        boxes=(Box(centre=(1.2, 0.0, -0.6), size=(0.5, 0.5, 0.7), yaw_deg=30.0),),
        cylinders=(Cylinder(centre=(1.2, 0.0, -0.6), radius=0.5, height=0.7),),
    )
    assert str(world).endswith("focal length 300 px, 1 box, 1 cylinder)")
    opened = load_world(written(tmp_path, CONTENT))
    assert world.opened == opened and not world.agrees_with(opened) and not world.is_open
    assert "obstacles" in world.to_json() and "obstacles" not in opened.to_json()


def ring(low: float, high: float) -> list[dict[str, Any]]:
    """Return boxes that stand around the people, from one distance to another."""
    size, middle = [high - low, 2 * high, 9], (low + high) / 2
    angles = (0, 90, 180, 270)
    return [
        {
            "centre": [round(middle * math.cos(math.radians(a)), 6), round(middle * math.sin(math.radians(a)), 6), 0],
            "size": size,
            "yaw_deg": a,
        }
        for a in angles
    ]


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"obstacles": {"boxes": [TABLE | {"size": [1, 0, 1]}]}}, r"size\[1\]: expected a number above 0, got 0"),
        ({"obstacles": {"boxes": [{"size": [1, 1, 1]}]}}, r"obstacles.boxes\[0\]: missing centre"),
        ({"obstacles": {"spheres": []}}, "obstacles: unknown spheres; expected walls, boxes, cylinders"),
        ({"obstacles": {"walls": {"centre": [0, 0, 0], "size": [2, 2, 2]}}}, "expected free space for cameras, all"),
        ({"obstacles": {"boxes": ring(0.5, 1.0)}}, "expected a cell that sees somebody at the centre, they hide"),
        ({"passers_by": -1}, "passers_by: expected at least 0, got -1"),
        ({"passers_by": 2}, r"passers_by: expected at least 0, and 0 unless distance_min is at least 2.55 m"),
    ],
)
def test_obstacles_that_cannot_be_are_refused_in_one_line(
    tmp_path: Path, changes: dict[str, Any], complaint: str
) -> None:
    with pytest.raises(EharError, match=complaint) as error:
        load_world(written(tmp_path, CONTENT | changes))
    assert str(tmp_path / "lab.json") in str(error.value) and "\n" not in str(error.value)


def test_a_world_file_in_which_people_are_tracked(tmp_path: Path) -> None:
    content = CONTENT | {"distance_min": 2.6, "start_cells": [4, 50, 3], "passers_by": 2}
    tracked, known = (load_world(written(tmp_path, content | {"identity": one})) for one in ("tracked", "known"))
    assert "identity" not in known.to_json() and known.to_json() | {"identity": "tracked"} == tracked.to_json()
    assert not tracked.agrees_with(known) and tracked.opened.agrees_with(known.opened)
    assert "2 passers-by, some taken for those that are watched" in str(tracked)
    with pytest.raises(EharError, match="identity: expected "):
        load_world(written(tmp_path, content | {"identity": "guessed"}))
    scenarios = windows(tiny_data(), np.arange(2), 8, 1)
    for world in (tracked, known):
        around = surroundings_of(scenarios, np.arange(2), world, np.random.default_rng(0))
        assert around is not None and around.passers is not None
        assert around.passers.mistakable == (world is tracked)


def test_a_world_file_in_which_cameras_may_meet_passers_by(tmp_path: Path) -> None:
    content = CONTENT | {"distance_min": 2.6, "start_cells": [4, 50, 3], "passers_by": 2}
    usual, near, far = (load_world(written(tmp_path, content | more)) for more in ({}, reach(2.0), reach(7.5)))
    assert [world.meets_passers for world in (usual, near, far)] == [False, False, True]
    assert [world.can_be_hit for world in (usual, near, far, ROOM)] == [False, False, True, True]
    assert [world.passing_reach for world in (usual, near, far)] == pytest.approx([2.05, 2.0, 7.5])
    assert "passers_reach" not in usual.to_json() and far.to_json()["passers_reach"] == 7.5
    assert load_world(written(tmp_path, content | reach(7.5))).agrees_with(far)
    assert not far.agrees_with(usual) and far.opened.agrees_with(usual.opened)
    assert not replace(far, passers_by=0).meets_passers
    assert "2 passers-by up to 7.5 m away" in str(far)
    for wrong in (1.9, -3, "far"):
        with pytest.raises(EharError, match="passers_reach: expected "):
            load_world(written(tmp_path, content | reach(wrong)))
    with pytest.raises(EharError, match=r"passers_reach: expected 2 to [0-9,]+ m, got 1"):
        replace(usual, passers_reach=1.0)


def reach(metres: Any) -> dict[str, Any]:
    """Return what a world file says of how far passers-by walk."""
    return {"passers_reach": metres}


def test_a_world_file_with_a_localisation(tmp_path: Path) -> None:
    world = load_world(written(tmp_path, CONTENT | {"localisation": {"noise": 0.2, "delay": 1}}))
    assert world.localisation == Localisation(noise=0.2, delay=1.0, agility=2.0)
    assert str(world).endswith("focal length 300 px, people localised with noise 0.2 m, delay 1 s, agility 2 m/s^2)")
    usual = load_world(written(tmp_path, CONTENT | {"localisation": {}}))
    assert usual == load_world(written(tmp_path, CONTENT)) and not usual.agrees_with(world)
    assert "localisation" in world.to_json() and "localisation" not in usual.to_json()
    assert "obstacles" not in world.to_json()


@pytest.mark.parametrize(
    ("localisation", "complaint"),
    [
        ({"noise": -0.1}, "localisation.noise: expected at least 0, got -0.1"),
        ({"noise": 11}, "localisation.noise: expected at most 10, got 11"),
        ({"delay": 1e300}, r"localisation.delay: expected at most 10, got 1e\+300"),
        ({"agility": 0}, "localisation.agility: expected a number above 0, got 0"),
        ({"agility": 10**400}, "localisation.agility: expected "),
        ({"agility": "quick"}, "localisation.agility: expected a number, got 'quick'"),
        ({"speed": 1}, "localisation: unknown speed; expected noise, delay, agility"),
        (0.1, "localisation: expected an object, got 0.1"),
    ],
)
def test_a_localisation_that_cannot_be_is_refused_in_one_line(
    tmp_path: Path, localisation: Any, complaint: str
) -> None:
    with pytest.raises(EharError, match=complaint) as error:
        load_world(written(tmp_path, CONTENT | {"localisation": localisation}))
    assert str(tmp_path / "lab.json") in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("wrong", [{"noise": -1.0}, {"delay": math.inf}, {"agility": math.nan}, {"agility": True}])
def test_an_own_localisation_is_checked_too(wrong: dict[str, Any]) -> None:
    with pytest.raises(EharError, match=f"localisation: {next(iter(wrong))}: expected a number "):
        Localisation(**wrong)


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        (lambda: Camera(width=10**400), "camera: expected at most 100000 px along a side"),
        (lambda: Camera(focal_length=2e6), "camera: expected at most 100000 px"),
        (lambda: Workspace(distance_max=10**400), "distance_max of at most 10000 m, got more"),
        (lambda: Workspace(distance_step=1e-9), "expected a grid of at most 100,000,000 cells"),
        (lambda: replace(PAPER, passers_by=101), "passers_by: expected at most 100, got more"),
    ],
)
def test_what_is_too_large_is_refused_from_python_too(wrong: Callable[[], object], complaint: str) -> None:
    with pytest.raises(EharError, match=complaint):
        wrong()


def test_starts_are_free_and_where_none_is_free_this_is_said() -> None:
    starts = ROOM.sample_starts(np.random.default_rng(0), 500)
    assert (ROOM.obstacles.clearance(cartesian(starts)) >= MARGIN - 1e-6).all()
    assert not (ROOM.obstacles.clearance(cartesian(PAPER.sample_starts(np.random.default_rng(0), 500))) > 0).all()
    near = replace(ROOM, obstacles=Obstacles(cylinders=(Cylinder(centre=(5.0, 0.0, 0.0), radius=2.0, height=99.0),)))
    with pytest.raises(EharError, match="start_cells: expected a free one, obstacles are in or near all of them"):
        replace(near, start_cells=(3, 2, 2), workspace=replace(near.workspace, polar_min=1.2)).sample_starts(
            np.random.default_rng(0), 1
        )


def test_a_missing_key_a_missing_file_and_an_unknown_name(tmp_path: Path) -> None:
    without = {key: value for key, value in CONTENT.items() if key != "distance_step"}
    with pytest.raises(EharError, match="missing distance_step"):
        load_world(written(tmp_path, without))
    with pytest.raises(EharError, match="expected a world file"):
        load_world(tmp_path / "nowhere.json")
    with pytest.raises(
        EharError, match=r"unknown world 'outdoor'; expected one of: paper, indoor, room, crowd, or a \.json file"
    ):
        load_world("outdoor")
    with pytest.raises(EharError, match="expected another name of a world file, 'indoor' is a world of ehar"):
        load_world(written(tmp_path, CONTENT, "indoor"))


def test_names_do_not_matter_to_agreement_but_every_number_does() -> None:
    assert INDOOR.agrees_with(replace(INDOOR, name="room"))
    assert not INDOOR.agrees_with(PAPER)
    assert not PAPER.agrees_with(replace(PAPER, start_cells=(99, 100, 25)))
    assert not PAPER.agrees_with(replace(PAPER, camera=Camera(focal_length=851)))
    rounded = replace(PAPER.workspace, polar_max=90 * (math.pi / 180) + 1e-15)
    assert PAPER.agrees_with(replace(PAPER, workspace=rounded))


def test_worlds_of_ehar_go_by_their_name() -> None:
    assert [by_name(world) for world in WORLDS.values()] == ["paper", "indoor", "room", "crowd"]
    mine = replace(INDOOR, name="mine")
    assert by_name(mine) is mine
