"""Continuous recordings in memory, in which activities follow each other: the content of a stream file."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ehar.arrays import BoolArray, IntArray
from ehar.data.recordings import Recordings
from ehar.errors import UsageError

NO_ACTIVITY = -1  # the label of frames that show none
NO_ACTIVITY_NAME = "no activity"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class StreamData(Recordings):
    """Streams: sequences of a minute or more that show one activity after another.

    Args:
        segments: (N, 3) int64, in order: the first frame, the end frame (not included) and the class of each activity,
            counted over all of `positions`. No two share a frame, and none reaches into another stream.
        missing: (total_frames,) bool, true where the tracker gave nothing. Positions there are interpolated between
            the frames around the gap, so nobody is shown them.
        notes: what a reader had to change, for people who measure on it.
    """

    segments: IntArray
    missing: BoolArray
    notes: tuple[str, ...] = ()

    @property
    def _activities(self) -> tuple[IntArray, ...]:
        return (self.segments, self.missing.astype(np.int64))

    @property
    def recognised_names(self) -> tuple[str, ...]:
        """Names of all that a recogniser tells apart: the classes, and last no activity."""
        return (*self.class_names, NO_ACTIVITY_NAME)

    @property
    def stream_of(self) -> IntArray:
        """The stream of each segment, (N,)."""
        stream: IntArray = np.searchsorted(self.offsets, self.segments[:, 0], side="right") - 1
        return stream

    @cached_property
    def labels(self) -> IntArray:
        """The class of each frame, (total_frames,); `NO_ACTIVITY` where there is none."""
        labels = np.full(len(self.positions), NO_ACTIVITY)
        lengths = self.segments[:, 1] - self.segments[:, 0]
        begins = np.repeat(self.segments[:, 0] - np.cumsum(lengths) + lengths, lengths)
        labels[begins + np.arange(lengths.sum())] = np.repeat(self.segments[:, 2], lengths)
        return labels

    def resampled(self, fps: float) -> "StreamData":
        """Return the streams at another frame rate: linear interpolation in time, each stream by itself.

        A segment begins at the first frame that is not before it. One that would have no frame left keeps one, and its
        neighbours may begin a frame earlier or later for it. A frame is missing if one that it is interpolated from
        is: it would tell where people are after the gap.

        Raises:
            UsageError: the rate is not above 0, above `MOST_RATE`, or so low that short segments would be elsewhere.
        """
        if fps == self.fps:
            return self
        positions, offsets = self._at_rate(fps)
        stream, scale = self.stream_of, fps / self.fps
        within = self.segments[:, :2] - self.offsets[stream][:, None]
        first, end = np.ceil(within * scale - 1e-6).astype(np.int64).T
        begin = np.empty_like(first)
        for index in np.unique(stream):
            mine = stream == index
            begin[mine] = _apart(first[mine], int(offsets[index + 1] - offsets[index]))
        off = (np.abs(begin - first) > 1) | (begin < 0)
        if off.any():
            where = int(off.argmax())
            name, shown = self.sequence_names[stream[where]], self.segments[where]
            raise UsageError(
                f"{self.name}: expected room for a frame of each segment at {fps:g} frames/s; of {name!r}, "
                f"{self.class_names[shown[2]]!r} (frames {within[where, 0]} to {within[where, 1]}) and those beside "
                "it have none"
            )
        behind = np.append(begin[1:] + offsets[stream[1:]], offsets[-1])  # no segment reaches into the next, or beyond
        behind = np.minimum(behind, offsets[stream + 1]) - offsets[stream]
        end = np.clip(end, begin + 1, behind)
        segments = np.stack([begin + offsets[stream], end + offsets[stream], self.segments[:, 2]], axis=1)
        missing = self._missing_at_rate(self.missing, fps, offsets)
        return replace(self, positions=positions, offsets=offsets, fps=float(fps), segments=segments, missing=missing)


def _apart(first: IntArray, frames: int) -> IntArray:
    """Return first frames (N,), in order, such that each segment has a frame of its own, as near to these as possible.

    Args:
        first: (N,) the frames at which segments should begin, none before the one in front of it.
        frames: frames of the stream; segments that find no room are before its first frame.
    """
    numbers = np.arange(len(first))
    later = np.maximum.accumulate(first - numbers)  # each begins behind the one before it
    last = np.minimum(later, frames - len(first))  # and has a frame before the end, with all that come after it
    begin: IntArray = last + numbers
    return begin
