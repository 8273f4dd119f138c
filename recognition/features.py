"""What the networks see of a frame: joints and bones in the image, in metres at the centre's depth."""

import torch
from torch import Tensor

from ehar.camera import Camera

JOINT_CHANNELS = 5  # x and y within the person, x and y of the person, confidence
BONE_CHANNELS = 3  # x and y from parent to joint, confidence
CHANNELS = JOINT_CHANNELS + BONE_CHANNELS


def features(joints_2d: Tensor, confidence: Tensor, distance: Tensor, parents: Tensor, camera: Camera) -> Tensor:
    """Return the joint and the bone stream of frames, side by side.

    Pixels are scaled by distance / focal length: the size of a body then does not depend on how far the camera
    stands, only its noise does. Joints are given relative to the mean of the person's seen joints, and that mean
    beside them, so a network need not learn one from the other. What is missing is 0, with confidence 0.

    Args:
        joints_2d: (..., P, J, 2) [px].
        confidence: (..., P, J) in [0, 1], 0 where the joint is missing.
        distance: (...,) from the camera to the centre [m].
        parents: (J,) each joint's neighbour towards the skeleton's centre.
        camera: the intrinsics.

    Returns:
        (..., P, J, CHANNELS).
    """
    middle = joints_2d.new_tensor([camera.width / 2, camera.height / 2])
    scale = (distance / camera.focal_length)[..., None, None, None]
    metres = (joints_2d - middle) * scale
    seen = (confidence > 0).to(metres.dtype)[..., None]
    person = (metres * seen).sum(dim=-2, keepdim=True) / seen.sum(dim=-2, keepdim=True).clamp(min=1)
    within = (metres - person) * seen
    bone_confidence = torch.minimum(confidence, confidence[..., parents])[..., None]
    bone = (metres - metres[..., parents, :]) * (bone_confidence > 0)
    return torch.cat([within, person.expand_as(metres), confidence[..., None], bone, bone_confidence], dim=-1)
