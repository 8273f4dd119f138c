"""Tracks where people stand and which way they face, from 2D joints and the known motion of the camera."""

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.camera import Camera, look_at_rotation
from ehar.data.recordings import Recordings
from ehar.errors import DataError
from ehar.planner import Context, Observation
from ehar.viewpoint import DISTANCE, POLAR, away_from, cartesian, turned, wrap_difference

RIGID_VARIATION = 0.15  # largest standard deviation of a trunk's width over its mean, over actors of all sizes
LEAST_WIDTH = 0.05  # [m]; closer pairs say nothing about a direction

TRUNK_WIDTH = 0.25  # [m], the prior standard deviation of the lateral vector, and its length by default
POSITION_SPREAD = 0.7  # [m], the prior standard deviation of a person's position
SPEED_SPREAD = 0.5  # [m/s], of a person's velocity
JOINT_NOISE = 0.02  # [m], of a joint in plain view, from any distance
PIXEL_NOISE = 1.5  # [px], the least noise of a joint
LEAN = 0.08  # [m], how far the two sides of a trunk differ in height: real people bend, and lie down
PAIR_SPREAD = 0.08  # [m], how far one pair's lateral vector lies from the mean of all: hips are narrower than shoulders
JOINT_SPREAD = 0.35  # [m], how far a joint lies from the mean of all
DEPTH_ERROR = 0.03  # [m], of the mean joint, since people are not all at the centre's depth
SWAP_PROBABILITY = 0.25  # probability that left and right are swapped for a person seen edge-on
SWAP_WIDTH = 0.4  # they are never swapped if at least this share of the trunk's width is seen
LEAST_DEVIATION = 1e-6  # [m], keeps the covariance regular if the noise is set to zero
UNIFORM_STD = float(np.pi / np.sqrt(3))  # [rad], the standard deviation of a uniform angle


def trunk_pairs(data: Recordings, sequences: IntArray) -> IntArray:
    """Return the pairs of joints that make up the trunk, (pairs, 2) of [left, right].

    These are the mirrored joints whose distance hardly changes over all frames: hips and shoulders, not hands. If no
    pair is that steady, the steadiest pair is taken.

    Args:
        data: the motion.
        sequences: the sequences to look at, from a training part.

    Raises:
        DataError: the skeleton has no mirrored joints that are apart, or there are no sequences.
    """
    pairs = data.skeleton.pairs
    if len(pairs) == 0 or len(sequences) == 0:
        raise DataError(
            f"{data.name}: expected sequences, and joints named left and right, to tell which way people face; "
            f"got {len(sequences)} sequences and the joints {', '.join(data.skeleton.joint_names)}"
        )
    frames = np.concatenate([data.sequence(int(index)) for index in sequences])
    width = np.linalg.norm(frames[:, :, pairs[:, 0]] - frames[:, :, pairs[:, 1]], axis=-1).reshape(-1, len(pairs))
    mean = width.mean(axis=0)
    apart = mean > LEAST_WIDTH
    if not apart.any():
        raise DataError(
            f"{data.name}: expected left and right joints more than {LEAST_WIDTH} m apart, got {mean.max():.3f} m"
        )
    variation = np.where(apart, width.std(axis=0) / np.maximum(mean, LEAST_WIDTH), np.inf)
    rigid = variation <= max(RIGID_VARIATION, float(variation.min()))
    return pairs[rigid]


