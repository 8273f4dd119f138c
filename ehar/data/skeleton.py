"""The skeleton of one person: joint names, bones, and which joints are each other's mirror image."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ehar.arrays import IntArray, in_brief, read_only

_LEFT_TO_RIGHT = (
    (r"^(.*[_\-. ])?left([_\-. ]?.*)$", "right"),
    (r"^(.*[_\-. ])l$()", "r"),
    (r"^()l([_\-. ]?.+)$", "r"),
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


def counterparts(names: Sequence[str]) -> IntArray:
    """Return the index of each name's counterpart on the other side, left for right, or its own index, (N,)."""
    index = {name.lower(): i for i, name in enumerate(names)}
    other = np.arange(len(names))
    for name, left in index.items():
        for pattern, right_word in _LEFT_TO_RIGHT:
            match = re.match(pattern, name)
            right = index.get(f"{match[1] or ''}{right_word}{match[2]}") if match else None
            if right is not None:
                other[left], other[right] = right, left
                break
    return other
