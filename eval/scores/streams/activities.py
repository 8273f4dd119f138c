"""Activities within streams, scored like clips: observation ratios are counted from each activity's onset."""

from dataclasses import replace

import numpy as np

from ehar.arrays import IntArray
from ehar.data.streams.data import NO_ACTIVITY
from eval.records.episodes import SECOND, EpisodeRecords
from eval.scores.metrics import frame_at

PROBABILITIES = ("true_probability", "top_probability", SECOND)
RATIOS = tuple(range(5, 101, 5))  # [%] at which an activity is scored; the accuracies that tables show are among them


def activities(records: EpisodeRecords) -> EpisodeRecords:
    """Return records with one episode for each activity of the streams, and 20 frames, one for each of `RATIOS`.

    An activity counts if its onset and its end are in the stream's episode. The start stays that of the episode, so
    the activities of two planners are the same.

    Args:
        records: records of streams.
    """
    episode, begin, end = activity_frames(records.label)
    at = np.stack(
        [
            [frame_at(percent, last - first) + first for percent in RATIOS]
            for first, last in zip(begin, end, strict=True)
        ]
    )
    frames = {name: getattr(records, name) for name in ("viewpoint", "predicted", *PROBABILITIES)}
    return replace(
        records,
        sequence=tuple(records.sequence[index] for index in episode),
        first=records.first[episode] + begin,
        start=records.start[episode],
        label=records.label[episode, begin],
        subjects=records.subjects[episode],
        **{name: held[episode[:, None], at] for name, held in frames.items() if held is not None},
        flight=None,
        contacts=None,
        tracking_error=None,
    )


def activity_frames(labels: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return the episode, the first frame and the end of each activity that lies within an episode, (M,) each.

    Frames of one class in a row are one activity. One that an episode begins or ends with may be cut, so it is left
    out.

    Args:
        labels: (N, L), -1 for no activity.
    """
    episodes, length = labels.shape
    edge = np.ones((episodes, 1), dtype=bool)
    changes = np.concatenate([edge, labels[:, 1:] != labels[:, :-1], edge], axis=1)
    episode, begin = np.nonzero(changes[:, :-1])
    _, end = np.nonzero(changes[:, 1:])
    whole = (begin > 0) & (end + 1 < length) & (labels[episode, begin] != NO_ACTIVITY)
    return episode[whole], begin[whole], end[whole] + 1
