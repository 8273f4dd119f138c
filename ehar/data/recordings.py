"""Recorded motion in memory, whatever is known of its activities: sequences of joint positions."""

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.data.skeleton import Skeleton
from ehar.errors import UsageError

UNKNOWN_SUBJECT = -1
MOST_RATE = 10_000  # frames per second; motion capture has up to 1,000
SYNTHETIC = "(synthetic)"  # behind the name of motion that was generated, in titles


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Recordings:
    """Sequences of joint positions, in metres, z up, right-handed.

    Args:
        name: name of the data in reports.
        positions: (total_frames, P, J, 3) float32 [m], all sequences one after another.
        offsets: (sequences + 1,) int64; sequence i is `positions[offsets[i]:offsets[i + 1]]`.
        class_names: K names.
        sequence_names: one name per sequence.
        fps: frames per second.
        skeleton: the skeleton of one person.
        is_test: (sequences,) bool, True for test sequences; None for data without a split.
        subjects: (sequences, P) ints, the performers; -1 is unknown.
        license: the license of the motion.
        synthetic: whether the motion was generated.
    """

    name: str
    positions: FloatArray
    offsets: IntArray
    class_names: tuple[str, ...]
    sequence_names: tuple[str, ...]
    fps: float
    skeleton: Skeleton
    is_test: BoolArray | None
    subjects: IntArray
    license: str = ""
    synthetic: bool = False

    def __repr__(self) -> str:
        """Return one line: sequences, frames, persons, joints and classes."""
        persons = f"{self.persons} person{'s' * (self.persons != 1)} of {len(self.skeleton.joint_names)} joints"
        return (
            f"{type(self).__name__}({self.title}: {len(self.lengths)} sequences, {len(self.positions)} frames at "
            f"{self.fps:g} fps, {persons}, {len(self.class_names)} classes)"
        )

    @property
    def lengths(self) -> IntArray:
        """Frames of each sequence, (sequences,)."""
        return np.diff(self.offsets)

    @property
    def persons(self) -> int:
        """The number of persons in every frame."""
        return int(self.positions.shape[1])

    @property
    def unnamed(self) -> int:
        """The number of sequences in which somebody is not named."""
        return int((self.subjects == UNKNOWN_SUBJECT).any(axis=1).sum())

    @property
    def recognised_names(self) -> tuple[str, ...]:
        """Names of all that a recogniser tells apart."""
        return self.class_names

    @property
    def title(self) -> str:
        """The name for people to read; it marks synthetic motion."""
        return f"{self.name} {SYNTHETIC}" if self.synthetic else self.name

    def sequence(self, index: int) -> FloatArray:
        """Return the positions (T, P, J, 3) of one sequence."""
        return self.positions[self.offsets[index] : self.offsets[index + 1]]

    @cached_property
    def sha256(self) -> str:
        """A hash of everything that decides an episode; recorded beside every result."""
        digest = hashlib.sha256()
        digest.update(np.ascontiguousarray(self.positions, dtype=np.float32).tobytes())
        # Who performs decides the parts, where the data are not divided already.
        for indices in (self.offsets, *self._activities, self.skeleton.bone_indices, self.subjects):
            digest.update(np.ascontiguousarray(indices, dtype=np.int64).tobytes())
        if self.is_test is not None:
            digest.update(self.is_test.tobytes())
        words = (*self.class_names, *self.sequence_names, *self.skeleton.joint_names, repr(float(self.fps)))
        digest.update("\0".join(words).encode())
        return digest.hexdigest()

    @property
    def _activities(self) -> tuple[IntArray, ...]:
        """What is known of the activities."""
        return ()

    def _at_rate(self, fps: float) -> tuple[FloatArray, IntArray]:
        """Return positions and offsets at another frame rate.

        Raises:
            UsageError: the rate is not above 0, or too high to be meant.
        """
        if not 0 < fps <= MOST_RATE:
            raise UsageError(f"fps: got {fps}, expected frames per second above 0, and at most {MOST_RATE}")
        pieces = []
        for index in range(len(self.lengths)):
            motion = self.sequence(index)
            duration = (len(motion) - 1) / self.fps
            times = np.arange(int(np.floor(duration * fps + 1e-6)) + 1) * (self.fps / fps)
            pieces.append(interpolated(motion, times))
        offsets = np.concatenate([[0], np.cumsum([len(piece) for piece in pieces])]).astype(np.int64)
        return np.concatenate(pieces), offsets

    def _missing_at_rate(self, missing: BoolArray, fps: float, offsets: IntArray) -> BoolArray:
        """Return which frames at another frame rate are interpolated from a missing one, on either side of them.

        Args:
            missing: (total_frames,) which frames are missing.
            fps: the other rate.
            offsets: the offsets at that rate.
        """
        pieces = []
        for index, length in enumerate(np.diff(offsets)):
            held = missing[self.offsets[index] : self.offsets[index + 1]]
            before, share = neighbours(np.arange(length) * (self.fps / fps), len(held))
            pieces.append(held[before] | (held[np.minimum(before + 1, len(held) - 1)] & (share > 0)))
        return np.concatenate(pieces)


def interpolated(motion: FloatArray, times: FloatArray) -> FloatArray:
    """Return motion (T, P, J, 3) at `times` (S,), in frames after its first, linearly interpolated: (S, P, J, 3).

    A time after the last frame gives the last frame.
    """
    before, share = neighbours(times, len(motion))
    after, share = np.minimum(before + 1, len(motion) - 1), share[:, None, None, None]
    between: FloatArray = motion[before] * (1 - share) + motion[after] * share
    return between


def neighbours(times: FloatArray, frames: int) -> tuple[IntArray, FloatArray]:
    """Return the frame before each time (S,), and the share that the frame after it has, float32.

    The share is from 0 to 1, and above where there is no frame after it.

    Args:
        times: (S,) times, in frames after the first.
        frames: the number of frames; a time after the last one is beside no other.
    """
    before = np.minimum(times.astype(np.int64), frames - 1)
    return before, (times - before).astype(np.float32)
