"""Frames in which the tracker lost a joint: NaN in positions, which is filled from the frames around it."""

import numpy as np

from ehar.arrays import BoolArray, FloatArray
from ehar.data.skeleton import Skeleton
from ehar.errors import DataError


def fill_gaps(motion: FloatArray, skeleton: Skeleton, where: str) -> tuple[FloatArray, BoolArray]:
    """Return motion (T, P, J, 3) without NaN or infinities, and in which frames (T,) it had some.

    Each joint moves in a straight line between the frames before and after a gap. Before the first and after the last
    frame that it is seen in, it stays where it is. A joint is seen if all its coordinates are finite.

    Args:
        motion: the motion of one sequence.
        skeleton: its joints, for errors.
        where: file and sequence, for errors.

    Raises:
        DataError: a person or a joint is in no frame of the sequence.
    """
    lost = np.asarray(~np.isfinite(motion).all(axis=-1))
    gaps = np.asarray(lost.any(axis=(1, 2)))
    if not gaps.any():
        return motion, gaps
    never = np.asarray(lost.all(axis=0))
    if never.all(axis=1).any():
        person = int(never.all(axis=1).argmax()) + 1
        raise DataError(
            f"{where}: person {person} of {motion.shape[1]} is in no frame; expected everybody in at least one: "
            "keep sequences of fewer people in a file of their own"
        )
    if never.any():
        person, joint = (int(index[0]) for index in np.nonzero(never))
        named = f"joint {skeleton.joint_names[joint]!r} of person {person + 1}"
        raise DataError(f"{where}: {named} is in no frame; expected it in at least one, or a skeleton without it")
    filled = motion.copy()
    frames = np.arange(len(motion))
    for person, joint in np.argwhere(lost.any(axis=0)).tolist():
        hidden = lost[:, person, joint]
        seen = np.flatnonzero(~hidden)
        for axis in range(3):
            known = motion[seen, person, joint, axis]
            filled[hidden, person, joint, axis] = np.interp(frames[hidden], seen, known)
    return filled, gaps


def without_empty_bodies(motion: FloatArray) -> FloatArray:
    """Return motion (T, P, J, 3) with NaN for people all of whose joints are 0: trackers write so where nobody is."""
    absent = (motion == 0).all(axis=(2, 3))
    if not absent.any():
        return motion
    marked = motion.copy()
    marked[absent] = np.nan
    return marked
