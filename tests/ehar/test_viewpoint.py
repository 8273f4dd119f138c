"""Viewpoints: the start grid, the 7 moves at every bound and at the pole, wrapping."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ehar.viewpoint import (
    AZIMUTH,
    HOVER,
    MOVE_NAMES,
    MOVES,
    apply_moves,
    away_from,
    cartesian,
    neighbours,
    spherical,
    turned,
    wrap_azimuth,
    wrap_difference,
)
from ehar.world import PAPER as PAPER_WORLD

PAPER = PAPER_WORLD.workspace
START_CELLS = np.array(PAPER_WORLD.start_cells)
FARTHEST, LEVEL = 100, 25  # cells of 15 m and of pi/2

cells_inside = st.tuples(st.integers(0, FARTHEST), st.integers(0, 99), st.integers(0, LEVEL)).map(np.array)


def move(cell: tuple[int, int, int], name: str) -> list[int]:
    """Return the cell that a move leads to."""
    there = apply_moves(PAPER.from_cells(np.array(cell)), np.array(MOVE_NAMES.index(name)), PAPER)
    return PAPER.to_cells(there).tolist()


def test_the_start_grid_is_the_paper_s_250_000_viewpoints() -> None:
    cells = np.stack(np.meshgrid(*map(np.arange, START_CELLS), indexing="ij"), axis=-1).reshape(-1, 3)
    viewpoints = PAPER.from_cells(cells)
    assert len(np.unique(viewpoints.round(6), axis=0)) == 250_000
    assert PAPER.contains(viewpoints).all()
    np.testing.assert_array_equal(PAPER.to_cells(viewpoints), cells)
    np.testing.assert_allclose(viewpoints[0], [5.0, 0.0, 0.0])
    np.testing.assert_allclose(viewpoints[-1], [14.9, 99 * np.radians(3.6), 24 * np.radians(3.6)])


def test_sampled_starts_are_on_the_grid_and_reach_all_of_it() -> None:
    starts = PAPER_WORLD.sample_starts(np.random.default_rng(0), 20_000)
    cells = PAPER.to_cells(starts)
    np.testing.assert_allclose(PAPER.from_cells(cells), starts, atol=1e-12)
    assert cells.min(axis=0).tolist() == [0, 0, 0]
    assert cells.max(axis=0).tolist() == [99, 99, 24]
    np.testing.assert_allclose(cells.mean(axis=0), (START_CELLS - 1) / 2, rtol=0.02)
    np.testing.assert_array_equal(starts, PAPER_WORLD.sample_starts(np.random.default_rng(0), 20_000))


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("distance+", [51, 10, 12]),
        ("distance-", [49, 10, 12]),
        ("azimuth+", [50, 11, 12]),
        ("azimuth-", [50, 9, 12]),
        ("polar+", [50, 10, 13]),
        ("polar-", [50, 10, 11]),
        ("hover", [50, 10, 12]),
    ],
)
def test_each_move_changes_one_coordinate_by_one_step(name: str, expected: list[int]) -> None:
    assert move((50, 10, 12), name) == expected


def test_steps_are_a_tenth_of_a_metre_and_3_6_degrees() -> None:
    there = neighbours(PAPER.from_cells(np.array([50, 10, 12])), PAPER)
    np.testing.assert_allclose(
        there - there[HOVER], MOVES * [PAPER.distance_step, PAPER.angle_step, PAPER.angle_step], rtol=0, atol=1e-12
    )
    assert PAPER.distance_step == pytest.approx(0.1)
    assert np.degrees(PAPER.angle_step) == pytest.approx(3.6)


@pytest.mark.parametrize(
    ("cell", "name"),
    [
        ((0, 10, 12), "distance-"),
        ((FARTHEST, 10, 12), "distance+"),
        ((50, 10, 0), "polar-"),
        ((50, 10, LEVEL), "polar+"),
    ],
)
def test_a_move_out_of_the_workspace_hovers(cell: tuple[int, int, int], name: str) -> None:
    assert move(cell, name) == list(cell)


@pytest.mark.parametrize(
    ("cell", "name", "expected"),
    [
        ((99, 10, 12), "distance+", [FARTHEST, 10, 12]),
        ((50, 10, 24), "polar+", [50, 10, LEVEL]),
        ((50, 99, 12), "azimuth+", [50, 0, 12]),
        ((50, 0, 12), "azimuth-", [50, 99, 12]),
    ],
)
def test_bounds_can_be_reached_and_the_azimuth_wraps(
    cell: tuple[int, int, int], name: str, expected: list[int]
) -> None:
    assert move(cell, name) == expected


def test_at_the_pole_an_azimuth_move_turns_the_camera_and_leaves_it_in_place() -> None:
    pole = PAPER.from_cells(np.array([50, 10, 0]))
    turned = apply_moves(pole, np.array(MOVE_NAMES.index("azimuth+")), PAPER)
    assert turned[AZIMUTH] - pole[AZIMUTH] == pytest.approx(PAPER.angle_step)
    np.testing.assert_allclose(cartesian(turned), [0, 0, 10], atol=1e-12)


@given(cells_inside, st.integers(0, 6))
def test_moves_stay_inside_and_are_undone_by_their_opposites(cell: np.ndarray, index: int) -> None:
    here = PAPER.from_cells(cell)
    there = apply_moves(here, np.array(index), PAPER)
    assert PAPER.contains(there)
    assert 0 <= there[AZIMUTH] < 2 * np.pi
    opposite = {0: 1, 1: 0, 2: 3, 3: 2, 4: 5, 5: 4, 6: 6}[index]
    if not np.array_equal(there, here):
        np.testing.assert_array_equal(PAPER.to_cells(apply_moves(there, np.array(opposite), PAPER)), cell)


@given(st.floats(-100, 100))
@example(float(np.nextafter(-np.pi, -4)))
@example(float(np.nextafter(2 * np.pi, 0)))
def test_wrapping(angle: float) -> None:
    wrapped, difference = wrap_azimuth(np.array(angle)), wrap_difference(np.array(angle))
    assert 0 <= wrapped < 2 * np.pi
    assert -np.pi <= difference < np.pi
    for same in (wrapped, difference):
        assert np.cos(same - angle) == pytest.approx(1)


def test_wrapping_just_below_zero_gives_less_than_a_full_turn() -> None:
    assert wrap_azimuth(np.array(-1e-20)) == 0.0


def test_cartesian_reads_the_polar_angle_from_straight_above() -> None:
    np.testing.assert_allclose(cartesian(np.array([5.0, 1.0, 0.0])), [0, 0, 5], atol=1e-12)
    np.testing.assert_allclose(cartesian(np.array([5.0, 0.0, np.pi / 2])), [5, 0, 0], atol=1e-12)
    np.testing.assert_allclose(cartesian(np.array([5.0, np.pi / 2, np.pi / 2])), [0, 5, 0], atol=1e-12)


@given(st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-50, 50)).map(np.array))
def test_clip_gives_viewpoints_inside_and_leaves_those_inside(viewpoint: np.ndarray) -> None:
    clipped = PAPER.clip(viewpoint)
    assert PAPER.contains(clipped)
    np.testing.assert_allclose(PAPER.clip(clipped), clipped)


@given(st.floats(0.1, 20), st.floats(0, 2 * np.pi - 1e-6), st.floats(0.01, np.pi - 0.01))
def test_a_place_in_space_is_the_viewpoint_that_it_came_from(distance: float, azimuth: float, polar: float) -> None:
    viewpoint = np.array([distance, azimuth, polar])
    back = spherical(cartesian(viewpoint))
    np.testing.assert_allclose(wrap_difference(back - viewpoint), 0, atol=1e-6)


@pytest.mark.filterwarnings("error")
def test_the_centre_itself_is_a_viewpoint() -> None:
    np.testing.assert_array_equal(spherical(np.zeros((2, 3))), [[0, 0, np.pi / 2]] * 2)


def test_the_nearest_cell_of_what_lies_outside_is_one_at_the_edge() -> None:
    outside = np.array([[99.0, 0.0, 3.0], [0.0, 0.0, -1.0]])
    assert PAPER.to_cells(outside).tolist() == [[FARTHEST, 0, LEVEL], [0, 0, 0]]


def test_turning_takes_one_direction_to_the_other_and_keeps_what_is_square_to_both() -> None:
    rng = np.random.default_rng(0)
    begin, end = rng.normal(size=(2, 50, 3))
    square = np.cross(begin, end)
    third = rng.normal(size=(50, 3))
    held = np.stack([begin, square, third], axis=1)
    found = turned(held[:, None], begin, end)[:, 0]
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), np.linalg.norm(held, axis=-1))
    lengths = np.linalg.norm(begin, axis=-1) / np.linalg.norm(end, axis=-1)
    np.testing.assert_allclose(found[:, 0], end * lengths[:, None])
    np.testing.assert_allclose(found[:, 1], square)
    # A turn keeps angles and sides.
    np.testing.assert_allclose((found[:, 0] * found[:, 2]).sum(axis=-1), (begin * third).sum(axis=-1))
    np.testing.assert_allclose(np.linalg.det(found), np.linalg.det(held))


def test_the_distance_is_that_from_what_a_camera_looks_at() -> None:
    found = away_from(np.array([5.0, 0.0, np.pi / 2]), np.array([2.0, 4.0, 0.0]))
    np.testing.assert_allclose(found, [5.0, 0.0, np.pi / 2])
    found = away_from(np.array([5.0, 0.0, np.pi / 2]), np.array([5.0, 0.0, 1.5]))
    np.testing.assert_allclose(found, [1.5, 0.0, np.pi / 2])
