"""What trackers of real cameras get wrong, in the terms of our pose estimator: fitted to what lies between cameras.

One camera's joints in space, carried into another camera's frame, are what that camera should have seen. What it saw is
the other recording, projected into its own image.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.camera import Camera, project
from ehar.data.motion_data import MotionData
from ehar.data.skeleton import Skeleton
from ehar.sensors.estimator import EstimatorSensor
from ehar.sensors.sensor import Sensed, SensorNoise, draw_noise
from ehar.viewpoint import spherical, wrap_difference
from eval.studies.real_views.alignment import Pose, same_moments
from eval.studies.real_views.executions import Execution, Poses

SWAPPED = 0.5  # sides are swapped if joints then fit in this share of the distance
SIDES = np.radians([60, 120])  # turned less than the first from the camera is a front, more than the second a back
MOST = 0.5  # share of joints that our pose estimator must see in a frame that is compared
HEIGHTS = 8  # bins of people's heights in the image, with as many frames in each
NORMAL = 1.4826  # standard deviation of a normal distribution over its median absolute deviation


@dataclass(frozen=True)
class JointErrors:
    """Errors of a pose tracker, in the terms of `ehar.sensors.estimator`.

    Args:
        frames: number of frames that were compared.
        relative_noise: standard deviation of a joint in plain view, as a share of the person's height in the image.
        noise_floor: what comes on top of it, as variances add up [px].
        occluded_noise: factor on the noise of joints behind limbs.
        swaps: share of frames with sides swapped, for people seen from the front, the side and the back.
        lasting: share of the errors' variance that is the same in all frames of a recording.
        correlation: of what is left of a joint's error with what is left in the next frame.
    """

    frames: int
    relative_noise: float
    noise_floor: float
    occluded_noise: float
    swaps: tuple[float, float, float]
    lasting: float
    correlation: float


class _Errors(NamedTuple):
    """What was seen beside what should have been seen, in n frames."""

    error: FloatArray  # (n, J, 2) [px], without its mean over joints: cameras' places are not exact; NaN where missing
    height: FloatArray  # (n,) of the person in the image [px]
    occluded: BoolArray  # (n, J)
    turned: FloatArray  # (n,) angle between where the person faces and the camera [rad]
    swapped: BoolArray  # (n,)
    frame: IntArray  # (n,) of the recording


def real_errors(data: MotionData, executions: Sequence[Execution], poses: Poses, camera: Camera) -> JointErrors:
    """Measure the errors of the trackers that made the data.

    What lies between two recordings are the errors of both. So noise is divided by the square root of 2, and the share
    of swaps by 2.
    """
    found = []
    for first, second, pose in _pairs(data, executions, poses):
        carried = pose.carried(first)
        one, other = same_moments(carried, second, data.skeleton.mirror)
        frame, at = np.unique(other, return_index=True)
        looks = _Camera.at(carried, camera, data.skeleton)
        found.append(looks.compare(carried[one[at]], looks.image(second[frame]), frame))
    return _fitted(found, trackers=2)


def simulated_errors(
    data: MotionData, executions: Sequence[Execution], poses: Poses, camera: Camera, seed: int = 0
) -> JointErrors:
    """Measure the errors of our pose estimator in the same way, on the same motion from the same places."""
    rng = np.random.default_rng(seed)
    found = []
    for first, _, pose in _pairs(data, executions, poses):
        truth = pose.carried(first)
        looks = _Camera.at(truth, camera, data.skeleton)
        sensed = looks.sense(truth, draw_noise(rng, (len(truth),), 1, truth.shape[1]))
        pixels = np.where(sensed.confidence[..., None] > 0, sensed.joints_2d, np.nan)[:, 0]
        seen = np.flatnonzero(np.isfinite(pixels[..., 0]).mean(axis=1) > MOST)
        found.append(looks.compare(truth[seen], pixels[seen], seen))
    return _fitted(found, trackers=1)


def _pairs(
    data: MotionData, executions: Sequence[Execution], poses: Poses
) -> Iterator[tuple[FloatArray, FloatArray, Pose]]:
    """Yield two recordings of each execution, (T, J, 3) and (S, J, 3), and the way from one camera to the other."""
    for execution in executions:
        for one, first in execution.sequences.items():
            for other, second in execution.sequences.items():
                if one != other:
                    yield data.sequence(first)[:, 0], data.sequence(second)[:, 0], poses[execution.name, one, other]


@dataclass(frozen=True, eq=False)
class _Camera:
    """A real camera, at the origin of its own frame, turned towards the people's first place.

    Args:
        centre: (3,) their place [m].
        viewpoint: (3,) where the camera is around it.
        sensor: our pose estimator in its place.
    """

    centre: FloatArray
    viewpoint: FloatArray
    sensor: EstimatorSensor

    @staticmethod
    def at(truth: FloatArray, camera: Camera, skeleton: Skeleton) -> "_Camera":
        """Return the camera that sees joints (T, J, 3), in its own frame."""
        centre = truth[0].mean(axis=0)
        return _Camera(centre, spherical(-centre), EstimatorSensor(skeleton=skeleton, camera=camera))

    def image(self, joints: FloatArray) -> FloatArray:
        """Return joints (n, J, 3) of the camera's frame in its image, (n, J, 2) [px]."""
        return project((joints - self.centre)[:, None], self.viewpoint, self.sensor.camera)[0][:, 0]

    def sense(self, joints: FloatArray, noise: SensorNoise) -> Sensed:
        """Return what our pose estimator says of joints (n, J, 3) of the camera's frame."""
        return self.sensor.sense((joints - self.centre)[:, None], np.tile(self.viewpoint, (len(joints), 1)), noise)

    def compare(self, truth: FloatArray, pixels: FloatArray, frame: IntArray) -> _Errors:
        """Compare pixels (n, J, 2), NaN where joints are missing, with joints (n, J, 3) in the camera's frame."""
        shape, mirror = (len(truth), 1, truth.shape[1]), self.sensor.skeleton.mirror
        quiet = SensorNoise(np.zeros((*shape, 2)), np.ones(shape), np.ones(shape[:2]))
        should = self.image(truth)
        swapped = _off(pixels[:, mirror] - should) < SWAPPED * _off(pixels - should)
        error = np.where(swapped[:, None, None], pixels[:, mirror], pixels) - should
        return _Errors(
            error=error - np.nanmean(error, axis=1, keepdims=True),
            height=np.ptp(should, axis=1).max(axis=-1),
            occluded=self.sense(truth, quiet).confidence[:, 0] == np.float32(self.sensor.occluded_confidence),
            turned=_turned(truth, self.sensor.skeleton),
            swapped=swapped,
            frame=frame,
        )


