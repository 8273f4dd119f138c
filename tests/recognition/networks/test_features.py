"""What the networks see: metres at the centre's depth, relative joints, bones, and zeros for what is missing."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from ehar.camera import Camera, project
from recognition.networks.features import VIEW_CHANNELS, channel_count, features, with_view

PARENTS = torch.tensor([0, 0, 1])  # a chain, its first joint the centre
CAMERA = Camera()
MIDDLE = torch.tensor([CAMERA.width / 2, CAMERA.height / 2])
WITHIN, PERSON, CONFIDENCE, BONE, BONE_CONFIDENCE = slice(0, 2), slice(2, 4), 4, slice(5, 7), 7


def from_metres(metres: list[list[float]], distance: float) -> torch.Tensor:
    """Return the pixels (1, J, 2) of one person's joints in the plane through the centre that faces the camera."""
    return MIDDLE + torch.tensor([metres]) * CAMERA.focal_length / distance


def seen(joints_2d: torch.Tensor, confidence: list[float], distance: float) -> torch.Tensor:
    """Return the features (J, C) of one person."""
    return features(joints_2d, torch.tensor([confidence]), torch.tensor(distance), PARENTS, CAMERA)[0]


def test_joints_bones_and_confidence_by_hand() -> None:
    # The mean of the three joints is (1, 1) m.
    out = seen(from_metres([[0.0, 0.0], [1.0, 0.0], [2.0, 3.0]], 8.5), [0.9, 0.5, 0.7], 8.5)
    assert out.shape == (3, channel_count(1, view=False))
    torch.testing.assert_close(out[:, WITHIN], torch.tensor([[-1.0, -1.0], [0.0, -1.0], [1.0, 2.0]]))
    torch.testing.assert_close(out[:, PERSON], torch.ones(3, 2))
    torch.testing.assert_close(out[:, CONFIDENCE], torch.tensor([0.9, 0.5, 0.7]))
    torch.testing.assert_close(out[:, BONE], torch.tensor([[0.0, 0.0], [1.0, 0.0], [1.0, 3.0]]))
    torch.testing.assert_close(out[:, BONE_CONFIDENCE], torch.tensor([0.9, 0.5, 0.5]))


def test_a_missing_joint_is_zero_and_counts_for_nothing() -> None:
    here = seen(from_metres([[0.0, 0.0], [50.0, -7.0], [2.0, 4.0]], 6.0), [0.8, 0.0, 0.6], 6.0)
    there = seen(from_metres([[0.0, 0.0], [-3.0, 9.0], [2.0, 4.0]], 6.0), [0.8, 0.0, 0.6], 6.0)
    torch.testing.assert_close(here, there)
    assert not here[1, WITHIN].any()
    assert here[1, CONFIDENCE] == 0
    assert not here[1:, BONE].any()  # its own bone, and that of the joint it is the parent of
    assert not here[1:, BONE_CONFIDENCE].any()
    torch.testing.assert_close(here[:, PERSON], torch.tensor([[1.0, 2.0]]).expand(3, 2))


def test_a_person_of_whom_nothing_is_seen_is_all_zero() -> None:
    assert not seen(from_metres([[1.0, 0.0], [2.0, 1.0], [3.0, 1.0]], 7.0), [0.0, 0.0, 0.0], 7.0).any()


@given(near=st.floats(5, 15), far=st.floats(5, 15), azimuth=st.floats(0, 6.28))
def test_distance_does_not_scale_a_body_that_faces_the_camera(near: float, far: float, azimuth: float) -> None:
    polar = np.pi / 2
    right, down = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0]), np.array([0.0, 0.0, -1.0])
    plane = np.array([[0.1, 0.4], [-0.3, 0.2], [0.5, -0.9]])
    positions = (plane[:, :1] * right + plane[:, 1:] * down)[None]
    views = []
    for distance in (near, far):
        pixels, _ = project(positions, np.array([distance, azimuth, polar]), CAMERA)
        views.append(seen(torch.from_numpy(pixels), [1.0, 1.0, 1.0], distance))
    torch.testing.assert_close(views[0], views[1], atol=1e-5, rtol=0)
    torch.testing.assert_close(
        views[0][:, WITHIN], torch.from_numpy(plane - plane.mean(axis=0)).float(), atol=1e-5, rtol=0
    )


