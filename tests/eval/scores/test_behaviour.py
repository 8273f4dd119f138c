from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ehar.arrays import FloatArray, IntArray
from ehar.errors import DataError
from ehar.viewpoint import AZIMUTH, HOVER, MOVES, POLAR, Workspace, apply_moves
from ehar.world import PAPER
from eval.records.episodes import DIGITS, EpisodeRecords
from eval.scores.behaviour import (
    SPHERE_CELLS,
    axes_of,
    from_above,
    level_share,
    move_shares,
    position_histograms,
    recover_moves,
    sphere_density,
)
from tests.helpers.made_records import flown, make_records


def records_of(viewpoint: FloatArray) -> EpisodeRecords:
    episodes = make_records(0, episodes=len(viewpoint), length=viewpoint.shape[1])
    return replace(episodes, viewpoint=viewpoint.round(DIGITS), start=viewpoint[:, 0].round(DIGITS))


def walk(start: FloatArray, moves: IntArray) -> FloatArray:
    """Return the viewpoints (N, M + 1, 3) that moves (N, M) lead to."""
    path = [start]
    for step in moves.T:
        path.append(apply_moves(path[-1], step, Workspace()))
    return np.stack(path, axis=1)


@given(st.integers(0, 2**32 - 1))
def test_moves_are_recovered(seed: int) -> None:
    rng = np.random.default_rng(seed)
    moves = rng.integers(0, len(MOVES), size=(5, 40))
    moves[0] = 2  # round and round, past azimuth 0
    path = walk(PAPER.sample_starts(rng, 5), moves)
    stays = (np.diff(path, axis=1) == 0).all(axis=-1)
    np.testing.assert_array_equal(recover_moves(records_of(path), PAPER.workspace), np.where(stays, HOVER, moves))


def test_a_move_out_of_the_workspace_is_none() -> None:
    path = walk(np.array([[5.0, 0.0, 0.0]]), np.array([[1, 5, 3, 2, 0]]))
    assert recover_moves(records_of(path), PAPER.workspace).tolist() == [[HOVER, HOVER, 3, 2, 0]]


def test_what_is_no_move_is_refused() -> None:
    path = walk(PAPER.workspace.from_cells(np.array([[10, 10, 10], [20, 20, 20]])), np.zeros((2, 5), dtype=int))
    far, off = path.copy(), path.copy()
    far[1, 3:, AZIMUTH] += np.radians(7.2)  # two cells
    off[1, 2, POLAR] += np.radians(1)
    with pytest.raises(DataError, match=r"séquence 0.* from frame 1, frame 2: expected one of the 7 moves"):
        recover_moves(records_of(far), PAPER.workspace)
    with pytest.raises(DataError, match=r"from frame 1, frame 2: expected a camera on the grid"):
        recover_moves(records_of(off), PAPER.workspace)
    with pytest.raises(DataError, match="ideal track"):
        recover_moves(flown(records_of(path)), PAPER.workspace)


def test_shares_of_moves_by_hand() -> None:
    # Two episodes of 7 frames: 6 moves, two in each stage.
    shares = move_shares(np.array([[0, 0, 1, 6, 6, 6], [0, 4, 1, 1, 6, 6]]))
    np.testing.assert_allclose(shares[0], [3 / 12, 3 / 12, 0, 0, 1 / 12, 0, 5 / 12])
    np.testing.assert_allclose(shares[1], [3 / 4, 0, 0, 0, 1 / 4, 0, 0])
    np.testing.assert_allclose(shares[2], [0, 3 / 4, 0, 0, 0, 0, 1 / 4])
    np.testing.assert_allclose(shares[3], [0, 0, 0, 0, 0, 0, 1])


def test_59_moves_fall_into_stages_of_20_20_and_19() -> None:
    for stage, part in ((1, slice(0, 20)), (2, slice(20, 40)), (3, slice(40, 59))):
        moves = np.full((1, 59), HOVER)
        moves[:, part] = 0
        shares = move_shares(moves)[1:, 0]
        assert shares.tolist() == [float(index == stage) for index in (1, 2, 3)]
    with pytest.raises(DataError, match="at least 4 frames"):
        move_shares(np.zeros((1, 2), dtype=int))


