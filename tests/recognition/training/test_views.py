"""Where training cameras stand and how they move."""

from dataclasses import replace

import numpy as np
import pytest

from ehar.camera import Camera, project
from ehar.errors import UsageError
from ehar.obstacles.shapes import Cylinder, Obstacles
from ehar.viewpoint import AZIMUTH, MOVES, cartesian
from ehar.world import PAPER, ROOM
from recognition.training.views import STATIC_SHARE, paper_viewpoints, recorded_viewpoints, training_viewpoints


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


def test_paper_clips_are_seen_from_where_nothing_stands() -> None:
    space, everywhere = ROOM.free_space, paper_viewpoints(ROOM.workspace)
    assert space is not None
    free = everywhere[space.is_free(everywhere)]
    assert 0 < len(free) < len(everywhere)
    drawn = training_viewpoints("paper", ROOM, np.random.default_rng(0), 500, 2)
    np.testing.assert_array_equal(np.unique(drawn[:, 0], axis=0), np.unique(free, axis=0))


def test_a_world_that_leaves_none_of_the_papers_viewpoints_free() -> None:
    pillars = tuple(
        Cylinder(centre=tuple(place), radius=0.5, height=0.5) for place in cartesian(paper_viewpoints(PAPER.workspace))
    )
    full = replace(PAPER, name="full", obstacles=Obstacles(cylinders=pillars))
    with pytest.raises(UsageError, match="expected one of its 32 viewpoints clear of obstacles in full, got none"):
        training_viewpoints("paper", full, np.random.default_rng(0), 1, 2)


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


@pytest.mark.parametrize("regime", ["moving", "paper"])
def test_the_generator_decides(regime: str) -> None:
    first, again, other = (training_viewpoints(regime, PAPER, np.random.default_rng(seed), 8, 10) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_an_unknown_regime() -> None:
    with pytest.raises(UsageError, match="unknown --views 'spiral': expected moving or paper"):
        training_viewpoints("spiral", PAPER, np.random.default_rng(0), 1, 1)


def test_the_camera_that_recorded_is_where_its_frame_begins() -> None:
    centres = np.array([[0.2, 2.5, -0.3], [-1.0, 3.0, 0.4]], dtype=np.float32)  # people, as two cameras see them
    viewpoints = recorded_viewpoints(centres, 7)
    assert viewpoints.shape == (2, 7, 3)
    np.testing.assert_allclose(cartesian(viewpoints), np.repeat(-centres[:, None], 7, axis=1), atol=1e-6)


def test_a_turned_camera_sees_people_at_the_same_angles() -> None:
    rng = np.random.default_rng(0)
    people = np.array([0.3, 2.5, -0.2]) + rng.uniform(-0.5, 0.5, size=(1, 9, 3))
    centre = people.mean(axis=(0, 1))
    camera = Camera(width=640, height=480, focal_length=525)
    pixels, _ = project(people - centre, recorded_viewpoints(centre[None], 1)[0, 0], camera)
    rays = np.concatenate([(pixels - [320, 240]) / 525, np.ones((1, 9, 1))], axis=2)
    seen, straight = (ways / np.linalg.norm(ways, axis=1)[:, None] for ways in (rays[0], people[0]))
    np.testing.assert_allclose(seen @ seen.T, straight @ straight.T, atol=1e-5)
