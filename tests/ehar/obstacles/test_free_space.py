"""Free cells, the ways between them, and a camera on the grid that takes these ways."""

from dataclasses import replace

import numpy as np
import pytest

from ehar import GridMotion, Workspace
from ehar.motion import move_towards
from ehar.obstacles import MARGIN, Box, Cylinder, FreeSpace, Obstacles, Surroundings
from ehar.obstacles.shapes import coordinates
from ehar.viewpoint import AZIMUTH, HOVER, apply_moves, cartesian, neighbours
from ehar.world import ROOM

COARSE = Workspace(distance_min=2.0, distance_max=6.0, polar_min=0.8, distance_step=0.2, angle_step=float(np.pi / 30))
WALL = Box(centre=(4.0, 0.0, 0.0), size=(9.0, 0.2, 12.0))  # from the people outwards along x: azimuth 0 is in it
CAGE = Obstacles(boxes=(WALL,), cylinders=(Cylinder(centre=(-3.0, 0.0, 0.0), radius=0.4, height=12.0),))
SPACE = FreeSpace.of(COARSE, CAGE)


def viewpoint(*cell: int) -> np.ndarray:
    return COARSE.from_cells(np.array(cell))


def test_free_cells_keep_the_margin_and_hang_together() -> None:
    cells = np.argwhere(SPACE.free)
    places = cartesian(COARSE.from_cells(cells))
    assert (CAGE.clearance(places) >= MARGIN - 1e-6).all()
    assert 0.5 < SPACE.free.mean() < 0.95
    way = SPACE.way(COARSE.from_cells(cells[0]), COARSE.from_cells(cells[-1]), 10_000)
    np.testing.assert_allclose(way[-1], COARSE.from_cells(cells[-1]))


def test_a_part_that_no_way_leads_to_does_not_count() -> None:
    two_walls = Obstacles(boxes=(WALL, Box(centre=(0.0, 4.0, 0.0), size=(0.2, 9.0, 12.0))))
    space = FreeSpace.of(COARSE, two_walls)  # between azimuths 0 and 90 degrees is a part of its own
    azimuth = COARSE.from_cells(np.argwhere(space.free))[:, AZIMUTH]
    assert azimuth.min() > np.pi / 2
    there = space.nearest(np.array([3.0, 1.0, 1.2]))
    assert space.is_free(there) and there[AZIMUTH] > np.pi / 2


def test_no_move_between_free_cells_leads_through_an_obstacle() -> None:
    cells = np.argwhere(SPACE.free)
    here = COARSE.from_cells(cells)[::7]
    there = neighbours(here, COARSE)
    free = SPACE.is_free(there)
    way = cartesian(there) - cartesian(here)[:, None]
    for share in np.linspace(0, 1, 9):
        clearance = CAGE.clearance(cartesian(here)[:, None] + share * way)
        assert (clearance[free] > 0).all()


def test_a_way_is_as_short_as_can_be_and_every_step_a_move() -> None:
    here, goal = viewpoint(5, 4, 3), viewpoint(5, 56, 3)  # on both sides of the wall: 8 moves, were it not there
    way = SPACE.way(here, goal, 10_000)
    cells = COARSE.to_cells(np.concatenate([here[None], way]))
    steps = np.abs(np.diff(cells, axis=0))
    steps[:, AZIMUTH] = np.minimum(steps[:, AZIMUTH], 60 - steps[:, AZIMUTH])
    assert (steps.sum(axis=1) == 1).all() and SPACE.is_free(way).all()
    assert len(way) > 8
    assert len(SPACE.way(here, viewpoint(6, 6, 4), 99)) == 4  # in the open: as many as cells lie between
    assert SPACE.way(here, here, 99).shape == (0, 3)
    assert len(SPACE.way(here, goal, 5)) == 5


def test_the_nearest_free_cell_is_the_place_itself_where_that_is_free() -> None:
    free = np.array([3.1, 0.8, 1.2])
    np.testing.assert_array_equal(SPACE.nearest(free), free)
    near = SPACE.nearest(np.array([[3.1, 0.02, 1.2], [3.1, 2 * np.pi - 0.02, 1.2]]))
    assert SPACE.is_free(near).all() and not SPACE.is_free(np.array([3.1, 0.02, 1.2]))
    away = np.minimum(near[:, AZIMUTH], 2 * np.pi - near[:, AZIMUTH])
    assert (away < 0.4).all()


def test_a_camera_on_the_grid_gets_wherever_a_way_leads_and_never_too_near() -> None:
    rng = np.random.default_rng(0)
    cells = COARSE.from_cells(np.argwhere(SPACE.free))
    here, target = cells[rng.integers(len(cells), size=(2, 60))]
    target[:20, AZIMUTH] = rng.uniform(-0.1, 0.1, 20)  # in the wall
    motion = GridMotion(workspace=COARSE)
    motion.keep_clear(Surroundings(CAGE))
    motion.reset(here, 0.04)
    before, shortest = (
        here,
        np.array([len(SPACE.way(a, b, 999)) for a, b in zip(here, SPACE.nearest(target), strict=True)]),
    )
    for _ in range(int(shortest.max())):
        reached = motion.advance(target)
        assert SPACE.is_free(reached).all()
        made = np.abs(neighbours(before, COARSE) - reached[:, None]).max(axis=-1).min(axis=-1)
        assert (made < 1e-9).all()
        before = reached
    np.testing.assert_array_equal(COARSE.to_cells(reached), COARSE.to_cells(SPACE.nearest(target)))


