"""The skeleton of one person: joint names, bones, and which joints are each other's mirror image."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ehar.arrays import FloatArray, IntArray, in_brief, read_only

LIMB_RADIUS = 0.05  # [m], about a forearm's or a shin's
TRUNK_RADIUS = 0.12  # [m], for bones between two joints of the body's middle: spine, neck, head

_LEFT_TO_RIGHT = (
    (r"^(.*[_\-. :])?left([_\-. ]?.*)$", "right"),
    (r"^(.*[_\-. ])l$()", "r"),
    (r"^()l([_\-. ]?.+)$", "r"),  # of joints alone: to lead is not the other side of to read
)


@dataclass(frozen=True, repr=False)
class Skeleton:
    """Joints and bones of one person.

    Args:
        joint_names: J names.
        bones: pairs of joint indices.
    """

    joint_names: tuple[str, ...]
    bones: tuple[tuple[int, int], ...]

    __repr__ = in_brief

    @cached_property
    def bone_indices(self) -> IntArray:
        """The bones as an array (bones, 2)."""
        return read_only(np.array(self.bones, dtype=np.int64).reshape(-1, 2))

    @cached_property
    def mirror(self) -> IntArray:
        """The joint on the other side of the body for every joint, (J,); a joint in the middle has itself.

        Read from the names: `left_hip`/`right_hip`, `lhip`/`rhip`, `Hand_L`/`Hand_R`, in upper or lower case.
        """
        return read_only(counterparts(self.joint_names))

    @cached_property
    def pairs(self) -> IntArray:
        """The joints that are each other's mirror image, (pairs, 2) of [left, right], whichever comes first."""
        found = sorted((left, right) for left, right, _ in _pairs(self.joint_names))
        return read_only(np.array(found, dtype=np.int64).reshape(-1, 2))

    def bone_radii(self, limb: float = LIMB_RADIUS, trunk: float = TRUNK_RADIUS) -> FloatArray:
        """Return the radius [m] of a capsule around each bone, (bones,): that of a limb, or of the body's middle."""
        middle = self.mirror == np.arange(len(self.mirror))
        of_trunk = middle[self.bone_indices].all(axis=1) & ~middle.all()
        return np.where(of_trunk, trunk, limb).astype(np.float32)

    def heading(self, joints: FloatArray) -> FloatArray:
        """Return the way that bodies (..., J, 3) face, seen from above, from x towards y [rad], (...,).

        Without joints on two sides it is 0: nobody can say how such a body is turned.
        """
        if len(self.pairs) == 0:
            return np.zeros(joints.shape[:-2])
        left, right = self.pairs.T
        to_left = (joints[..., left, :] - joints[..., right, :]).mean(axis=-2)
        heading: FloatArray = np.arctan2(-to_left[..., 0], to_left[..., 1])  # forward is left x up
        return heading


def counterparts(names: Sequence[str], *, joints: bool = True) -> IntArray:
    """Return the index of each name's counterpart on the other side, left for right, or its own index, (N,).

    Args:
        names: N names.
        joints: whether they name joints, of which `lhip` is a left one; no class is one by its first letter.
    """
    other = np.arange(len(names))
    for left, right, _ in _pairs(names, joints=joints):
        other[left], other[right] = right, left
    return other


def sides(names: Sequence[str]) -> list[tuple[str, str]]:
    """Return the side of each name, `left`, `right` or none, and the name without it, in lower case."""
    found = [("", _without_prefix(name.lower())) for name in names]
    for left, right, stem in _pairs(names):
        found[left], found[right] = ("left", _without_prefix(stem)), ("right", _without_prefix(stem))
    return found


def _pairs(names: Sequence[str], *, joints: bool = True) -> Iterator[tuple[int, int, str]]:
    """Yield the indices of a left and a right name, and what is left of them without the side."""
    index = {name.lower(): i for i, name in enumerate(names)}
    for name, left in index.items():
        for pattern, right_word in _LEFT_TO_RIGHT if joints else _LEFT_TO_RIGHT[:2]:
            match = re.match(pattern, name)
            right = index.get(f"{match[1] or ''}{right_word}{match[2]}") if match else None
            if match is not None and right is not None:
                yield left, right, f"{match[1] or ''}{match[2]}"
                break


def _without_prefix(name: str) -> str:
    return name.rpartition(":")[2]  # BVH files of Mixamo write `mixamorig:LeftLeg`