def test_bins_hold_as_many_cells_as_each_other() -> None:
    every = np.stack(np.meshgrid(np.arange(101), np.arange(100), np.arange(26), indexing="ij"), axis=-1)
    uniform = PAPER.workspace.from_cells(every.reshape(1, -1, 3))
    histograms = position_histograms(records_of(uniform), PAPER.workspace)
    for axis, histogram in zip(axes_of(PAPER.workspace), histograms, strict=True):
        assert (histogram.density * np.diff(axis.edges)).sum() == pytest.approx(1)
        assert histogram.from_uniform == pytest.approx(0, abs=1e-9)
    assert histograms[0].mean == pytest.approx(10) and histograms[2].mean == pytest.approx(45)
    assert histograms[1].mean is None


def test_histograms_are_in_metres_and_degrees() -> None:
    cells = np.array([[[0, 99, 25], [0, 0, 24], [100, 50, 0], [100, 50, 0]]])
    distance, azimuth, polar = position_histograms(records_of(PAPER.workspace.from_cells(cells)), PAPER.workspace)
    assert np.flatnonzero(distance.density).tolist() == [0, 19]
    np.testing.assert_allclose(distance.density[[0, 19]], [0.5 / 0.5, 0.5 / 0.6])
    np.testing.assert_allclose(azimuth.density[[0, 10, 19]] * 18, [0.25, 0.5, 0.25])
    np.testing.assert_allclose(polar.density[[0, -1]] * 7.2, [0.5, 0.5])
    assert distance.from_uniform == pytest.approx(1 - 5 / 101 - 6 / 101)


def test_azimuths_go_round() -> None:
    records = records_of(np.tile(PAPER.workspace.from_cells(np.array([0, 0, 5])), (1, 3, 1)))
    turned = replace(records, viewpoint=records.viewpoint + np.array([0, 2 * np.pi - 0.01, 0]))
    np.testing.assert_array_equal(
        position_histograms(turned, PAPER.workspace)[1].density,
        position_histograms(records, PAPER.workspace)[1].density,
    )


def test_level_is_from_85_degrees() -> None:
    assert (
        level_share(records_of(PAPER.workspace.from_cells(np.array([[[0, 0, 25], [0, 0, 24], [0, 0, 23], [0, 0, 0]]]))))
        == 0.5
    )


def test_the_middle_is_above_and_the_rim_is_level() -> None:
    points = from_above(np.array([[9, 1.0, 0.0], [9, 0.0, np.pi / 2], [5, np.pi / 2, np.pi / 2]]))
    np.testing.assert_allclose(points, [[0, 0], [1, 0], [0, 1]], atol=1e-12)


def test_even_directions_give_an_even_disc() -> None:
    rng = np.random.default_rng(0)
    polar = np.arccos(rng.random(400_000))  # even over the upper half of the sphere
    viewpoint = np.stack([np.full(len(polar), 9.0), rng.uniform(0, 2 * np.pi, len(polar)), polar], axis=-1)
    density = sphere_density(viewpoint, PAPER.workspace).times_even
    middle = density[SPHERE_CELLS // 4 : -SPHERE_CELLS // 4, SPHERE_CELLS // 4 : -SPHERE_CELLS // 4]
    np.testing.assert_allclose(middle, 1, atol=0.25)
    assert np.isnan(density[0, 0])


def test_all_frames_are_counted() -> None:
    viewpoint = np.tile([9.0, 0.3, 1.0], (4, 7, 1))
    density = sphere_density(viewpoint, PAPER.workspace)
    even = (2 / SPHERE_CELLS) ** 2 / np.pi * 28
    assert np.nansum(density.times_even) * even == np.float64(28)
    row, column = np.unravel_index(np.nanargmax(density.times_even), density.times_even.shape)
    x, y = from_above(viewpoint)[0, 0]
    assert density.edges[column] <= x <= density.edges[column + 1]
    assert density.edges[row] <= y <= density.edges[row + 1]
