"""New people made of known ones: other proportions, another posture, another tempo, as an unseen person would have."""

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.motion_data import MotionData
from planners.body_filter import trunk_pairs
from recognition.graph import parents

LIMB_SPREAD = 0.15  # a bone is longer or shorter by up to this share, left and right alike
TEMPO_SPREAD = 0.25  # faster by up to this share, or slower as much
POSTURE_SPREAD = 1.0  # times the difference between two performances of the same activity
SHORTEST_BONE = 1e-9  # [m]


def perturbed_windows(
    rng: np.random.Generator,
    data: MotionData,
    sequences: IntArray,
    length: int,
    *,
    limbs: float = LIMB_SPREAD,
    tempo: float = TEMPO_SPREAD,
    posture: float = POSTURE_SPREAD,
) -> FloatArray:
    """Draw a window of each of N sequences as another person might have performed it.

    A recogniser meets people that it knows in every training sequence, and new ones only when it is tested: how sure
    it may then be cannot be read from how it does on those it knows. Here each person's bones get factors of their
    own, the same on both sides, and the scene plays faster or slower (a sequence too short for faster does not). The
    posture moves by the difference of two others' mean postures in the same activity, drawn from the same sequences:
    were people independent draws, a new one would differ from a known one by just such a difference.

    Args:
        rng: the generator.
        data: the motion.
        sequences: (N,), each of at least `length` frames.
        length: L, frames.
        limbs: spread of the bones' lengths.
        tempo: spread of the speed.
        posture: scales the difference of postures.

    Returns:
        positions (N, L, P, J, 3) float32 [m], relative to the mean of each window.

    Raises:
        DataError: the skeleton has no left and right, from which to read the facing that postures are compared in.
    """
    motion = _windows(rng, data, sequences, length, tempo)
    parent, mirror = parents(data.skeleton), data.skeleton.mirror
    episodes, _, persons, joints, _ = motion.shape
    bones = motion - motion[..., parent, :]  # zero for a root
    lengths = np.linalg.norm(bones, axis=-1, keepdims=True)
    if posture > 0:
        pairs = trunk_pairs(data, np.unique(sequences))
        others = [_partners(rng, data, sequences) for _ in range(2)]
        first, second = (_posture(_windows(rng, data, other, length, 0.0), parent, pairs) for other in others)
        difference = _turned(first - second, _facing(motion, pairs)[..., None])
        bones = bones + posture * lengths * difference[:, None]
        bones *= lengths / np.maximum(np.linalg.norm(bones, axis=-1, keepdims=True), SHORTEST_BONE)
    factors = np.exp(np.log1p(limbs) * rng.uniform(-1, 1, (episodes, 1, persons, joints, 1)))
    bones *= factors[..., np.minimum(np.arange(joints), mirror), :]
    rooted = np.where((parent == np.arange(joints))[:, None], motion, bones)
    # A joint is its parent plus a bone: x = M x + b, hence x = (1 - M)^-1 b.
    steps = np.eye(joints)[parent] * (parent != np.arange(joints))[:, None]
    perturbed = np.linalg.inv(np.eye(joints) - steps) @ rooted
    centred: FloatArray = perturbed - perturbed.mean(axis=(1, 2, 3), keepdims=True)
    return centred.astype(np.float32)


def _windows(rng: np.random.Generator, data: MotionData, sequences: IntArray, length: int, tempo: float) -> FloatArray:
    """Return a window (N, L, P, J, 3) of each sequence, played at a tempo of its own."""
    frames = data.lengths[sequences]
    fastest = (frames - 1) / max(length - 1, 1)
    speed = np.minimum(np.exp(np.log1p(tempo) * rng.uniform(-1, 1, len(sequences))), fastest)
    first = rng.random(len(sequences)) * (frames - 1 - speed * (length - 1))
    times = first[:, None] + speed[:, None] * np.arange(length)
    before = np.minimum(times.astype(np.int64), frames[:, None] - 1)
    after = np.minimum(before + 1, frames[:, None] - 1)
    share = (times - before)[..., None, None, None]
    begin = data.offsets[sequences][:, None]
    motion: FloatArray = (1 - share) * data.positions[begin + before] + share * data.positions[begin + after]
    return motion


def _partners(rng: np.random.Generator, data: MotionData, sequences: IntArray) -> IntArray:
    """Return for each of the sequences a random one of them of the same class, (N,)."""
    partners = np.empty_like(sequences)
    labels = data.labels[sequences]
    for label in np.unique(labels):
        members = labels == label
        partners[members] = rng.choice(np.unique(sequences[members]), size=int(members.sum()))
    return partners


def _posture(motion: FloatArray, parent: IntArray, pairs: IntArray) -> FloatArray:
    """Return the mean direction of every bone over windows, seen from the person's facing, (N, P, J, 3)."""
    bones = motion - motion[..., parent, :]
    length = np.linalg.norm(bones, axis=-1, keepdims=True).mean(axis=1)
    return _turned(bones.mean(axis=1) / np.maximum(length, SHORTEST_BONE), -_facing(motion, pairs)[..., None])


def _facing(motion: FloatArray, pairs: IntArray) -> FloatArray:
    """Return the azimuths that people face over windows (N, L, P, J, 3), (N, P) [rad]."""
    left, right = pairs.T
    lateral = (motion[..., left, :] - motion[..., right, :]).mean(axis=(1, 3))
    facing: FloatArray = np.arctan2(lateral[..., 1], lateral[..., 0]) - np.pi / 2
    return facing


def _turned(vectors: FloatArray, azimuth: FloatArray) -> FloatArray:
    """Return vectors (..., 3) turned about the vertical by angles (...,) [rad]."""
    level = (vectors[..., 0] + 1j * vectors[..., 1]) * np.exp(1j * azimuth)
    return np.stack([level.real, level.imag, vectors[..., 2]], axis=-1)
