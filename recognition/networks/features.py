"""The features of a frame: joints, bones and partners in the image, in metres at the centre's depth; and the view."""

import torch
from torch import Tensor

from ehar.camera import Camera

JOINT_CHANNELS = 5  # x and y within the person, x and y of the person, confidence
BONE_CHANNELS = 3  # x and y from parent to joint, confidence
PARTNER_CHANNELS = 2  # x and y to the same joint of the other persons, where there are any
VIEW_CHANNELS = 2  # the camera's polar angle, and the logarithm of its distance


def channel_count(persons: int, *, view: bool) -> int:
    """Return the number C of features of a joint in scenes of P persons, with or without those of the view."""
    return JOINT_CHANNELS + BONE_CHANNELS + (PARTNER_CHANNELS if persons > 1 else 0) + (VIEW_CHANNELS if view else 0)


def with_view(seen: Tensor, viewpoint: Tensor) -> Tensor:
    """Return features (..., P, J, C) with the view's behind those of every joint: (..., P, J, C + 2).

    From far away joints are noisy, and from above people look flat: a network that knows where the camera is can tell
    what to expect. The azimuth is left out, since people may face any way.

    Args:
        seen: (..., P, J, C), what `features` returns.
        viewpoint: (..., 3), distance [m], azimuth and polar angle [rad].
    """
    view = torch.stack([viewpoint[..., 2], viewpoint[..., 0].log()], dim=-1)
    return torch.cat([seen, view[..., None, None, :].expand(*seen.shape[:-1], VIEW_CHANNELS)], dim=-1)


def features(joints_2d: Tensor, confidence: Tensor, distance: Tensor, parents: Tensor, camera: Camera) -> Tensor:
    """Return the joint, bone and partner streams of frames, side by side.

    Pixels are scaled by distance / focal length. The size of a body then does not depend on the camera's distance;
    only its noise does. Joints are given relative to the mean of the person's seen joints. That mean is given beside
    them, so a network need not learn one from the other. The network takes one person at a time. So in scenes of
    several persons, each joint also gets the vector to the same joint of the others. Without this vector, the network
    could not see what two persons do to each other. A missing value is 0, with confidence 0.

    Args:
        joints_2d: (..., P, J, 2) [px].
        confidence: (..., P, J) in [0, 1], 0 where the joint is missing.
        distance: (...,), the distance from the camera to the centre [m].
        parents: (J,) each joint's neighbour towards the skeleton's centre.
        camera: the intrinsics.

    Returns:
        (..., P, J, C), C = `channel_count(P, view=False)`.
    """
    middle = joints_2d.new_tensor([camera.width / 2, camera.height / 2])
    scale = (distance / camera.focal_length)[..., None, None, None]
    metres = (joints_2d - middle) * scale
    seen = (confidence > 0).to(metres.dtype)[..., None]
    person = (metres * seen).sum(dim=-2, keepdim=True) / seen.sum(dim=-2, keepdim=True).clamp(min=1)
    within = (metres - person) * seen
    bone_confidence = torch.minimum(confidence, confidence[..., parents])[..., None]
    bone = (metres - metres[..., parents, :]) * (bone_confidence > 0)
    streams = [within, person.expand_as(metres), confidence[..., None], bone, bone_confidence]
    if metres.shape[-3] > 1:
        seen_others = seen.sum(dim=-3, keepdim=True) - seen
        others = ((metres * seen).sum(dim=-3, keepdim=True) - metres * seen) / seen_others.clamp(min=1)
        streams.append((others - metres) * seen * (seen_others > 0))
    return torch.cat(streams, dim=-1)
