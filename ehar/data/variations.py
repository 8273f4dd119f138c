"""Variations of recorded motion: as somebody of another size, pace or handedness might have performed it.

A policy that trains on few sequences learns who performed them. With variations it generalises better to new people.
"""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.data.motion_data import MotionData
from ehar.data.recordings import interpolated
from ehar.data.skeleton import Skeleton, counterparts
from ehar.data.skeleton_tree import parents, paths, roots
from ehar.data.streams.data import StreamData

PACES = (0.85, 1.18)  # times as fast
SIZES = (0.93, 1.07)  # times as large
LIMBS = 0.1  # a bone is up to this share longer or shorter
TURN = np.radians(15)  # people are turned at the waist by up to this angle
DRIFT = 0.05  # a moment comes earlier or later by up to this share of the whole
_SIDES = re.compile(r"left|right|clockwise", re.IGNORECASE)
_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")


def with_variations(
    data: MotionData, sequences: IntArray, each: int, *, seed: int = 0, bodies: bool = False
) -> MotionData:
    """Return some sequences of a data set, each followed by variations of it.

    The first, third, ... variation is mirrored: x changes its sign, left and right joints swap, and a class with "left"
    in its name becomes the one with "right". A class with a side in its name but no counterpart is not mirrored, nor is
    one that goes clockwise, one of the "other" hand, or the class of the same name without that word.

    Args:
        data: all sequences.
        sequences: (N,) indices of the sequences to vary.
        each: number of variations of each sequence.
        seed: seed of the paces and sizes, which are drawn uniformly.
        bodies: whether variations have other limbs too, and a pace that drifts.

    Returns:
        N (1 + each) sequences, without a split.
    """
    rng = np.random.default_rng(seed)
    class_of_mirrored, can_mirror = _in_a_mirror(data.class_names)
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
            if bodies:
                varied, times = _with_other_limbs(varied, data.skeleton, rng), _drifting(times, rng)
            motions.append(interpolated(varied, times) * np.float32(size))
            labels.append(class_of_mirrored[label] if mirrored else label)
    return _beside(data, sequences, each, motions, labels)


def with_turned_trunks(data: MotionData, sequences: IntArray, each: int, *, seed: int = 0) -> MotionData:
    """Return some sequences of a data set, each followed by variations of it in which people are turned at the waist.

    All above the legs is turned about a vertical axis through where the legs meet, by an angle that each person keeps.

    Args:
        data: all sequences.
        sequences: (N,) indices of the sequences to vary.
        each: number of variations of each sequence.
        seed: seed of the angles, which are drawn uniformly.

    Returns:
        N (1 + each) sequences, without a split; bodies without two legs are not turned.
    """
    rng = np.random.default_rng(seed)
    motions: list[FloatArray] = []
    for index in sequences:
        motion = data.sequence(index)
        motions.append(motion)
        motions.extend(_with_turned_trunk(motion, data.skeleton, rng) for _ in range(each))
    return _beside(data, sequences, each, motions, np.repeat(data.labels[sequences], 1 + each))


def _beside(
    data: MotionData, sequences: IntArray, each: int, motions: Sequence[FloatArray], labels: ArrayLike
) -> MotionData:
    """Return data of some sequences, each followed by its variations; motions and labels are of all of them."""
    copies = np.repeat(sequences, 1 + each)
    return replace(
        data,
        positions=np.concatenate(motions),
        offsets=np.concatenate([[0], np.cumsum([len(motion) for motion in motions])]).astype(np.int64),
        labels=np.asarray(labels, dtype=data.labels.dtype),
        sequence_names=tuple(
            _numbered(data.sequence_names[index], number)
            for index, number in zip(copies, np.tile(np.arange(1 + each), len(sequences)), strict=True)
        ),
        subjects=data.subjects[copies],
        is_test=None,
        missing=None,
        views=None,
        recorded_ms=None,
    )


def with_stream_variations(data: StreamData, streams: IntArray, each: int, *, seed: int = 0) -> StreamData:
    """Return some streams, each followed by variations of it, as `with_variations` does it.

    A stream shows many classes. So none is mirrored if one of them cannot be mirrored.

    Args:
        data: all streams.
        streams: (N,) indices of the streams to vary.
        each: number of variations of each stream.
        seed: seed of the paces and sizes, which are drawn uniformly.

    Returns:
        N (1 + each) streams, without a split.
    """
    rng = np.random.default_rng(seed)
    class_of_mirrored, can_mirror = _in_a_mirror(data.class_names)
    pieces: list[StreamData] = []
    for index in streams:
        plain = _one_stream(data, int(index))
        pieces.append(plain)
        for number in range(each):
            positions, segments = plain.positions, plain.segments
            if number % 2 == 0 and can_mirror.all():
                positions = _mirrored(positions, data.skeleton.mirror)
                segments = np.column_stack([segments[:, :2], class_of_mirrored[segments[:, 2]]])
            pace, size = rng.uniform(*PACES), rng.uniform(*SIZES)
            sized = replace(plain, positions=positions * np.float32(size), segments=segments, fps=pace * data.fps)
            pieces.append(sized.resampled(data.fps))
    offsets = np.concatenate([[0], np.cumsum([len(piece.positions) for piece in pieces])]).astype(np.int64)
    moved = [piece.segments + np.array([begin, begin, 0]) for piece, begin in zip(pieces, offsets[:-1], strict=True)]
    copies = np.repeat(streams, 1 + each)
    return replace(
        data,
        positions=np.concatenate([piece.positions for piece in pieces]),
        offsets=offsets,
        sequence_names=tuple(
            _numbered(data.sequence_names[index], number)
            for index, number in zip(copies, np.tile(np.arange(1 + each), len(streams)), strict=True)
        ),
        subjects=data.subjects[copies],
        is_test=None,
        segments=np.concatenate(moved),
        missing=np.concatenate([piece.missing for piece in pieces]),
    )