@pytest.mark.parametrize("leading", [(4,), (4, 7), (2, 3, 5)])
def test_every_leading_axis_is_a_batch(leading: tuple[int, ...]) -> None:
    draw = torch.Generator().manual_seed(0)
    joints_2d = 1000 * torch.rand((*leading, 2, 3, 2), generator=draw)
    confidence = (torch.rand((*leading, 2, 3), generator=draw) - 0.3).clamp(min=0)
    distance = 5 + 10 * torch.rand(leading, generator=draw)
    whole = features(joints_2d, confidence, distance, PARENTS, CAMERA)
    assert whole.shape == (*leading, 2, 3, channel_count(2, view=False))
    last = (-1,) * len(leading)
    torch.testing.assert_close(
        whole[last], features(joints_2d[last], confidence[last], distance[last], PARENTS, CAMERA)
    )


def test_the_way_to_the_partners_joints_by_hand() -> None:
    metres = torch.tensor([[[0.0, 0.0], [1.0, 0.0]], [[2.0, 1.0], [2.0, 2.0]], [[4.0, 1.0], [9.0, 9.0]]])
    pixels = MIDDLE + metres * CAMERA.focal_length / 8.5
    confidence = torch.tensor([[1.0, 1.0], [1.0, 1.0], [1.0, 0.0]])  # the third person's second joint is missing
    out = features(pixels, confidence, torch.tensor(8.5), torch.tensor([0, 0]), CAMERA)
    assert out.shape == (3, 2, channel_count(3, view=False))
    to_partners = out[..., -2:]
    torch.testing.assert_close(to_partners[:, 0], torch.tensor([[3.0, 1.0], [0.0, -0.5], [-3.0, -0.5]]))
    torch.testing.assert_close(to_partners[:, 1], torch.tensor([[1.0, 2.0], [-1.0, -2.0], [0.0, 0.0]]))


def test_two_persons_who_move_alike_are_told_from_two_who_do_not() -> None:
    # What each does alone is the same in both scenes up to who does it; only the partner stream differs in sum.
    alike = torch.tensor([[[0.0, 0.0]], [[1.0, 0.0]]]), torch.tensor([[[0.5, 0.0]], [[1.5, 0.0]]])
    apart = torch.tensor([[[0.0, 0.0]], [[1.0, 0.0]]]), torch.tensor([[[-0.5, 0.0]], [[1.5, 0.0]]])
    change = []
    for before, after in (alike, apart):
        ways = [
            features(MIDDLE + m * 100, torch.ones(2, 1), torch.tensor(8.5), torch.tensor([0]), CAMERA)[..., -2:]
            for m in (before, after)
        ]
        change.append((ways[1] - ways[0]).abs().sum())
    assert change[0] < 1e-5 < change[1]


def test_the_view_stands_behind_the_features_of_every_joint_without_the_azimuth() -> None:
    seen = torch.randn(4, 2, 3, channel_count(2, view=False), generator=torch.Generator().manual_seed(0))
    viewpoint = torch.tensor([[8.0, azimuth, 1.2] for azimuth in (0.0, 1.0, 2.0, 3.0)])
    out = with_view(seen, viewpoint)
    assert out.shape == (4, 2, 3, channel_count(2, view=True))
    torch.testing.assert_close(out[..., :-VIEW_CHANNELS], seen)
    torch.testing.assert_close(out[..., -VIEW_CHANNELS:], torch.tensor([1.2, float(np.log(8.0))]).expand(4, 2, 3, 2))
