"""What a 2D pose estimator gets wrong: noise, joints hidden behind limbs, missing joints, left-right swaps."""

from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from ehar.arrays import BoolArray, FloatArray
from ehar.camera import NEAR_PLANE, Camera, project
from ehar.data.skeleton import LIMB_RADIUS, TRUNK_RADIUS, Skeleton
from ehar.sensors.sensor import Sensed, SensorNoise

RELATIVE_NOISE = 0.01  # standard deviation, as a share of the person's height in the image
NOISE_FLOOR = 1.5  # [px], standard deviation for a very small person
OCCLUDED_NOISE = 4.0  # factor on the noise of a joint in plain view
OCCLUDED_CONFIDENCE = 0.3  # a joint in plain view has 1, a missing one 0
SMALLEST_HEIGHT = 60.0  # [px], no joint of a taller person is missed for its size
SWAP_PROBABILITY = 0.25  # for a person seen exactly edge-on
SWAP_WIDTH = 0.4  # share of the body's width: if more is seen, sides are never confused; 24 degrees off edge-on
OCCLUSION_MARGIN = 0.1  # [m], a bone hides a joint only if it is nearer by this much
CHUNK_FRAMES = 64  # the temporary arrays of 64 frames fit in a core's cache
DEVICE_FRAMES = 8192  # on a GPU; their temporary arrays take some hundred MiB


