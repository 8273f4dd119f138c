"""What is shown of a frame, by hand."""

import numpy as np
import pytest

from ehar.camera import Camera
from ehar.envs.controls import GridControls
from ehar.envs.environment import EpisodeVectorEnv
from ehar.envs.observations import scaled_viewpoint, shown
from ehar.envs.task import EpisodeTask
from ehar.sensors.perfect import PerfectSensor
from ehar.viewpoint import Workspace
from tests.helpers.fakes import FakeRecogniser, tiny_scenarios

PAPER = Workspace()


def test_a_frame_by_hand() -> None:
    camera = Camera(width=800, height=600)
    seen = shown(
        joints_2d=np.array([[[[400.0, 300.0], [800.0, 300.0], [0.0, 0.0]]]]),
        confidence=np.array([[[1.0, 0.3, 0.0]]]),
        viewpoint=np.array([[7.5, np.pi / 2, np.pi / 4]]),
        log_probs=np.log([[0.25, 0.75]]),
        embedding=np.array([[3.0, -4.0, 5.0]]),
        ratio=0.4,
        workspace=PAPER,
        camera=camera,
    )
    # From the image centre in half image widths, in both directions.
    np.testing.assert_allclose(seen["joints"], [[[[0, 0], [1, 0], [-1, -0.75]]]])
    np.testing.assert_allclose(seen["confidence"], [[[1, 0.3, 0]]])
    np.testing.assert_allclose(seen["viewpoint"], [[0.25, 1, 0, 0.5]], atol=1e-7)
    np.testing.assert_allclose(seen["probabilities"], [[0.25, 0.75]])
    np.testing.assert_allclose(seen["embedding"], [[3, -4, 5]])
    np.testing.assert_allclose(seen["ratio"], [[0.4]])
    assert {array.dtype for array in seen.values()} == {np.dtype(np.float32)}


def test_log_probabilities_that_round_above_0_are_shown_as_certainty() -> None:
    viewpoint = np.array([[5.0, 0.0, 0.0]])
    nothing = {"joints_2d": np.zeros((1, 1, 1, 2)), "confidence": np.ones((1, 1, 1)), "embedding": np.zeros((1, 1))}
    log_probs = np.array([[1e-6, -np.inf]])
    seen = shown(**nothing, viewpoint=viewpoint, log_probs=log_probs, ratio=1.0, workspace=PAPER, camera=Camera())
    assert seen["probabilities"].tolist() == [[1, 0]]


@pytest.mark.parametrize(
    ("viewpoint", "expected"),
    [
        ([5.0, 0.0, 0.0], [0, 0, 1, 0]),
        ([15.0, np.pi, np.pi / 2], [1, 0, -1, 1]),
        ([10.0, 3 * np.pi / 2, np.pi / 4], [0.5, -1, 0, 0.5]),
        ([4.9, 0.0, -0.1], [0, 0, 1, 0]),  # rounding may lead a hair outside
        ([15.1, 2 * np.pi, 1.6], [1, 0, 1, 1]),
    ],
)
def test_viewpoints_are_scaled_over_the_workspace(viewpoint: list[float], expected: list[float]) -> None:
    np.testing.assert_allclose(scaled_viewpoint(np.array([viewpoint]), PAPER), [expected], atol=1e-6)


def test_a_full_turn_is_the_same_place_and_a_workspace_without_room_is_no_division_by_0() -> None:
    turned = scaled_viewpoint(np.array([[7.0, 0.3, 1.0], [7.0, 0.3 + 2 * np.pi, 1.0]]), PAPER)
    np.testing.assert_allclose(turned[0], turned[1], atol=1e-6)
    fixed = Workspace(distance_min=7.0, distance_max=7.0, polar_min=1.0, polar_max=1.0)
    np.testing.assert_allclose(scaled_viewpoint(np.array([[7.0, 0.0, 1.0]]), fixed), [[0, 0, 1, 0]])


def test_the_environment_scales_by_its_own_camera() -> None:
    scenarios = tiny_scenarios()
    half = Camera(width=320, height=240, focal_length=Camera().focal_length * 320 / Camera().width)
    seen = []
    for camera in (Camera(), half):
        sensor = PerfectSensor(camera=camera)
        env = EpisodeVectorEnv(
            4, EpisodeTask(scenarios=scenarios, recogniser=FakeRecogniser(), sensor=sensor, controls=GridControls())
        )
        seen.append(env.reset(seed=0)[0]["joints"])
    np.testing.assert_allclose(seen[0], seen[1], atol=1e-5)  # the same angle of view, so the same to an agent
