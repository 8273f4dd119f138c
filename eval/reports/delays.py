"""How long the activities of each class in a stream take to be recognised. Axis: M activities."""

from typing import NamedTuple

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from eval.records.episodes import EpisodeRecords
from eval.scores.streams.activities import activity_frames
from eval.scores.streams.alarms import delays


class ClassDelays(NamedTuple):
    """The delays of all activities, and of which class each of them is.

    Args:
        label: (M,), the class of each activity.
        frames: (M,), from its onset until the answer is right and stays right; all of its frames where it never does.
        recognised: (M,), whether there is such a moment.
        classes: K.
    """

    label: IntArray
    frames: FloatArray
    recognised: BoolArray
    classes: int

    @property
    def means(self) -> FloatArray:
        """The mean delay of each class [frames], (K,); NaN without an activity."""
        return self._mean(self.frames)

    @property
    def shares(self) -> FloatArray:
        """The share of each class's activities that are recognised, (K,); NaN without an activity."""
        return self._mean(self.recognised.astype(np.float64))

    def _mean(self, values: FloatArray) -> FloatArray:
        count = np.bincount(self.label, minlength=self.classes)
        total = np.bincount(self.label, weights=values, minlength=self.classes)
        mean: FloatArray = total / np.where(count > 0, count, np.nan)
        return mean


def class_delays(records: EpisodeRecords, classes: int) -> ClassDelays:
    """Return the delays of the activities that lie within an episode.

    Args:
        records: records of streams.
        classes: K.
    """
    episode, begin, _ = activity_frames(records.label)
    frames, recognised = delays(records.label, records.predicted)
    return ClassDelays(records.label[episode, begin], frames, recognised, classes)