class EstimatorSensor:
    r"""2D joints with the errors of a pose estimator.

    The error of a joint has a standard deviation of :math:`\sqrt{(a h)^2 + b^2}` in x and in y. Here h is the
    person's height in the image: the larger side of the bounding box of the true projected joints. So a person
    seen from straight above counts with the extent that is seen.

    Confidence is 1 for a joint in plain view, `occluded_confidence` for a joint hidden behind a limb, and 0 for a
    missing joint. A missing joint lies at the image centre. A joint is missing if it is outside the image, behind
    the near plane, or hidden by an obstacle. Each joint of a person smaller than `smallest_height` is also missing
    with probability 1 - h / `smallest_height`.

    All joints of a person change sides together, with their confidences. The probability rises linearly, from 0
    if `swap_width` of the body's width is seen, to `swap_probability` if the body is seen edge-on.

    Args:
        skeleton: the skeleton of one person. Without mirrored joints there are no swaps.
        camera: the intrinsics.
        relative_noise: a above.
        noise_floor: b above [px].
        occluded_noise: factor on the noise of an occluded joint.
        occluded_confidence: confidence of an occluded joint.
        smallest_height: below this height in the image joints go missing [px].
        swap_probability: probability of a swap edge-on.
        swap_width: seen share of the body's width at which swaps begin.
        limb_radius: radius of the capsules around bones [m].
        trunk_radius: radius of the capsules around bones of the body's middle [m].
        occlusion_margin: how much nearer than a joint a bone must be to occlude it [m].
        device: a torch device that computes, such as "cuda"; None means NumPy. What is sensed is the same, but that the
            probability of a swap is rounded otherwise.
    """

    name = "estimator"

    def __init__(
        self,
        *,
        skeleton: Skeleton,
        camera: Camera | None = None,
        relative_noise: float = RELATIVE_NOISE,
        noise_floor: float = NOISE_FLOOR,
        occluded_noise: float = OCCLUDED_NOISE,
        occluded_confidence: float = OCCLUDED_CONFIDENCE,
        smallest_height: float = SMALLEST_HEIGHT,
        swap_probability: float = SWAP_PROBABILITY,
        swap_width: float = SWAP_WIDTH,
        limb_radius: float = LIMB_RADIUS,
        trunk_radius: float = TRUNK_RADIUS,
        occlusion_margin: float = OCCLUSION_MARGIN,
        device: str | None = None,
    ) -> None:
        """Create the sensor."""
        self.camera = camera or Camera()
        self.skeleton = skeleton
        self.relative_noise = relative_noise
        self.noise_floor = noise_floor
        self.occluded_noise = occluded_noise
        self.occluded_confidence = occluded_confidence
        self.smallest_height = smallest_height
        self.swap_probability = swap_probability
        self.swap_width = swap_width
        self.limb_radius = limb_radius
        self.trunk_radius = trunk_radius
        self.occlusion_margin = occlusion_margin
        self.device = device

    def sense(
        self, positions: FloatArray, viewpoint: FloatArray, noise: SensorNoise, hidden: BoolArray | None = None
    ) -> Sensed:
        """Sense joints (..., P, J, 3) [m] from viewpoints (..., 3); leading axes broadcast."""
        *_, persons, joints, _ = positions.shape
        leading = np.broadcast_shapes(positions.shape[:-3], viewpoint.shape[:-1], noise.swap.shape[:-1])
        frames = int(np.prod(leading))
        positions = np.broadcast_to(positions, (*leading, persons, joints, 3)).reshape(frames, persons, joints, 3)
        viewpoint = np.broadcast_to(viewpoint, (*leading, 3)).reshape(frames, 3)
        localisation = np.broadcast_to(noise.localisation, (*leading, persons, joints, 2))
        draws = SensorNoise(
            localisation.reshape(frames, persons, joints, 2),
            np.broadcast_to(noise.dropout, (*leading, persons, joints)).reshape(frames, persons, joints),
            np.broadcast_to(noise.swap, (*leading, persons)).reshape(frames, persons),
        )
        joints_2d = np.empty((frames, persons, joints, 2), dtype=np.float32)
        confidence = np.empty((frames, persons, joints), dtype=np.float32)
        radii = self._capsule_radii(persons)
        cut = np.broadcast_to(False if hidden is None else hidden, (*leading, persons, joints))
        cut = cut.reshape(frames, persons, joints)
        size = CHUNK_FRAMES if self.device is None else DEVICE_FRAMES
        for begin in range(0, frames, size):
            chunk = slice(begin, begin + size)
            joints_2d[chunk], confidence[chunk] = self._sense_chunk(
                positions[chunk], viewpoint[chunk], SensorNoise(*(draw[chunk] for draw in draws)), radii, cut[chunk]
            )
        return Sensed(joints_2d.reshape(*leading, persons, joints, 2), confidence.reshape(*leading, persons, joints))

    def fingerprint(self) -> bytes:
        """Return what decides what it sees."""
        told = vars(self) | {"skeleton": (self.skeleton.joint_names, self.skeleton.bones)}
        del told["device"]
        return repr(told).encode()

    def _sense_chunk(
        self, positions: FloatArray, viewpoint: FloatArray, noise: SensorNoise, radii: FloatArray, hidden: BoolArray
    ) -> tuple[FloatArray, FloatArray]:
        """Sense frames (n, ...); `radii` is a result of `_capsule_radii`."""
        pixels, depth = project(positions, viewpoint, self.camera)  # by NumPy on any device: pixels are the same
        told = (positions, pixels, depth, *noise, radii, hidden, *self._constants(positions.shape[1]))
        if self.device is None:
            joints_2d, confidence = self._with_errors(np, *told)
            return joints_2d, confidence
        import torch  # imported here: it takes seconds, and without a device nobody needs it

        seen = self._with_errors(torch, *(torch.tensor(array, device=self.device) for array in told))
        joints_2d, confidence = (part.cpu().numpy() for part in seen)
        return joints_2d, confidence

    def _constants(self, persons: int) -> tuple[npt.NDArray[np.generic], ...]:
        """Return the last arguments of `_with_errors`."""
        mirror, joints = self.skeleton.mirror, len(self.skeleton.joint_names)
        bones = (np.arange(persons)[:, None, None] * joints + self.skeleton.bone_indices).reshape(-1, 2)
        left = np.flatnonzero(mirror > np.arange(joints))
        middle = np.array((self.camera.width / 2, self.camera.height / 2), dtype=np.float32)
        levels = np.array((1.0, self.occluded_confidence, 0.0), dtype=np.float32)
        return np.ascontiguousarray(bones.T), mirror, np.stack((left, mirror[left])), middle, levels

    def _with_errors(
        self,
        xp: ModuleType,
        positions: Any,
        pixels: Any,
        depth: Any,
        localisation: Any,
        dropout: Any,
        swap: Any,
        radii: Any,
        hidden: Any,
        bones: Any,
        mirror: Any,
        pairs: Any,
        middle: Any,
        levels: Any,
    ) -> tuple[Any, Any]:
        """Return joints in the image (n, P, J, 2) and confidences (n, P, J), with the errors of an estimator.

        Args:
            xp: NumPy or torch; the two have the same names for all that is done here.
            positions: (n, P, J, 3) joints [m], as all below an array of NumPy, or a tensor on one device.
            pixels: (n, P, J, 2) where they are in the image [px].
            depth: (n, P, J) how far they are along the optical axis [m].
            localisation: (n, P, J, 2), as the next two a part of `SensorNoise`.
            dropout: (n, P, J).
            swap: (n, P).
            radii: (P J, P bones, 1), see `_capsule_radii`.
            hidden: (n, P, J) which joints an obstacle hides.
            bones: (2, P bones) the joints at their ends, counted over all people.
            mirror: (J,) each joint's partner on the other side.
            pairs: (2, pairs) joints of the left side, and their partners.
            middle: (2,) of the image [px].
            levels: (3,) confidence of a joint in plain view, of an occluded and of a missing one.
        """
        height = xp.amax(xp.amax(pixels, 2) - xp.amin(pixels, 2), -1)  # (n, P)
        occluded = self._occluded(xp, pixels, depth, radii, bones)
        scale = xp.sqrt((self.relative_noise * height) ** 2 + self.noise_floor**2)[:, :, None]
        scale = xp.where(occluded, self.occluded_noise * scale, scale)
        joints_2d = pixels + scale[..., None] * localisation

        x, y = pixels[..., 0], pixels[..., 1]
        missing = (x < 0) | (x >= self.camera.width) | (y < 0) | (y >= self.camera.height) | (depth < NEAR_PLANE)
        missing |= hidden | (dropout < (1 - height / self.smallest_height)[:, :, None])
        joints_2d = xp.where(missing[..., None], middle, joints_2d)
        confidence = xp.where(missing, levels[2], xp.where(occluded, levels[1], levels[0]))

        swapped = (swap < self._swap_probability(xp, positions, pixels, depth, pairs))[..., None]
        joints_2d = xp.where(swapped[..., None], joints_2d[:, :, mirror], joints_2d)
        confidence = xp.where(swapped, confidence[:, :, mirror], confidence)
        return joints_2d, confidence

    def _capsule_radii(self, persons: int) -> FloatArray:
        """Return the radius [m] of each bone as an occluder of each joint, (P J, P bones, 1).

        The radius is 0 if the bone touches the joint, on the same person: then it never occludes it.
        """
        bones, joints = self.skeleton.bone_indices, len(self.skeleton.joint_names)
        radius = self.skeleton.bone_radii(self.limb_radius, self.trunk_radius)
        touches = (bones[None] == np.arange(joints)[:, None, None]).any(axis=2)
        own = np.kron(np.eye(persons, dtype=bool), touches)
        radii: FloatArray = np.where(own, 0.0, np.tile(radius, persons)).astype(np.float32)
        return radii[..., None]

    def _occluded(self, xp: ModuleType, pixels: Any, depth: Any, radii: Any, bones: Any) -> Any:
        """Return which joints (n, P, J) lie behind a bone's capsule; arguments are as in `_with_errors`.

        Two conditions hold for such a joint. In the image, its distance to the bone is below the capsule's radius,
        projected at the depth of the bone's point nearest to the joint; inverse depth is linear along a projected
        segment. And this point is nearer to the camera than the joint, by `occlusion_margin`.
        """
        frames, persons, joints = depth.shape
        # Frames last, so that the inner loops run over the many frames, not over the few bones.
        x, y, far = (_transposed(xp, part.reshape(frames, -1)) for part in (pixels[..., 0], pixels[..., 1], depth))
        inverse_depth = 1 / xp.clip(far, NEAR_PLANE, None)
        begin, end = bones
        bone_x, bone_y = x[end] - x[begin], y[end] - y[begin]
        inverse_length = 1 / xp.clip(bone_x**2 + bone_y**2, 1e-6, None)

        away_x = x[:, None] - x[begin]  # (P J, P bones, n), as all below
        away_y = y[:, None] - y[begin]
        along = away_x * bone_x
        along += away_y * bone_y
        along *= inverse_length
        xp.clip(along, 0, 1, out=along)
        away_x -= along * bone_x
        away_y -= along * bone_y
        away_x *= away_x
        away_y *= away_y
        away_x += away_y
        along *= inverse_depth[end] - inverse_depth[begin]
        along += inverse_depth[begin]  # the inverse depth of the bone's nearest point
        before = along > (1 / xp.clip(far - self.occlusion_margin, NEAR_PLANE, None))[:, None]
        along *= radii * self.camera.focal_length
        along *= along
        before &= away_x < along
        return before.any(1).T.reshape(frames, persons, joints)

    def _swap_probability(self, xp: ModuleType, positions: Any, pixels: Any, depth: Any, pairs: Any) -> Any:
        """Return the probability that left and right are confused, (n, P); arguments are as in `_with_errors`.

        The body's width is the mean vector from the right to the left joints. The share of it that is seen is its
        length in the image, divided by its length there if it were parallel to the image.
        """
        left, right = pairs
        if len(left) == 0:
            return xp.zeros_like(depth[..., 0])
        width = xp.linalg.norm((positions[:, :, left] - positions[:, :, right]).mean(2), axis=-1)
        seen = xp.linalg.norm((pixels[:, :, left] - pixels[:, :, right]).mean(2), axis=-1)
        full = width * self.camera.focal_length / xp.clip(depth.mean(2), NEAR_PLANE, None)
        share = seen / xp.clip(full, 1e-6, None)
        return self.swap_probability * xp.clip(1 - share / self.swap_width, 0, None)


def _transposed(xp: ModuleType, rows: Any) -> Any:
    """Return the transpose of an array or tensor (n, m), laid out anew."""
    return np.ascontiguousarray(rows.T) if xp is np else rows.T.contiguous()
