"""Variations of recorded motion: as somebody of another size, pace or handedness might have performed it.

A policy that trains on few sequences learns who performed them. With variations it generalises better to new people.
"""

import re
from dataclasses import replace

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.motion_data import MotionData
from ehar.data.recordings import interpolated
from ehar.data.skeleton import counterparts

PACES = (0.85, 1.18)  # times as fast
SIZES = (0.93, 1.07)  # times as large
_SIDES = re.compile(r"left|right", re.IGNORECASE)


def with_variations(data: MotionData, sequences: IntArray, each: int, *, seed: int = 0) -> MotionData:
    """Return some sequences of a data set, each followed by variations of it.

    The first, third, ... variation is mirrored: x changes its sign, left and right joints swap, and a class with "left"
    in its name becomes the one with "right". A class with a side in its name but no counterpart is not mirrored.

    Args:
        data: all sequences.
        sequences: (N,) indices of the sequences to vary.
        each: number of variations of each sequence.
        seed: seed of the paces and sizes, which are drawn uniformly.

    Returns:
        N (1 + each) sequences, without a split.
    """
    rng = np.random.default_rng(seed)
    class_of_mirrored = counterparts(data.class_names)
    one_sided = np.array([_SIDES.search(name) is not None for name in data.class_names])
    can_mirror = ~one_sided | (class_of_mirrored != np.arange(len(one_sided)))
    motions: list[FloatArray] = []
    labels: list[int] = []
    for index in sequences:
        motion, label = data.sequence(index), data.labels[index]
        motions.append(motion)
        labels.append(label)
        for number in range(each):
            mirrored = number % 2 == 0 and can_mirror[label]
            varied = _mirrored(motion, data.skeleton.mirror) if mirrored else motion
            pace, size = rng.uniform(*PACES), rng.uniform(*SIZES)
            times = np.arange(int((len(motion) - 1) / pace) + 1) * pace
            motions.append(interpolated(varied, times) * np.float32(size))
            labels.append(class_of_mirrored[label] if mirrored else label)
    copies = np.repeat(sequences, 1 + each)
    return replace(
        data,
        positions=np.concatenate(motions),
        offsets=np.concatenate([[0], np.cumsum([len(motion) for motion in motions])]).astype(np.int64),
        labels=np.array(labels, dtype=data.labels.dtype),
        sequence_names=tuple(
            f"{data.sequence_names[index]} ({number})" if number else data.sequence_names[index]
            for index, number in zip(copies, np.tile(np.arange(1 + each), len(sequences)), strict=True)
        ),
        subjects=data.subjects[copies],
        is_test=None,
        missing=None,
    )


def _mirrored(motion: FloatArray, joints: IntArray) -> FloatArray:
    """Return motion (T, P, J, 3) seen in a mirror, with left and right joints swapped."""
    turned: FloatArray = motion[:, :, joints] * np.array([-1, 1, 1], dtype=np.float32)
    return turned
