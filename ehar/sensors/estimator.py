"""What a 2D pose estimator gets wrong: noise, joints hidden behind limbs, missing joints, left-right swaps."""

from functools import partial
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

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

Array = Any  # of NumPy, or a torch tensor on one device


class _Frames(NamedTuple):
    """What differs from frame to frame: people in the image, and the draws of their errors.

    Args:
        positions: (n, P, J, 3) joints [m].
        pixels: (n, P, J, 2) where they are in the image [px].
        depth: (n, P, J) how far they are along the optical axis [m].
        localisation: (n, P, J, 2), as the next two a part of `SensorNoise`.
        dropout: (n, P, J).
        swap: (n, P).
        hidden: (n, P, J) which joints an obstacle hides.
    """

    positions: Array
    pixels: Array
    depth: Array
    localisation: Array
    dropout: Array
    swap: Array
    hidden: Array


class _Bodies(NamedTuple):
    """What is the same in all frames: bodies, and the image.

    Args:
        radii: (P J, P bones, 1) radius of each bone as an occluder of each joint [m].
        bones: (2, P bones) the joints at their ends, counted over all people.
        mirror: (J,) each joint's partner on the other side.
        pairs: (2, pairs) joints of the left side, and their partners.
        middle: (2,) of the image [px].
        levels: (3,) confidence of a joint in plain view, of an occluded and of a missing one.
    """

    radii: Array
    bones: Array
    mirror: Array
    pairs: Array
    middle: Array
    levels: Array


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

        def by_frame(values: Array, *shape: int) -> Array:
            return np.broadcast_to(values, (*leading, *shape)).reshape(frames, *shape)

        people = (persons, joints)
        positions, viewpoint = by_frame(positions, *people, 3), by_frame(viewpoint, 3)
        localisation, dropout = by_frame(noise.localisation, *people, 2), by_frame(noise.dropout, *people)
        swap, cut = by_frame(noise.swap, persons), by_frame(False if hidden is None else hidden, *people)
        joints_2d = np.empty((frames, *people, 2), dtype=np.float32)
        confidence = np.empty((frames, *people), dtype=np.float32)
        bodies = self._bodies(persons)
        size = CHUNK_FRAMES if self.device is None else DEVICE_FRAMES
        for begin in range(0, frames, size):
            chunk = slice(begin, begin + size)
            pixels, depth = project(positions[chunk], viewpoint[chunk], self.camera)  # on any device the same pixels
            told = _Frames(
                positions[chunk], pixels, depth, localisation[chunk], dropout[chunk], swap[chunk], cut[chunk]
            )
            joints_2d[chunk], confidence[chunk] = self._on_device(told, bodies)
        return Sensed(joints_2d.reshape(*leading, *people, 2), confidence.reshape(*leading, *people))

    def fingerprint(self) -> bytes:
        """Return what decides what it sees."""
        told = vars(self) | {"skeleton": (self.skeleton.joint_names, self.skeleton.bones)}
        del told["device"]
        return repr(told).encode()

    def _bodies(self, persons: int) -> _Bodies:
        """Return what is the same in all frames, as arrays of NumPy."""
        mirror, joints = self.skeleton.mirror, len(self.skeleton.joint_names)
        bones = (np.arange(persons)[:, None, None] * joints + self.skeleton.bone_indices).reshape(-1, 2)
        return _Bodies(
            radii=self._capsule_radii(persons),
            bones=np.ascontiguousarray(bones.T),
            mirror=mirror,
            pairs=np.ascontiguousarray(self.skeleton.pairs.T),
            middle=np.array((self.camera.width / 2, self.camera.height / 2), dtype=np.float32),
            levels=np.array((1.0, self.occluded_confidence, 0.0), dtype=np.float32),
        )

    def _on_device(self, frames: _Frames, bodies: _Bodies) -> tuple[FloatArray, FloatArray]:
        """Compute `_with_errors` of arrays, and return arrays."""
        if self.device is None:
            joints_2d, confidence = self._with_errors(np, frames, bodies)
            return joints_2d, confidence
        import torch  # imported here: it takes seconds, and without a device nobody needs it

        there = partial(torch.tensor, device=self.device)
        seen = self._with_errors(torch, _Frames(*map(there, frames)), _Bodies(*map(there, bodies)))
        joints_2d, confidence = (part.cpu().numpy() for part in seen)
        return joints_2d, confidence

    def _with_errors(self, xp: ModuleType, frames: _Frames, bodies: _Bodies) -> tuple[Array, Array]:
        """Return joints in the image (n, P, J, 2) and confidences (n, P, J), with the errors of an estimator.

        `xp` is NumPy or torch: the two have the same names for all that is done here.
        """
        pixels, depth = frames.pixels, frames.depth
        height = xp.amax(xp.amax(pixels, 2) - xp.amin(pixels, 2), -1)  # (n, P)
        occluded = self._occluded(xp, frames, bodies)
        scale = xp.sqrt((self.relative_noise * height) ** 2 + self.noise_floor**2)[:, :, None]
        scale = xp.where(occluded, self.occluded_noise * scale, scale)
        joints_2d = pixels + scale[..., None] * frames.localisation

        x, y = pixels[..., 0], pixels[..., 1]
        missing = (x < 0) | (x >= self.camera.width) | (y < 0) | (y >= self.camera.height) | (depth < NEAR_PLANE)
        missing |= frames.hidden | (frames.dropout < (1 - height / self.smallest_height)[:, :, None])
        joints_2d = xp.where(missing[..., None], bodies.middle, joints_2d)
        plain, behind, none = bodies.levels
        confidence = xp.where(missing, none, xp.where(occluded, behind, plain))

        swapped = (frames.swap < self._swap_probability(xp, frames, bodies))[..., None]
        joints_2d = xp.where(swapped[..., None], joints_2d[:, :, bodies.mirror], joints_2d)
        confidence = xp.where(swapped, confidence[:, :, bodies.mirror], confidence)
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

    def _occluded(self, xp: ModuleType, frames: _Frames, bodies: _Bodies) -> Array:
        """Return which joints (n, P, J) lie behind a bone's capsule; arguments are as in `_with_errors`.

        Two conditions hold for such a joint. In the image, its distance to the bone is below the capsule's radius,
        projected at the depth of the bone's point nearest to the joint; inverse depth is linear along a projected
        segment. And this point is nearer to the camera than the joint, by `occlusion_margin`.
        """
        pixels, depth = frames.pixels, frames.depth
        count, persons, joints = depth.shape
        # Frames last, so that the inner loops run over the many frames, not over the few bones.
        x, y, far = (_transposed(xp, part.reshape(count, -1)) for part in (pixels[..., 0], pixels[..., 1], depth))
        inverse_depth = 1 / xp.clip(far, NEAR_PLANE, None)
        begin, end = bodies.bones
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
        along *= bodies.radii * self.camera.focal_length
        along *= along
        before &= away_x < along
        return before.any(1).T.reshape(count, persons, joints)

    def _swap_probability(self, xp: ModuleType, frames: _Frames, bodies: _Bodies) -> Array:
        """Return the probability that left and right are confused, (n, P); arguments are as in `_with_errors`.

        The body's width is the mean vector from the right to the left joints. The share of it that is seen is its
        length in the image, divided by its length there if it were parallel to the image.
        """
        positions, pixels, depth = frames.positions, frames.pixels, frames.depth
        left, right = bodies.pairs
        if len(left) == 0:
            return xp.zeros_like(depth[..., 0])
        width = xp.linalg.norm((positions[:, :, left] - positions[:, :, right]).mean(2), axis=-1)
        seen = xp.linalg.norm((pixels[:, :, left] - pixels[:, :, right]).mean(2), axis=-1)
        full = width * self.camera.focal_length / xp.clip(depth.mean(2), NEAR_PLANE, None)
        share = seen / xp.clip(full, 1e-6, None)
        return self.swap_probability * xp.clip(1 - share / self.swap_width, 0, None)


def _transposed(xp: ModuleType, rows: Array) -> Array:
    """Return the transpose of an array or tensor (n, m), laid out anew."""
    return np.ascontiguousarray(rows.T) if xp is np else rows.T.contiguous()
