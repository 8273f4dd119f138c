"""Where training cameras stand and how they move."""

import numpy as np
import pytest

from ehar.conditions import REGIMES
from ehar.errors import UsageError
from ehar.viewpoint import AZIMUTH, MOVES
from ehar.world import PAPER
from recognition.training.views import STATIC_SHARE, paper_viewpoints, training_viewpoints


def test_the_paper_has_32_viewpoints_spread_over_the_starts() -> None:
    views = paper_viewpoints(PAPER.workspace)
    assert views.shape == (32, 3)
    assert len(np.unique(views, axis=0)) == 32
    farthest = PAPER.workspace.from_cells(np.array(PAPER.start_cells) - 1)
    assert (views > np.array([5, 0, 0])).all()
    assert (views < farthest).all()
    for axis, values in enumerate((2, 8, 2)):
        chosen, counts = np.unique(views[:, axis], return_counts=True)
        assert len(chosen) == values
        assert (counts == 32 // values).all()
        np.testing.assert_allclose(np.diff(chosen), np.diff(chosen)[0])


def test_paper_clips_stand_still_on_all_of_the_grid() -> None:
    viewpoints = training_viewpoints("paper", PAPER, np.random.default_rng(0), 500, 5)
    assert viewpoints.shape == (500, 5, 3)
    assert (viewpoints == viewpoints[:, :1]).all()
    np.testing.assert_array_equal(
        np.unique(viewpoints[:, 0], axis=0), np.unique(paper_viewpoints(PAPER.workspace), axis=0)
    )


def test_moving_clips_make_grid_moves_inside_the_workspace() -> None:
    viewpoints = training_viewpoints("moving", PAPER, np.random.default_rng(0), 400, 120)
    assert PAPER.workspace.contains(viewpoints).all()
    np.testing.assert_allclose(viewpoints, PAPER.workspace.from_cells(PAPER.workspace.to_cells(viewpoints)))
    steps = np.diff(PAPER.workspace.to_cells(viewpoints), axis=1)
    steps[..., AZIMUTH] = (steps[..., AZIMUTH] + 100 // 2) % 100 - 100 // 2
    assert (np.abs(steps).sum(axis=-1) <= 1).all()
    made = {tuple(step) for step in np.unique(steps.reshape(-1, 3), axis=0)}
    assert made == {tuple(move) for move in MOVES}
    still = (steps == 0).all(axis=(1, 2))
    assert still.mean() == pytest.approx(STATIC_SHARE, abs=0.08)


def test_moving_cameras_hold_a_move_for_about_ten_frames() -> None:
    viewpoints = training_viewpoints("moving", PAPER, np.random.default_rng(1), 400, 40)
    steps = np.diff(PAPER.workspace.to_cells(viewpoints), axis=1)
    before, after = steps[:, :-1], steps[:, 1:]
    moved = np.abs(before).any(axis=-1) & np.abs(after).any(axis=-1)  # not stopped by a bound
    turned = (before != after).any(axis=-1)[moved]
    assert turned.mean() == pytest.approx(0.1 * 5 / 6, abs=0.012)  # one draw in 6 repeats the move


@pytest.mark.parametrize("regime", REGIMES)
def test_the_generator_decides(regime: str) -> None:
    first, again, other = (training_viewpoints(regime, PAPER, np.random.default_rng(seed), 8, 10) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_an_unknown_regime() -> None:
    with pytest.raises(UsageError, match="unknown --views 'spiral': expected one of moving, paper"):
        training_viewpoints("spiral", PAPER, np.random.default_rng(0), 1, 1)
