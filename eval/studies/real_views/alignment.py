"""Lays one camera's recording of an execution over another's: how frames belong together, and how cameras stand."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray, IntArray

ROUNDS = 3  # of matching frames, and of fitting the rotation to joints that fit
KEPT = 0.7  # share of the joints that decide a rotation: trackers lose limbs


@dataclass(frozen=True, eq=False)
class Pose:
    """The way from one camera's frame to another's.

    Args:
        rotation: (3, 3).
        translation: (3,) where the first camera stands in the second's frame [m].
    """

    rotation: FloatArray
    translation: FloatArray

    def carried(self, joints: FloatArray) -> FloatArray:
        """Return joints (..., 3) [m] of the first camera's frame in the second's."""
        carried: FloatArray = joints @ self.rotation.T + self.translation
        return carried

    @property
    def other_camera(self) -> FloatArray:
        """Where the second camera stands in the first's frame, (3,) [m]."""
        place: FloatArray = -self.rotation.T @ self.translation
        return place


def find_pose(first: FloatArray, second: FloatArray) -> Pose:
    """Find the way between two cameras from their recordings of one execution, joints (T, J, 3) and (S, J, 3) [m].

    Frames are matched by the distances between the joints of a body, which no camera changes. The rotation follows from
    the joints that fit best. Then frames are matched by where joints are, and so on.
    """
    inside = _distances_within(first), _distances_within(second)
    cost = np.abs(inside[0][:, None] - inside[1][None]).mean(axis=2)
    for _ in range(ROUNDS):
        one, other = matched(cost)
        pose = rigid(first[one], second[other])
        cost = apart(pose.carried(first), second)
    return pose


def consensus(poses: Sequence[Pose]) -> Pose:
    """Return the pose on which most executions agree: the rotation nearest to the others, and the middle place.

    A tracker that takes somebody's back for the front turns single executions by half a circle.
    """
    rotations = np.stack([pose.rotation for pose in poses])
    angle = np.arccos(np.clip((np.einsum("aij,bij->ab", rotations, rotations) - 1) / 2, -1, 1))
    nearest = int(np.median(angle, axis=1).argmin())
    alike = angle[nearest] <= np.median(angle[nearest])
    return Pose(
        rotations[nearest],
        np.median([pose.translation for pose, near in zip(poses, alike, strict=True) if near], axis=0),
    )


def apart(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the mean distance of joints between all frames of two recordings, (T, S) [m]."""
    distance: FloatArray = np.linalg.norm(first[:, None] - second[None], axis=3).mean(axis=2)
    return distance


def same_moments(first: FloatArray, second: FloatArray, mirror: IntArray) -> tuple[IntArray, IntArray]:
    """Return the frames (n,) and (n,) of two recordings, (T, J, 3) and (S, J, 3) of one frame, that belong together.

    A tracker may have swapped sides: `mirror` (J,) is the joint on the other side of each.
    """
    return matched(np.minimum(apart(first, second), apart(first, second[:, mirror])))


def matched(cost: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the frames (n,) and (n,) on the cheapest path through a cost (T, S), from corner to corner.

    Each step goes on by a frame in one recording, or in both (Sakoe and Chiba, IEEE TASSP 1978).
    """
    total = np.full((cost.shape[0] + 1, cost.shape[1] + 1), np.inf)
    total[0, 0] = 0
    for i, row in enumerate(cost.tolist()):
        above, here = total[i].tolist(), np.inf
        for k, price in enumerate(row):
            here = price + min(above[k], above[k + 1], here)
            total[i + 1, k + 1] = here
    i, k = cost.shape
    path = []
    while i > 0 and k > 0:
        path.append((i - 1, k - 1))
        i, k = min(((i - 1, k - 1), (i - 1, k), (i, k - 1)), key=lambda at: total[at])
    found = np.array(path[::-1])
    return found[:, 0], found[:, 1]


def rigid(first: FloatArray, second: FloatArray) -> Pose:
    """Return the pose that carries joints (n, J, 3) to others; some may be far off (Kabsch, Acta Cryst. A 1976)."""
    a, b = first.reshape(-1, 3).astype(np.float64), second.reshape(-1, 3).astype(np.float64)
    fits = np.ones(len(a), dtype=bool)
    for _ in range(ROUNDS):
        middle_a, middle_b = a[fits].mean(axis=0), b[fits].mean(axis=0)
        u, _, vt = np.linalg.svd((a[fits] - middle_a).T @ (b[fits] - middle_b))
        proper = np.diag([1, 1, np.sign(np.linalg.det(vt.T @ u.T))])
        rotation = vt.T @ proper @ u.T
        pose = Pose(rotation, middle_b - rotation @ middle_a)
        off = np.linalg.norm(pose.carried(a) - b, axis=1)
        fits = off <= np.quantile(off, KEPT)
    return pose


def _distances_within(motion: FloatArray) -> FloatArray:
    """Return the distances between all pairs of joints, (T, J (J - 1) / 2) [m]."""
    one, other = np.triu_indices(motion.shape[1], 1)
    distances: FloatArray = np.linalg.norm(motion[:, one] - motion[:, other], axis=2)
    return distances