def test_forks_go_the_ways_that_the_camera_would() -> None:
    rng = np.random.default_rng(0)
    cells = COARSE.from_cells(np.argwhere(SPACE.free))
    here, target = cells[rng.integers(len(cells), size=(2, 30))]
    motion = GridMotion(workspace=COARSE)
    motion.keep_clear(Surroundings(CAGE))
    motion.reset(here, 0.04)
    motion.advance(target)
    fork = motion.forked(2)
    goals = np.stack([target, target[::-1]], axis=1).reshape(-1, 3)  # half of the forks turn round
    for _ in range(20):
        tried, gone = fork.advance(goals).reshape(30, 2, 3), motion.advance(target)
        np.testing.assert_array_equal(tried[:, 0], gone)
    assert (tried[:, 1] != gone).any(axis=1).mean() > 0.8


def test_in_the_open_a_camera_moves_as_without_obstacles() -> None:
    far = Surroundings(Obstacles(cylinders=(Cylinder(centre=(0.0, 0.0, -1.0), radius=0.1, height=0.1),)))
    rng = np.random.default_rng(1)
    here, target = COARSE.from_cells(rng.integers(0, COARSE.cells, (2, 20, 3)))
    motion, plain = GridMotion(workspace=COARSE), GridMotion(workspace=COARSE)
    motion.keep_clear(far)
    for body in (motion, plain):
        body.reset(here, 0.04)
    for _ in range(30):
        np.testing.assert_array_equal(motion.advance(target), plain.advance(target))


def test_a_camera_whose_people_walk_is_pushed_along_and_keeps_clear() -> None:
    frames = 60
    moved = np.zeros((2, frames, 3))
    moved[:, :, 0] = np.linspace(0, 2.0, frames)  # towards the pillar ahead, 3 cm a frame
    pillar = Obstacles(cylinders=(Cylinder(centre=(4.0, 0.0, 0.0), radius=0.4, height=12.0),))
    around = Surroundings(pillar, moved)
    motion = GridMotion(workspace=COARSE)
    motion.keep_clear(around)
    here = np.array([viewpoint(2, 0, 7), viewpoint(2, 30, 7)])
    motion.reset(here, 0.04)
    for frame in range(1, frames):
        reached = motion.advance(here)
        assert (around.clearance(reached, frame) >= MARGIN - 1e-6).all()
    assert not np.array_equal(reached[0], here[0])
    np.testing.assert_array_equal(reached[1], here[1])


def test_moves_that_lead_to_no_free_cell_have_no_effect() -> None:
    here = COARSE.from_cells(np.argwhere(SPACE.free))[::11]
    moves = np.random.default_rng(0).integers(HOVER, size=len(here))
    after = SPACE.after(here, moves)
    there = apply_moves(here, moves, COARSE)
    stayed = (after == here).all(axis=1)
    assert SPACE.is_free(after).all()
    assert (stayed | (after == there).all(axis=1)).all()
    assert stayed.any() and (~stayed).any()


def test_the_room_is_large_and_its_ways_lead_around_its_pillars() -> None:
    space = ROOM.free_space
    assert space is not None and 0.2 < space.free.mean() < 0.3
    assert replace(ROOM, name="other").free_space is space  # it is found once
    level = replace(ROOM.workspace, polar_min=1.3)
    pillared = FreeSpace.of(level, Obstacles(cylinders=(Cylinder(centre=(8.0, 0, 0), radius=1.0, height=20.0),)))
    here, goal = level.from_cells(np.array([[30, 90, 2], [30, 10, 2]]))
    assert (move_towards(here, goal, level) != HOVER).all()
    way = pillared.way(here, goal, 99)
    assert np.ptp(way[:, 0]) > 0.5 and (way[-1] == pillared.nearest(goal)).all()


@pytest.mark.parametrize("size", [0.5, 1.0])
def test_a_thin_pillar_is_not_jumped_over_by_long_steps(size: float) -> None:
    space = Workspace(distance_min=5, distance_max=15, distance_step=size, angle_step=float(np.radians(6)))
    pillar = Obstacles(cylinders=(Cylinder(centre=(14.0, 0.7, 0.0), radius=0.05, height=40.0),))
    free = FreeSpace.of(space, pillar)
    here = space.from_cells(np.argwhere(free.free))
    there = neighbours(here, space)
    crossed = pillar.cylinders[0].cuts(coordinates(cartesian(here)[:, None]), coordinates(cartesian(there)))
    assert not (crossed & free.is_free(there)).any()


def test_nobody_can_write_into_a_space_that_motions_and_planners_share() -> None:
    assert FreeSpace.of(COARSE, CAGE) is FreeSpace.of(COARSE, CAGE)
    with pytest.raises(ValueError, match="cannot set WRITEABLE"):
        SPACE.free.flags.writeable = True
