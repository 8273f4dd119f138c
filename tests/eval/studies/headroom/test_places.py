from dataclasses import replace

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.data.scenario import windows
from ehar.errors import UsageError
from ehar.viewpoint import AZIMUTH, DISTANCE, POLAR
from ehar.world import PAPER
from eval.studies.headroom.places import angles_between, placed_around, true_reference, viewpoint_map
from tests.helpers.fakes import POSE, SKELETON, tiny_data

PEOPLE_TURN = np.radians([0.0, 50.0, 180.0, 300.0])


def turned(pose: FloatArray, angle: float) -> FloatArray:
    cosine, sine = np.cos(angle), np.sin(angle)
    rotated: FloatArray = pose @ np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    return rotated


def test_the_map_lies_on_the_grid_from_the_top_to_the_horizon() -> None:
    viewpoints = viewpoint_map(PAPER.workspace, 10.0, 4, 6)
    assert viewpoints.shape == (6, 4, 3)
    np.testing.assert_allclose(viewpoints[..., 0], 10)
    np.testing.assert_allclose(np.degrees(viewpoints[:, 0, POLAR]), [0, 18, 36, 54, 72, 90])
    np.testing.assert_allclose(np.degrees(viewpoints[0, :, AZIMUTH]), [0, 90, 180, 270])


@pytest.mark.parametrize(
    ("distance", "azimuths", "polars"),
    [(4.0, 4, 6), (16.0, 4, 6), (10.0, 0, 6), (10.0, 4, 1), (10.0, 101, 6), (10.0, 4, 27)],
)
def test_a_map_outside_the_workspace_of_nothing_or_of_more_than_the_grid_is_refused(
    distance: float, azimuths: int, polars: int
) -> None:
    with pytest.raises(UsageError, match="expected"):
        viewpoint_map(PAPER.workspace, distance, azimuths, polars)


def test_one_person_is_counted_from_where_he_faces() -> None:
    poses = np.stack([turned(POSE, angle)[None] for angle in PEOPLE_TURN])
    np.testing.assert_allclose(np.exp(1j * true_reference(poses, SKELETON)), np.exp(1j * PEOPLE_TURN), atol=1e-6)


def test_two_people_are_counted_from_the_first_to_the_second() -> None:
    pair = np.stack([POSE, turned(POSE, 2.0) + np.array([-1.0, 1.0, 0.3])])
    np.testing.assert_allclose(np.degrees(true_reference(pair[None], SKELETON)), [135], atol=1e-4)


def test_cameras_turn_with_people_and_stay_on_the_grid() -> None:
    data = tiny_data(sequences=4)
    positions = data.positions.copy()
    for angle, begin, end in zip(PEOPLE_TURN, data.offsets, data.offsets[1:], strict=False):
        positions[begin:end] = turned(positions[begin:end], angle)
    data = replace(data, positions=positions.astype(np.float32))
    places = viewpoint_map(PAPER.workspace, 10.0, 4, 2).reshape(-1, 3)
    around = placed_around(windows(data, np.arange(4), 10, stride=20), places, PAPER.workspace)
    assert around.shape == (4, 8, 3)
    np.testing.assert_allclose(around[..., [DISTANCE, POLAR]], np.broadcast_to(places[:, [0, 2]], (4, 8, 2)))
    wanted = places[None, :, AZIMUTH] + PEOPLE_TURN[:, None]
    off = np.degrees(np.abs(np.angle(np.exp(1j * (around[..., AZIMUTH] - wanted)))))
    assert off.max() < 1.8 + 3  # half a step of the grid, and 1 cm of noise in each joint
    np.testing.assert_allclose(PAPER.workspace.from_cells(PAPER.workspace.to_cells(around)), around)


def test_angles_between_places() -> None:
    front, left, above, aside = np.array([[10.0, 0, np.pi / 2], [6.0, np.pi / 2, np.pi / 2], [10, 0, 0], [10, 2, 0]])
    assert angles_between(front, left) == pytest.approx(90)
    assert angles_between(front, above) == pytest.approx(90)
    assert angles_between(above, aside) == pytest.approx(0, abs=1e-5)
