"""What a 2D pose estimator gets wrong: noise, joints hidden behind limbs, missing joints, left-right swaps."""

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
        for begin in range(0, frames, CHUNK_FRAMES):
            chunk = slice(begin, begin + CHUNK_FRAMES)
            joints_2d[chunk], confidence[chunk] = self._sense_chunk(
                positions[chunk], viewpoint[chunk], SensorNoise(*(draw[chunk] for draw in draws)), radii, cut[chunk]
            )
        return Sensed(joints_2d.reshape(*leading, persons, joints, 2), confidence.reshape(*leading, persons, joints))

    def fingerprint(self) -> bytes:
        """Return what decides what it sees."""
        told = vars(self) | {"skeleton": (self.skeleton.joint_names, self.skeleton.bones)}
        return repr(told).encode()

    def _sense_chunk(
        self, positions: FloatArray, viewpoint: FloatArray, noise: SensorNoise, radii: FloatArray, hidden: BoolArray
    ) -> tuple[FloatArray, FloatArray]:
        """Sense frames (n, ...); `radii` is a result of `_capsule_radii`."""
        pixels, depth = project(positions, viewpoint, self.camera)
        height = np.ptp(pixels, axis=2).max(axis=-1)  # (n, P)
        occluded = self._occluded(pixels, depth, radii)

        scale = np.sqrt((self.relative_noise * height) ** 2 + self.noise_floor**2)[:, :, None]
        scale = np.where(occluded, self.occluded_noise * scale, scale).astype(np.float32)
        joints_2d = pixels + scale[..., None] * noise.localisation

        outside = (pixels < 0) | (pixels >= np.array([self.camera.width, self.camera.height]))
        missing = outside[..., 0] | outside[..., 1] | (depth < NEAR_PLANE) | hidden
        missing |= noise.dropout < (1 - height / self.smallest_height)[:, :, None]
        joints_2d[missing] = (self.camera.width / 2, self.camera.height / 2)
        confidence = np.where(occluded, np.float32(self.occluded_confidence), np.float32(1.0))
        confidence[missing] = 0.0

        mirror = self.skeleton.mirror
        swapped = noise.swap < self._swap_probability(positions, pixels, depth)
        joints_2d[swapped] = joints_2d[swapped][:, mirror]
        confidence[swapped] = confidence[swapped][:, mirror]
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

    def _occluded(self, pixels: FloatArray, depth: FloatArray, radii: FloatArray) -> BoolArray:
        """Return which joints (n, P, J) lie behind a bone's capsule.

        Two conditions hold for such a joint. In the image, its distance to the bone is below the capsule's radius,
        projected at the depth of the bone's point nearest to the joint; inverse depth is linear along a projected
        segment. And this point is nearer to the camera than the joint, by `occlusion_margin`.
        """
        frames, persons, joints, _ = pixels.shape
        bones = (np.arange(persons)[:, None, None] * joints + self.skeleton.bone_indices).reshape(-1, 2)
        # Frames last, so that the inner loops run over the many frames, not over the few bones.
        columns = pixels.reshape(frames, persons * joints, 2).transpose(2, 1, 0)
        x, y = np.ascontiguousarray(columns)
        far = np.ascontiguousarray(depth.reshape(frames, persons * joints).T)
        inverse_depth = 1 / np.maximum(far, np.float32(NEAR_PLANE))
        begin, end = bones.T
        bone_x, bone_y = x[end] - x[begin], y[end] - y[begin]
        inverse_length = 1 / np.maximum(bone_x**2 + bone_y**2, np.float32(1e-6))

        away_x = x[:, None] - x[begin]  # (P J, P bones, n), as all below
        away_y = y[:, None] - y[begin]
        along = away_x * bone_x
        along += away_y * bone_y
        along *= inverse_length
        np.clip(along, 0, 1, out=along)
        away_x -= along * bone_x
        away_y -= along * bone_y
        away_x *= away_x
        away_y *= away_y
        away_x += away_y
        along *= inverse_depth[end] - inverse_depth[begin]
        along += inverse_depth[begin]  # the inverse depth of the bone's nearest point
        before = along > (1 / np.maximum(far - np.float32(self.occlusion_margin), np.float32(NEAR_PLANE)))[:, None]
        along *= radii * np.float32(self.camera.focal_length)
        along *= along
        before &= away_x < along
        occluded: BoolArray = before.any(axis=1).T.reshape(frames, persons, joints)
        return occluded

    def _swap_probability(self, positions: FloatArray, pixels: FloatArray, depth: FloatArray) -> FloatArray:
        """Return the probability that left and right are confused, (n, P).

        The body's width is the mean vector from the right to the left joints. The share of it that is seen is its
        length in the image, divided by its length there if it were parallel to the image.
        """
        left = np.flatnonzero(self.skeleton.mirror > np.arange(len(self.skeleton.mirror)))
        if len(left) == 0:
            return np.zeros(pixels.shape[:2], dtype=np.float32)
        right = self.skeleton.mirror[left]
        width = np.linalg.norm((positions[:, :, left] - positions[:, :, right]).mean(axis=2), axis=-1)
        seen = np.linalg.norm((pixels[:, :, left] - pixels[:, :, right]).mean(axis=2), axis=-1)
        full = width * self.camera.focal_length / np.maximum(depth.mean(axis=2), NEAR_PLANE)
        share = seen / np.maximum(full, 1e-6)
        probability: FloatArray = self.swap_probability * np.maximum(1 - share / self.swap_width, 0)
        return probability
