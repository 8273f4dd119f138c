"""Which views show people from the front or the side, from 2D joints and the known motion of the camera."""

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.skeleton import Skeleton
from ehar.planner import Context, Observation
from planners.value.body_filter import BodyFilter

KNOWN = 0.5  # least length of a mean direction that counts; for one person, a standard deviation of 67 degrees
LEAST_APART = 0.2  # [m], root mean square distance from the middle; closer people stand on no line
LEAST_FROM_LINE = float(np.pi / 4)  # from the line between people who face each other


def trunk_of(skeleton: Skeleton) -> IntArray:
    """Return the pairs of joints where limbs join the trunk, (pairs, 2) of [left, right].

    These are mirrored joints with a bone to each other or to a joint in the middle: hips and shoulders, not hands. The
    bones alone say so, no motion is looked at. If there is no such pair, all mirrored pairs are taken. A skeleton
    without mirrored joints has none.
    """
    pairs, mirror = skeleton.pairs, skeleton.mirror
    middle = np.flatnonzero(mirror == np.arange(len(mirror)))
    ends = np.concatenate([skeleton.bone_indices, skeleton.bone_indices[:, ::-1]])
    inner = ends[np.isin(ends[:, 1], middle) | (mirror[ends[:, 0]] == ends[:, 1]), 0]
    joined = np.isin(pairs, inner).any(axis=1)
    return pairs[joined] if joined.any() else pairs


def azimuths_at(angle: float, facing: FloatArray, facing_std: FloatArray, position: FloatArray) -> FloatArray:
    r"""Return the azimuths that show P people under an angle from their front, (B, 4) [rad]; NaN where it is not known.

    The front of people is their mean direction :math:`m = \frac{1}{P} \sum_p e^{-\sigma_p^2 / 2} e^{i f_p}`, as long as
    it is at least `KNOWN` long. The azimuths are those on both of its sides.

    If it is shorter though people's facing is known, they face each other, or away from each other. What is the front
    of one is the back of another, so the angle is counted from the line that they stand on, from both of its ends. From
    less than 45 degrees, one would hide another. Then the views across the line are taken, which show all of them from
    the side.

    Args:
        angle: the angle [rad], in [0, pi].
        facing: (B, P) [rad], the azimuths that people face.
        facing_std: (B, P) [rad], their standard deviations.
        position: (B, P, 3) [m], the positions of people.
    """
    certainty = np.exp(-(facing_std**2) / 2)  # the length of the mean direction of a normal angle
    mean = (certainty * np.exp(1j * facing)).mean(axis=1)
    one_way = np.abs(mean) >= KNOWN
    east, north = np.moveaxis(position[..., :2] - position[..., :2].mean(axis=1, keepdims=True), -1, 0)
    apart = np.sqrt((east**2 + north**2).mean(axis=1)) >= LEAST_APART
    opposed = ~one_way & apart & (certainty.mean(axis=1) >= KNOWN)
    # The axis along which positions spread most; for two people, the line between them.
    line = np.arctan2(2 * (east * north).sum(axis=1), (east**2 - north**2).sum(axis=1)) / 2
    from_line = angle if LEAST_FROM_LINE - 1e-9 <= angle <= np.pi - LEAST_FROM_LINE + 1e-9 else np.pi / 2
    from_front = np.angle(mean)[:, None] + np.array([angle, -angle, angle, -angle])
    from_ends = line[:, None] + np.array([from_line, -from_line, np.pi + from_line, np.pi - from_line])
    return np.where(one_way[:, None], from_front, np.where(opposed[:, None], from_ends, np.nan))


class PeopleTracker:
    """Tracks people frame by frame, in B episodes at once.

    Args:
        context: the episodes; its skeleton says left from right.
    """

    def __init__(self, context: Context) -> None:
        """Create the tracker."""
        pairs = trunk_of(context.skeleton)
        self._body = BodyFilter.of(context, pairs) if len(pairs) else None

    def update(self, observation: Observation) -> None:
        """Take in one more frame; frame 0 forgets what was before."""
        self._episodes = len(observation.joints_2d)
        if self._body is not None:
            self._body.observe(observation)

    def azimuths_at(self, angle: float) -> FloatArray:
        """Return the azimuths that show people under an angle from their front, (B, 4) [rad]; NaN where not known."""
        if self._body is None:
            return np.full((self._episodes, 4), np.nan)
        return azimuths_at(angle, self._body.facing, self._body.facing_std, self._body.position)
