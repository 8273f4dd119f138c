"""Grid motion: which of the 7 moves a target means."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.motion import GridMotion, move_towards
from ehar.viewpoint import HOVER, MOVE_NAMES, Workspace, neighbours

PAPER = Workspace()
cells_inside = st.tuples(st.integers(0, 100), st.integers(0, 99), st.integers(0, 25)).map(np.array)


def named_move(viewpoint: np.ndarray, target: np.ndarray) -> str:
    """Return the name of the move from a viewpoint towards a target."""
    return MOVE_NAMES[int(move_towards(viewpoint, target, PAPER))]


@given(cells_inside)
def test_a_target_at_a_neighbouring_cell_makes_exactly_that_move(cell: np.ndarray) -> None:
    here = PAPER.from_cells(cell)
    for target in neighbours(here, PAPER):
        motion = GridMotion()
        motion.reset(here[None], frame_time=0.04)
        np.testing.assert_allclose(motion.advance(target[None])[0], target, atol=1e-12)


@given(cells_inside, st.tuples(*[st.floats(-0.5, 0.5)] * 3).map(np.array))
def test_hover_within_half_a_cell(cell: np.ndarray, share: np.ndarray) -> None:
    here = PAPER.from_cells(cell)
    assert move_towards(here, here + share * PAPER.step, PAPER) == HOVER


@given(cells_inside, cells_inside)
def test_every_step_brings_the_camera_one_cell_nearer(start: np.ndarray, end: np.ndarray) -> None:
    motion = GridMotion()
    motion.reset(PAPER.from_cells(start)[None], frame_time=0.04)
    azimuth = abs(int(end[1]) - int(start[1]))
    cells_apart = abs(end[0] - start[0]) + min(azimuth, 100 - azimuth) + abs(end[2] - start[2])
    viewpoint = PAPER.from_cells(start)[None]
    for _ in range(cells_apart):
        viewpoint = motion.advance(PAPER.from_cells(end)[None])
    np.testing.assert_array_equal(PAPER.to_cells(viewpoint)[0], end)
    np.testing.assert_array_equal(motion.advance(PAPER.from_cells(end)[None]), viewpoint)


def test_the_azimuth_turns_the_short_way_round() -> None:
    here = PAPER.from_cells(np.array([50, 2, 12]))
    assert named_move(here, PAPER.from_cells(np.array([50, 95, 12]))) == "azimuth-"
    assert named_move(here, PAPER.from_cells(np.array([50, 45, 12]))) == "azimuth+"
    assert named_move(here, here + np.array([0, 2 * np.pi * 3 - 0.3, 0])) == "azimuth-"


def test_the_largest_error_in_cells_goes_first_and_the_first_axis_of_equal_ones() -> None:
    here = PAPER.from_cells(np.array([50, 2, 12]))
    assert named_move(here, here + np.array([3, 0, -4]) * PAPER.step) == "polar-"
    assert named_move(here, here + np.array([3, 3, -3]) * PAPER.step) == "distance+"


@pytest.mark.parametrize("target", [[100.0, 0.0, 0.0], [-100.0, 0.0, 3.0]])
def test_a_target_outside_leads_to_the_bound_and_no_farther(target: list[float]) -> None:
    motion = GridMotion()
    motion.reset(PAPER.from_cells(np.array([[50, 0, 12]])), frame_time=0.04)
    for _ in range(200):
        viewpoint = motion.advance(np.array([target]))
    assert PAPER.contains(viewpoint).all()
    assert viewpoint[0, 0] == pytest.approx(15.0 if target[0] > 0 else 5.0)
    assert viewpoint[0, 2] == pytest.approx(0.0 if target[2] == 0 else np.pi / 2)


def test_episodes_move_each_by_themselves() -> None:
    motion = GridMotion()
    starts = PAPER.from_cells(np.array([[50, 0, 12], [20, 99, 0]]))
    motion.reset(starts, frame_time=0.04)
    reached = motion.advance(starts + np.array([[1.0, 0, 0], [0, 1.0, 0]]))
    np.testing.assert_array_equal(PAPER.to_cells(reached), [[51, 0, 12], [20, 0, 0]])
    np.testing.assert_array_equal(PAPER.to_cells(starts), [[50, 0, 12], [20, 99, 0]])
