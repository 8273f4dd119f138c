"""The clips of an epoch of the published protocol: its seed and its number decide them, so they are drawn ahead."""

from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.motion_data import MotionData
from ehar.data.skeleton_tree import parents
from recognition.published.clips import Stream, published_clip

BATCH = 16
REPEATS = 5  # of each training sequence in an epoch


@dataclass(frozen=True)
class Epoch:
    """The clips of one epoch, in the order in which a network learns from them.

    Args:
        clips: (S, N, 52, P, J, 3) float32, in S batches of N.
        labels: (S, N) int64.
    """

    clips: FloatArray
    labels: IntArray


@dataclass(frozen=True)
class Draw:
    """What decides the clips of an epoch.

    Args:
        stream: joints or bones.
        seed: seed of the training.
        epoch: the epoch, counted from 0.
    """

    stream: Stream
    seed: int
    epoch: int


def draw_epoch(data: MotionData, draw: Draw) -> Epoch:
    """Return the clips of the training sequences in a random order, each turned, sized and cut at random.

    Batches are whole. With fewer clips than one holds, there is one of all of them.
    """
    assert data.is_test is not None
    rng = np.random.default_rng((draw.seed, draw.epoch))
    sequences = rng.permutation(np.repeat(np.flatnonzero(~data.is_test), REPEATS))
    size = min(BATCH, len(sequences))
    batches = sequences[: len(sequences) // size * size].reshape(-1, size)
    towards = parents(data.skeleton)
    clips = [published_clip(data.sequence(i), draw.stream, towards, rng) for i in batches.flat]
    return Epoch(np.stack(clips).reshape(*batches.shape, *clips[0].shape), data.labels[batches].astype(np.int64))
