"""Clips of 3D joints as CTR-GCN was published with on Northwestern-UCLA (Chen et al. 2021, and its public code).

A clip is a whole sequence: put at its first frame's second joint, turned and scaled at random in training, scaled to
[-1, 1] along each axis, and cut to 52 frames. People turn about the vertical, and then tilt towards the camera or away
from it, as if it stood elsewhere. They never lean to a side.
"""

from typing import Literal, get_args

import numpy as np

from ehar.arrays import FloatArray, IntArray

Stream = Literal["joint", "bone"]
STREAMS = get_args(Stream)

FRAMES = 52
CENTRE = 1  # the joint that a sequence is put at: the spine
TURN = 60  # degrees, whole ones: the greatest random turn about the axes to the right and up
SCALES = (0.5, 1.5)  # of the random size


def published_clip(
    motion: FloatArray, stream: Stream, parents: IntArray, rng: np.random.Generator | None = None
) -> FloatArray:
    """Return a clip of one sequence.

    Args:
        motion: (T, P, J, 3) joints [m], z up.
        stream: the joints, or each joint minus its parent.
        parents: (J,) each joint's neighbour towards the skeleton's centre.
        rng: draws the turn, the size and the frames of a training clip; without it nothing is random.

    Returns:
        (52, P, J, 3) float32.
    """
    centred = motion - motion[0, 0, CENTRE]
    if rng is None:
        frames = np.linspace(0, len(motion) - 1, FRAMES).astype(np.int64)
    else:
        right, up = np.radians(rng.integers(-TURN, TURN + 1, size=2))
        centred = centred @ _turn(up, right).T * rng.uniform(*SCALES)
        frames = np.sort(rng.choice(np.tile(np.arange(len(motion)), 100), FRAMES, replace=False))
    low, high = centred.min(axis=(0, 1, 2)), centred.max(axis=(0, 1, 2))
    scaled = (centred - low) / np.maximum(high - low, 1e-6) * 2 - 1
    clip: FloatArray = scaled[frames]
    if stream == "bone":
        clip = clip - clip[:, :, parents]
    return clip.astype(np.float32, copy=False)


def _turn(up: float, right: float) -> FloatArray:
    """Return the rotation (3, 3) about the axis up, and then about the one to the right [rad]."""
    (c, s), (d, t) = ((np.cos(angle), np.sin(angle)) for angle in (right, up))
    about_right = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    about_up = np.array([[d, -t, 0], [t, d, 0], [0, 0, 1]])
    turned: FloatArray = about_right @ about_up
    return turned