def _one_stream(data: StreamData, index: int) -> StreamData:
    """Return a stream by itself."""
    begin, end = (int(edge) for edge in data.offsets[index : index + 2])
    return replace(
        data,
        positions=data.positions[begin:end],
        offsets=np.array([0, end - begin]),
        sequence_names=(data.sequence_names[index],),
        subjects=data.subjects[[index]],
        is_test=None,
        segments=data.segments[data.stream_of == index] - np.array([begin, begin, 0]),
        missing=data.missing[begin:end],
    )


def _in_a_mirror(class_names: tuple[str, ...]) -> tuple[IntArray, BoolArray]:
    """Return the class that each becomes in a mirror, and whether it can be mirrored, both (K,)."""
    class_of_mirrored = counterparts(class_names, joints=False)
    one_sided = np.array([_SIDES.search(name) is not None for name in class_names])
    can_mirror = ~one_sided | (class_of_mirrored != np.arange(len(one_sided)))
    return class_of_mirrored, can_mirror & ~_of_one_or_the_other(class_names)


def _of_one_or_the_other(class_names: tuple[str, ...]) -> BoolArray:
    """Return which classes are told apart by the word "other", (K,): which side is meant they do not say."""
    words = [tuple(word.lower() for word in _WORDS.findall(name)) for name in class_names]
    without = [tuple(word for word in name if word != "other") for name in words]
    pairs = {short for name, short in zip(words, without, strict=True) if short != name}
    return np.array([short in pairs for short in without])


def _numbered(name: str, number: int) -> str:
    return f"{name} ({number})" if number else name


def _with_other_limbs(motion: FloatArray, skeleton: Skeleton, rng: np.random.Generator) -> FloatArray:
    """Return motion (T, P, J, 3) of people with longer and shorter bones, on both sides of the body alike."""
    toward = parents(skeleton)
    drawn = rng.uniform(1 - LIMBS, 1 + LIMBS, size=(motion.shape[1], len(toward), 1))
    factor = (drawn + drawn[:, skeleton.mirror]) / 2
    bones = (motion - motion[:, :, toward]) * factor.astype(np.float32)
    return np.asarray(motion[:, :, roots(toward)] + paths(toward) @ bones)


def _with_turned_trunk(motion: FloatArray, skeleton: Skeleton, rng: np.random.Generator) -> FloatArray:
    """Return motion (T, P, J, 3) of people who are turned at the waist, each by an angle of their own."""
    legs, waist = _legs(motion, skeleton)
    angle = rng.uniform(-TURN, TURN, size=motion.shape[1])
    turned = motion.copy()
    if waist is None:
        return turned
    trunk = np.setdiff1d(np.arange(motion.shape[2]), legs)
    x, y, _ = np.moveaxis(motion[:, :, trunk] - motion[:, :, [waist]], -1, 0)
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    turned[:, :, trunk, 0] = motion[:, :, [waist], 0] + cos * x - sin * y
    turned[:, :, trunk, 1] = motion[:, :, [waist], 1] + sin * x + cos * y
    return turned


def _legs(motion: FloatArray, skeleton: Skeleton) -> tuple[IntArray, int | None]:
    """Return the joints of the legs, and the joint of the body's middle where they meet; no legs and None without.

    A leg is the part of the body that hangs on its middle, and to which the lowest joint with a counterpart belongs.
    """
    toward = parents(skeleton)
    sided = np.flatnonzero(skeleton.mirror != np.arange(len(toward)))
    if len(sided) == 0:
        return np.zeros(0, dtype=np.int64), None
    joint = int(sided[np.argmin(motion[..., sided, 2].mean(axis=(0, 1)))])
    hip = joint
    while skeleton.mirror[joint] != joint and toward[joint] != joint:
        joint, hip = int(toward[joint]), joint
    leg = np.flatnonzero(paths(toward)[:, hip])
    return np.union1d(leg, skeleton.mirror[leg]), joint


def _drifting(times: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return times (S,) of a pace that drifts: it begins and ends with them, and is fast first or slow first."""
    share = times / max(times[-1], 1.0)
    return np.asarray(times + times[-1] * rng.uniform(-DRIFT, DRIFT) * np.sin(np.pi * share) ** 2)


def _mirrored(motion: FloatArray, joints: IntArray) -> FloatArray:
    """Return motion (T, P, J, 3) seen in a mirror, with left and right joints swapped."""
    turned: FloatArray = motion[:, :, joints] * np.array([-1, 1, 1], dtype=np.float32)
    return turned