class BodyFilter:
    r"""Two Kalman filters for each of P persons in B episodes at once; both are linear, so they are exact.

    The first tracks the trunk's lateral vector (a, b) [m], the horizontal mean of left minus right over `pairs`,
    as a random walk. A person faces the azimuth :math:`\mathrm{atan2}(b, a) - \pi/2`. The state has no angle, so
    nothing in the filter has to wrap. The second tracks position and velocity (x, y, z) [m], [m/s].

    In a clip the centre rests, and people may walk away from it: a white acceleration moves them. In a stream the
    centre follows them, so they stay near it: each axis is a Matérn process of order 3/2,

    .. math:: \ddot x = -2 \lambda \dot x - \lambda^2 x + w, \qquad \lambda = \sigma_v / \sigma_x ,

    whose stationary deviations are those that the filter begins with. A camera does not see how deep people stand. As a
    random walk that would be uncertain by metres after some seconds, and be taken from the errors of small moves.

    An image measures both vectors along the camera's right and down axes, which move with the camera:

    .. math:: z = r \cdot v + e_r, \qquad z' = d \cdot v + e_d .

    A level camera sees only the part of the lateral vector along r, which is the cosine. As it moves, it sees the rest.
    The noise of a joint is its noise in plain view divided by its confidence; a missing joint is not used. A pose
    estimator may swap left and right with probability p. A swap turns the value z into -z, so the variance of a value
    is :math:`4 p (1 - p) z^2`. With this variance no measurement can lock the filter in, whichever side came first.

    Args:
        pairs: (pairs, 2) [left, right], as from `trunk_pairs`.
        frame_time: time of one frame [s].
        camera: the intrinsics; the default is the documented camera.
        turning: spectral density of the lateral vector's random walk [m^2/s].
        acceleration: spectral density of the white acceleration of clips [m^2/s^3].
        joint_noise: standard deviation of a joint in plain view [m], on top of `pixel_noise`.
        pixel_noise: standard deviation of a joint in plain view [px].
        swap_probability: probability that left and right are swapped for a person seen edge-on.
        followed: whether the centre follows people, as in a stream.
    """

    def __init__(
        self,
        *,
        pairs: IntArray,
        frame_time: float,
        camera: Camera | None = None,
        turning: float = 0.01,
        acceleration: float = 0.5,
        joint_noise: float = JOINT_NOISE,
        pixel_noise: float = PIXEL_NOISE,
        swap_probability: float = SWAP_PROBABILITY,
        followed: bool = False,
    ) -> None:
        """Create the filter; `start` it before the first frame."""
        # Imported here: filterpy takes half a second to import, and every process would wait for it.
        from filterpy.common import Q_continuous_white_noise

        self.pairs = pairs
        self.camera = camera or Camera()
        self.joint_noise = joint_noise
        self.pixel_noise = pixel_noise
        self.swap_probability = swap_probability
        self.turning_noise = turning * frame_time * np.eye(2)
        motion = np.array([[1.0, frame_time], [0.0, 1.0]])
        noise = Q_continuous_white_noise(2, frame_time, acceleration)
        if followed:
            rate = SPEED_SPREAD / POSITION_SPREAD
            still = np.diag([POSITION_SPREAD**2, SPEED_SPREAD**2])
            motion = np.exp(-rate * frame_time) * np.array(
                [[1 + rate * frame_time, frame_time], [-(rate**2) * frame_time, 1 - rate * frame_time]]
            )
            noise = still - motion @ still @ motion.T
        self._gaze: FloatArray | None = None
        self.motion, self.motion_noise = np.kron(motion, np.eye(3)), np.kron(noise, np.eye(3))
        self.start(0, 0)

    @staticmethod
    def of(context: Context, pairs: IntArray) -> "BodyFilter":
        """Return the filter for the episodes of a context."""
        return BodyFilter(
            pairs=pairs,
            frame_time=context.frame_time,
            camera=context.world.camera,
            followed=context.length is None,
        )

    def observe(self, observation: Observation) -> None:
        """See one more frame, as a planner does; the first one forgets what was before."""
        if observation.frame == 0:
            self.start(*observation.joints_2d.shape[:2])
        self.update(observation.joints_2d, observation.confidence, observation.viewpoint, observation.gaze)

    def start(self, episodes: int, persons: int) -> None:
        """Forget everything: B episodes of P persons who may be anywhere near the centre, facing anywhere."""
        leading = (episodes, persons)
        self.lateral: FloatArray = np.zeros((*leading, 2))
        self.lateral_covariance: FloatArray = np.broadcast_to(TRUNK_WIDTH**2 * np.eye(2), (*leading, 2, 2))
        self.movement: FloatArray = np.zeros((*leading, 6))  # position and velocity
        spread = np.repeat([POSITION_SPREAD**2, SPEED_SPREAD**2], 3)
        self.movement_covariance: FloatArray = np.broadcast_to(np.diag(spread), (*leading, 6, 6))
        self._begun = False
        self._gaze = None

    def update(
        self,
        joints_2d: FloatArray,
        confidence: FloatArray,
        viewpoint: FloatArray,
        gaze: FloatArray | None = None,
    ) -> None:
        """See one more frame.

        Args:
            joints_2d: (B, P, J, 2) [px].
            confidence: (B, P, J) in [0, 1], 0 where a joint is missing.
            viewpoint: (B, 3), the camera's viewpoint.
            gaze: (B, 3) what the camera looks at, from the centre [m]; None means at the centre.
        """
        self._gaze = gaze
        if self._begun:
            self.lateral_covariance = self.lateral_covariance + self.turning_noise
            self.movement = self.movement @ self.motion.T
            self.movement_covariance = self.motion @ self.movement_covariance @ self.motion.T + self.motion_noise
        self._begun = True
        axes = look_at_rotation(viewpoint)[:, None, :2]  # (B, 1, [right, down], 3), for all persons
        if gaze is not None:
            place = cartesian(viewpoint)
            axes = turned(axes, place, place - gaze)  # as the camera is
            viewpoint = away_from(viewpoint, gaze)
        lateral, lateral_variance = self.measure_lateral(joints_2d, confidence, viewpoint)
        position, position_variance = self.measure_position(joints_2d, confidence, viewpoint)
        still = np.zeros((*axes.shape[:2], 3))
        for axis in range(2):  # the noise is independent, so two updates in turn equal one update with both
            self.lateral, self.lateral_covariance = _update(
                self.lateral,
                self.lateral_covariance,
                axes[:, :, axis, :2],
                lateral[..., axis],
                lateral_variance[..., axis],
            )
            self.movement, self.movement_covariance = _update(
                self.movement,
                self.movement_covariance,
                np.concatenate([axes[:, :, axis], still], axis=-1),
                position[..., axis],
                position_variance[..., axis],
            )

    def measure_lateral(
        self, joints_2d: FloatArray, confidence: FloatArray, viewpoint: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the lateral vector along right and down, (B, P, 2) [m], and variances [m^2], inf where unseen."""
        metres, variance = self._joints(joints_2d, confidence, viewpoint)
        left, right = self.pairs.T
        measured, noise, seen = _mean_of_seen(
            metres[:, :, left] - metres[:, :, right], variance[:, :, left] + variance[:, :, right], PAIR_SPREAD
        )
        share = np.linalg.norm(measured, axis=-1) / (SWAP_WIDTH * TRUNK_WIDTH)
        swap = self.swap_probability * np.maximum(1 - share, 0)
        swapped = 4 * (swap * (1 - swap))[..., None] * measured**2
        lean = np.zeros((len(viewpoint), 1, 2))
        lean[:, 0, 1] = (LEAN * np.sin(viewpoint[:, POLAR])) ** 2
        return measured, np.where(seen[..., None], noise[..., None] + swapped + lean, np.inf)

    def measure_position(
        self, joints_2d: FloatArray, confidence: FloatArray, viewpoint: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the mean joint along right and down, (B, P, 2) [m], and variances [m^2], inf where unseen."""
        metres, variance = self._joints(joints_2d, confidence, viewpoint)
        measured, noise, seen = _mean_of_seen(metres, variance, JOINT_SPREAD)
        total = np.where(seen, noise + DEPTH_ERROR**2, np.inf)
        return measured, np.repeat(total[..., None], 2, axis=-1)

    def _joints(
        self, joints_2d: FloatArray, confidence: FloatArray, viewpoint: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return joints (B, P, J, 2) [m] at the centre's depth, and variances (B, P, J) [m^2], inf where missing."""
        metres_a_pixel = (viewpoint[:, DISTANCE] / self.camera.focal_length)[:, None, None]
        middle = np.array([self.camera.width / 2, self.camera.height / 2])
        metres = (np.asarray(joints_2d, dtype=np.float64) - middle) * metres_a_pixel[..., None]
        plain = self.joint_noise**2 + (self.pixel_noise * metres_a_pixel) ** 2 + LEAST_DEVIATION**2
        missing = confidence <= 0
        return metres, np.where(missing, np.inf, plain / np.where(missing, 1.0, confidence.astype(np.float64)) ** 2)

    @property
    def facing(self) -> FloatArray:
        """The azimuths that people face, (B, P) [rad] in [-pi, pi)."""
        return wrap_difference(np.arctan2(self.lateral[..., 1], self.lateral[..., 0]) - np.pi / 2)

    @property
    def facing_std(self) -> FloatArray:
        """The standard deviations of `facing`, (B, P) [rad], to first order, at most that of a uniform angle."""
        a, b = self.lateral[..., 0], self.lateral[..., 1]
        across = np.stack([-b, a], axis=-1)
        variance = np.einsum("...i,...ij,...j->...", across, self.lateral_covariance, across)
        squared_length = np.maximum(a**2 + b**2, LEAST_DEVIATION**2)
        certain = a**2 + b**2 > LEAST_DEVIATION**2
        return np.where(certain, np.minimum(np.sqrt(variance) / squared_length, UNIFORM_STD), UNIFORM_STD)

    @property
    def position(self) -> FloatArray:
        """Where people are relative to the centre, (B, P, 3) [m]: the mean of their joints.

        It is measured from what cameras look at, which may be beside the centre.
        """
        position = self.movement[..., :3]
        return position if self._gaze is None else position + self._gaze[:, None]


def _mean_of_seen(values: FloatArray, variance: FloatArray, spread: float) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Average the seen ones of n values, each of which lies about `spread` from the mean of all n.

    Args:
        values: (B, P, n, 2).
        variance: (B, P, n), inf for a value that is not seen.
        spread: standard deviation of the values around their mean.

    Returns:
        means (B, P, 2), their variances as estimates of the mean of all n (B, P), and whether any was seen (B, P).
    """
    seen: BoolArray = np.isfinite(variance)
    count = np.maximum(seen.sum(axis=-1), 1)
    mean = (values * seen[..., None]).sum(axis=-2) / count[..., None]
    noise = np.where(seen, variance, 0.0).sum(axis=-1) / count**2
    return mean, noise + spread**2 * (1 / count - 1 / values.shape[-2]), np.asarray(seen.any(axis=-1))


def _update(
    mean: FloatArray, covariance: FloatArray, axis: FloatArray, measured: FloatArray, variance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return mean (..., n) and covariance (..., n, n) after measuring axis . state; inf variance changes nothing."""
    projected = np.einsum("...ij,...j->...i", covariance, np.broadcast_to(axis, mean.shape))
    innovation_variance = (projected * axis).sum(axis=-1) + variance
    gain = projected / innovation_variance[..., None]
    innovation = measured - (axis * mean).sum(axis=-1)
    updated = covariance - gain[..., :, None] * projected[..., None, :]
    return mean + gain * innovation[..., None], updated