def _off(difference: FloatArray) -> FloatArray:
    """Return how far off joints are in each frame, the median over joints, (n,) [px]."""
    return np.asarray(np.nanmedian(np.linalg.norm(difference, axis=2), axis=1))


def _turned(truth: FloatArray, skeleton: Skeleton) -> FloatArray:
    """Return the angle between the way that a person faces and the way to the camera, seen from above, (n,) [rad]."""
    to_camera = np.arctan2(*(-truth.mean(axis=1)[:, [1, 0]].T))
    turned: FloatArray = np.abs(wrap_difference(skeleton.heading(truth) - to_camera))
    return turned


def _fitted(found: Sequence[_Errors], *, trackers: int) -> JointErrors:
    """Return the errors of one tracker, where what lies between are those of some independent ones."""
    error, height, occluded, turned, swapped, frame = (np.concatenate(parts) for parts in zip(*found, strict=True))
    plain = [_spread(error[rows][~occluded[rows]]) for rows in np.array_split(np.argsort(height), HEIGHTS)]
    middles = [np.median(part) for part in np.array_split(np.sort(height), HEIGHTS)]
    squares, _ = nnls(np.stack([np.square(middles), np.ones(HEIGHTS)], axis=1), np.square(plain))
    relative, floor = np.sqrt(squares / trackers)
    share = error / height[:, None, None]
    hidden = _spread(share[occluded]) / _spread(share[~occluded])
    side = np.digitize(turned, SIDES)
    swaps = [float(swapped[side == kind].mean()) / trackers for kind in range(3)]
    lasts = np.concatenate([np.broadcast_to(_mean(measured.error), measured.error.shape) for measured in found])
    changing = error - lasts
    follows = np.diff(frame) == 1
    now, then = changing[:-1][follows], changing[1:][follows]
    both = np.isfinite(now + then)
    correlation = float(np.corrcoef(now[both], then[both])[0, 1])
    return JointErrors(
        frames=len(error),
        relative_noise=float(relative),
        noise_floor=float(floor),
        occluded_noise=float(hidden),
        swaps=(swaps[0], swaps[1], swaps[2]),
        lasting=float(np.nansum(lasts**2) / np.nansum(error**2)),
        correlation=correlation,
    )


def _mean(error: FloatArray) -> FloatArray:
    """Return the mean over frames of errors (n, J, 2) that may be NaN, (J, 2); 0 where all are."""
    seen = np.isfinite(error).sum(axis=0)
    mean: FloatArray = np.nansum(error, axis=0) / np.maximum(seen, 1)
    return mean


def _spread(values: FloatArray) -> float:
    """Return the standard deviation of normal values, from the middle half of them."""
    return float(NORMAL * np.nanmedian(np.abs(values)))
