"""From the image of a real camera to the image that the recogniser's camera would take from there."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.camera import Camera, look_at_rotation
from ehar.viewpoint import AZIMUTH, DISTANCE, POLAR, spherical
from eval.live.messages import CameraPose

STEEP = 1e-6  # sine of the angle to straight above below which a place has no azimuth
BEHIND = 0.05  # share of a ray's length that has to lie before the camera


def viewpoint_of(position: FloatArray, azimuth: float = 0.0) -> FloatArray:
    """Return the viewpoint (3,) of a place in the people's frame (3,) [m].

    Args:
        position: the place.
        azimuth: the azimuth of a place straight above [rad].
    """
    viewpoint = spherical(np.asarray(position, dtype=np.float64))
    if np.sin(viewpoint[POLAR]) < STEEP:
        viewpoint[AZIMUTH] = azimuth % (2 * np.pi)
    return viewpoint


def looked_from(pose: CameraPose, before: FloatArray | None) -> tuple[FloatArray, FloatArray]:
    """Return the viewpoint (3,) of a pose, and one from which a camera that looks at the people looks as it does.

    Args:
        pose: the pose.
        before: (3,), the viewpoint before; None if there is none.
    """
    azimuth = 0.0 if before is None else float(before[AZIMUTH])
    if pose.yaw is None or pose.pitch is None:
        viewpoint = viewpoint_of(np.array(pose.position), azimuth)
        return viewpoint, viewpoint
    viewpoint = viewpoint_of(np.array(pose.position), pose.yaw - np.pi)
    return viewpoint, np.array([viewpoint[DISTANCE], pose.yaw - np.pi, pose.pitch + np.pi / 2])


def centred(
    joints: FloatArray, viewpoint: FloatArray, looking: FloatArray, image: Camera | None, camera: Camera
) -> FloatArray:
    """Return joints as a camera that looks at the people would see them.

    Nothing but the camera's turn and its lens is undone, so no depth is needed.

    Args:
        joints: (P, J, 3): x [px], y [px] and confidence in the real image.
        viewpoint: (3,), where the camera is.
        looking: (3,), a viewpoint from which a camera that looks at the people looks as the real one does.
        image: the real camera; None means as the recogniser's.
        camera: the recogniser's camera.
    """
    if looking is viewpoint and (image is None or image == camera):
        return joints
    real = image or camera
    rays = np.ones((*joints.shape[:-1], 3))
    rays[..., :2] = (joints[..., :2] - (real.width / 2, real.height / 2)) / real.focal_length
    rays = rays @ look_at_rotation(looking) @ look_at_rotation(viewpoint).T
    depth = rays[..., 2:]
    before = depth > BEHIND * np.linalg.norm(rays, axis=-1, keepdims=True)
    moved = rays[..., :2] / np.where(before, depth, 1.0) * camera.focal_length + (camera.width / 2, camera.height / 2)
    return np.concatenate([moved, joints[..., 2:] * before], axis=-1)
