"""Makes streams out of trimmed sequences: one activity after another of the same people."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.data.motion_data import MotionData
from ehar.data.scenario import split_parts
from ehar.data.source import load_data
from ehar.data.stitching.joins import join, placed
from ehar.data.streams.data import StreamData
from ehar.errors import DataError, UsageError

LEAST = 0.5  # share of the seconds that the last stream of somebody must have, or else it belongs to the one before


@dataclass
class _Stream:
    """A stream that is being made."""

    name: str
    is_test: bool
    people: tuple[int, ...]
    pieces: list[FloatArray] = field(default_factory=list)
    missing: list[BoolArray] = field(default_factory=list)  # of each piece
    segments: list[tuple[int, int, int]] = field(default_factory=list)  # counted within the stream

    @property
    def frames(self) -> int:
        return sum(len(piece) for piece in self.pieces)

    def add(self, sequence: int, data: MotionData) -> None:
        """Add a sequence, behind a join if it is not the first."""
        motion, part = data.sequence(sequence), slice(data.offsets[sequence], data.offsets[sequence + 1])
        if self.pieces:
            motion = placed(motion, self.pieces[-1][-1], data.skeleton)
            self.pieces.append(join(self.pieces[-1], motion, data.skeleton, data.fps))
            self.missing.append(np.zeros(len(self.pieces[-1]), dtype=bool))
        begin = self.frames
        self.pieces.append(motion)
        self.missing.append(np.zeros(len(motion), dtype=bool) if data.missing is None else data.missing[part])
        self.segments.append((begin, begin + len(motion), int(data.labels[sequence])))


def stitch(data: str | Path | MotionData, *, seconds: float = 60.0, seed: int = 0) -> StreamData:
    """Make streams out of the sequences of each person, or of each couple.

    Sequences follow each other as they were recorded, if the data say when that was, and else as the seed shuffles
    them. Each begins where and as turned as the one before ended. Between them lie joins of 0.5 to 1.5 s, which show no
    activity. Test sequences are never in a stream with others. What is missing stays missing.

    Args:
        data: the sequences, in memory or as `load_data` takes them; all have to name who performs.
        seconds: a stream ends with the first sequence that makes it as long, joins not counted; the last one of each
            person may be half as long, and the only one shorter still.
        seed: of the order.

    Raises:
        UsageError: `seconds` is not above 0, `seed` is below 0, or the data are unknown.
        DataError: the data are malformed, do not name everybody who performs, or a sequence has only one frame.
    """
    if not seconds > 0:
        raise UsageError(f"--seconds: got {seconds:g}, expected more than 0")
    if seed < 0:
        raise UsageError(f"--seed: got {seed}, expected at least 0")
    data = data if isinstance(data, MotionData) else load_data(data)
    if data.unnamed:
        raise DataError(
            f"{data.name}: subjects: expected all people by number, to put each one's activities in a row, got none in "
            f"{data.unnamed} of {len(data.subjects)} sequences"
        )
    if data.lengths.min() < 2:
        name = data.sequence_names[int(data.lengths.argmin())]
        raise DataError(f"{data.name}: expected sequences of at least 2 frames, {name!r} has 1")
    is_test = np.isin(np.arange(len(data.lengths)), split_parts(data).test)
    streams: list[_Stream] = []
    for number, (test, *people) in enumerate(np.unique(np.column_stack([is_test, data.subjects]), axis=0).tolist()):
        own = np.flatnonzero((is_test == test) & (data.subjects == people).all(axis=1))
        rng = np.random.default_rng((seed, number))
        streams += _of_people(data, _ordered(data, own, rng), seconds, bool(test), tuple(people))
    return _gathered(data, streams)


def _ordered(data: MotionData, sequences: IntArray, rng: np.random.Generator) -> IntArray:
    """Return sequences in the order in which they are to follow each other."""
    if data.recorded_ms is None:
        return rng.permutation(sequences)
    ordered: IntArray = sequences[np.argsort(data.recorded_ms[sequences], kind="stable")]
    return ordered


def _of_people(
    data: MotionData, sequences: IntArray, seconds: float, is_test: bool, people: tuple[int, ...]
) -> list[_Stream]:
    """Return the streams of the sequences of some people, in order."""
    rows: list[list[int]] = [[]]
    for sequence in sequences.tolist():
        if _seconds(data, rows[-1]) >= seconds:
            rows.append([])
        rows[-1].append(sequence)
    if len(rows) > 1 and _seconds(data, rows[-1]) < LEAST * seconds:
        last = rows.pop()
        rows[-1] += last
    who = "-".join(map(str, people))
    streams = []
    for number, row in enumerate(rows):
        stream = _Stream(f"{'test' if is_test else 'train'}_{who}_{number}", is_test, people)
        for sequence in row:
            stream.add(sequence, data)
        streams.append(stream)
    return streams


def _seconds(data: MotionData, row: list[int]) -> float:
    return float(data.lengths[row].sum() / data.fps) if row else 0.0


def _gathered(data: MotionData, streams: list[_Stream]) -> StreamData:
    """Return streams as one set of data."""
    offsets = np.concatenate([[0], np.cumsum([stream.frames for stream in streams])]).astype(np.int64)
    segments = [
        np.array(stream.segments, dtype=np.int64) + np.array([begin, begin, 0])
        for stream, begin in zip(streams, offsets, strict=False)
    ]
    return StreamData(
        name=f"{data.name}-stream",
        positions=np.concatenate([piece for stream in streams for piece in stream.pieces]).astype(np.float32),
        offsets=offsets,
        class_names=data.class_names,
        sequence_names=tuple(stream.name for stream in streams),
        fps=data.fps,
        skeleton=data.skeleton,
        is_test=np.array([stream.is_test for stream in streams]),
        subjects=np.array([stream.people for stream in streams]),
        license=data.license,
        synthetic=data.synthetic,
        segments=np.concatenate(segments),
        missing=np.concatenate([piece for stream in streams for piece in stream.missing]),
    )
