"""A camera that always looks at the centre of the space of interest: perspective projection to pixels."""

from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import UsageError
from ehar.viewpoint import AZIMUTH, DISTANCE, POLAR

# The paper names no intrinsics. A camera drone's wide lens: 24 mm full-frame equivalent, 74 degrees across.
IMAGE_WIDTH = 1280  # [px]
IMAGE_HEIGHT = 720  # [px]
FOCAL_LENGTH = 850.0  # [px]
MOST_PIXELS = 100_000  # of an image's side; the largest cameras have a tenth
MOST_FOCAL_LENGTH = 1e6  # [px]
NEAR_PLANE = 0.1  # [m]; points that are nearer or behind are projected as if at this depth


@dataclass(frozen=True)
class Camera:
    """Pinhole intrinsics; the principal point is the middle of the image, x points right, y down.

    Args:
        width: image width [px].
        height: image height [px].
        focal_length: focal length [px], the same for both axes.

    Raises:
        UsageError: a number is not above 0, or is too large to be meant.
    """

    width: int = IMAGE_WIDTH
    height: int = IMAGE_HEIGHT
    focal_length: float = FOCAL_LENGTH

    def __post_init__(self) -> None:
        """Check the intrinsics."""
        if not (self.width > 0 and self.height > 0 and 0 < self.focal_length < np.inf):
            raise UsageError(f"camera: expected width, height and focal length above 0, got {self}")
        sides, most = max(self.width, self.height), MOST_FOCAL_LENGTH
        if sides > MOST_PIXELS or self.focal_length > most:
            raise UsageError(
                f"camera: expected at most {MOST_PIXELS} px along a side, and {most:g} px of focal length, got more"
            )

    def __str__(self) -> str:
        """Return the intrinsics in words."""
        return f"{self.width} x {self.height} px, focal length {self.focal_length:g} px"


def look_at_rotation(viewpoint: FloatArray) -> FloatArray:
    """Return rotations world -> camera, (..., 3, 3); rows are the camera's right, down and forward axes.

    Right is the unit tangent of the azimuth, down is that of the polar angle, and forward points to the centre. The
    three are orthonormal for every viewpoint, also at the pole, where the azimuth decides which way is up in the image.
    """
    sin_azimuth, cos_azimuth = np.sin(viewpoint[..., AZIMUTH]), np.cos(viewpoint[..., AZIMUTH])
    sin_polar, cos_polar = np.sin(viewpoint[..., POLAR]), np.cos(viewpoint[..., POLAR])
    zero = np.zeros_like(sin_azimuth)
    right = np.stack([-sin_azimuth, cos_azimuth, zero], axis=-1)
    down = np.stack([cos_polar * cos_azimuth, cos_polar * sin_azimuth, -sin_polar], axis=-1)
    forward = -np.stack([sin_polar * cos_azimuth, sin_polar * sin_azimuth, cos_polar], axis=-1)
    return np.stack([right, down, forward], axis=-2)


def project(positions: FloatArray, viewpoint: FloatArray, camera: Camera) -> tuple[FloatArray, FloatArray]:
    """Project joints to the image.

    Args:
        positions: (..., P, J, 3) [m], relative to the scenario's centre.
        viewpoint: (..., 3); its leading axes broadcast against those of `positions`.
        camera: the intrinsics.

    Returns:
        pixels (..., P, J, 2) [px] and depths along the optical axis (..., P, J) [m], in float32.
    """
    *_, persons, joints, _ = positions.shape
    flat = positions.reshape(*positions.shape[:-3], persons * joints, 3).astype(np.float32, copy=False)
    rotation = look_at_rotation(viewpoint).astype(np.float32)
    in_camera = flat @ np.swapaxes(rotation, -1, -2)
    depth = in_camera[..., 2] + viewpoint[..., DISTANCE, None].astype(np.float32)
    scale = np.float32(camera.focal_length) / np.maximum(depth, np.float32(NEAR_PLANE))
    pixels = in_camera[..., :2] * scale[..., None]
    pixels += np.array([camera.width / 2, camera.height / 2], dtype=np.float32)
    leading = pixels.shape[:-2]
    return pixels.reshape(*leading, persons, joints, 2), depth.reshape(*leading, persons, joints)
