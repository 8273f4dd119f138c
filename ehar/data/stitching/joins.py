"""Joins two recordings of the same people: the second begins where and as turned as the first one ended."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.data.skeleton import Skeleton
from ehar.data.skeleton_tree import parents, paths, roots

DURATIONS = (0.5, 0.75, 1.0, 1.25, 1.5)  # [s] of a join
FAST = 3.0  # [m/s]; a join takes longer if a joint would be faster
TURN = 2.0  # [rad] of a bone's direction that its speed may carry it on in a join
OPPOSITE = -0.5  # cosine of bones' directions from which they go round, and not through the joint


def placed(motion: FloatArray, end: FloatArray, skeleton: Skeleton) -> FloatArray:
    """Return motion (T, P, J, 3) turned about the axis up and moved, so that it begins where `end` (P, J, 3) is."""
    turn = _heading(end, skeleton) - _heading(motion[0], skeleton)
    c, s = np.cos(turn), np.sin(turn)
    level = motion[..., :2] - motion[0, ..., :2].mean(axis=(0, 1))
    turned = np.stack([c * level[..., 0] - s * level[..., 1], s * level[..., 0] + c * level[..., 1]], axis=-1)
    there: FloatArray = np.concatenate([turned + end[..., :2].mean(axis=(0, 1)), motion[..., 2:]], axis=-1)
    return there.astype(np.float32)


def join(before: FloatArray, after: FloatArray, skeleton: Skeleton, fps: float) -> FloatArray:
    """Return the frames (n, P, J, 3) between two recordings (T, P, J, 3) and (S, P, J, 3); the second is in its place.

    Bones turn from where they were to where they will be, at both ends n / (n + 1) times as fast as they turned there,
    and keep their lengths. The lowest joint stays as high above the ground as it was and will be. A join takes the
    shortest of the `DURATIONS` in which no joint is faster than `FAST`, or else the longest.
    """
    for seconds in DURATIONS:
        between = _between(before, after, skeleton, max(1, round(seconds * fps) - 1))
        whole = np.concatenate([before[-1:], between, after[:1]])
        if np.linalg.norm(np.diff(whole, axis=0), axis=-1).max() * fps <= FAST:
            break
    return between


def _between(before: FloatArray, after: FloatArray, skeleton: Skeleton, frames: int) -> FloatArray:
    """Return so many frames between two recordings."""
    toward = parents(skeleton)
    root = roots(toward)
    share = (np.arange(1, frames + 1) / (frames + 1))[:, None, None, None]
    ends = [np.stack([recording[at] for at in pair]) for recording, pair in ((before, (-2, -1)), (after, (0, 1)))]
    bones = [pair - pair[..., toward, :] for pair in ends]
    lengths = [np.linalg.norm(pair, axis=-1, keepdims=True) for pair in bones]
    ways = [bone / np.maximum(length, 1e-6) for bone, length in zip(bones, lengths, strict=True)]
    out, into = (_limited((way[1] - way[0]) * frames, TURN) for way in ways)
    turning = _curve(ways[0][1], ways[1][0], out, into, share) + _round(ways[0][1], ways[1][0]) * share * (1 - share)
    turning /= np.maximum(np.linalg.norm(turning, axis=-1, keepdims=True), 1e-6)
    eased = share**2 * (3 - 2 * share)
    length = lengths[0][1] + (lengths[1][0] - lengths[0][1]) * eased
    drift = [(pair[1] - pair[0])[..., root, :] * frames for pair in ends]
    middle = _curve(ends[0][1][..., root, :], ends[1][0][..., root, :], drift[0], drift[1], share)
    joints = middle + np.einsum("jk,npkc->npjc", paths(toward), turning * length)
    ground = [pair[at][..., 2].min(axis=-1) for pair, at in zip(ends, (1, 0), strict=True)]
    height = ground[0] + (ground[1] - ground[0]) * eased[:, :, 0, 0]
    joints[..., 2] += (height - joints[..., 2].min(axis=-1))[..., None]
    between: FloatArray = joints.astype(np.float32)
    return between


def _curve(start: FloatArray, end: FloatArray, out: FloatArray, into: FloatArray, share: FloatArray) -> FloatArray:
    """Return the cubic (n, ...) between two values that has their slopes, at shares (n, ...) of the way (Hermite)."""
    s2, s3 = share**2, share**3
    curve: FloatArray = (
        (2 * s3 - 3 * s2 + 1) * start + (s3 - 2 * s2 + share) * out + (3 * s2 - 2 * s3) * end + (s3 - s2) * into
    )
    return curve


def _round(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the way sideways for bones that have to turn to nearly the opposite, or else they would vanish halfway."""
    cosine = (start * end).sum(axis=-1, keepdims=True)
    aside = np.cross(start, np.where(np.abs(start[..., 2:]) < 0.9, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
    aside /= np.maximum(np.linalg.norm(aside, axis=-1, keepdims=True), 1e-6)
    wide: FloatArray = 4 * aside * np.clip((OPPOSITE - cosine) / (1 + OPPOSITE), 0, 1)
    return wide


def _limited(vector: FloatArray, most: float) -> FloatArray:
    """Return vectors (..., 3) that are at most so long."""
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    limited: FloatArray = vector * np.minimum(1, most / np.maximum(length, 1e-9))
    return limited


def _heading(joints: FloatArray, skeleton: Skeleton) -> float:
    """Return the way that a person faces, or of two the way from the first to the second, seen from above [rad]."""
    if len(joints) > 1:
        east, north = (joints[1] - joints[0]).mean(axis=0)[:2]
        return float(np.arctan2(north, east))
    return float(skeleton.heading(joints[0]))
