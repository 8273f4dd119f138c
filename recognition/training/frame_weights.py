"""Says how much frames count when a recogniser of streams learns: those without activity less than they are many."""

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.data.streams.data import NO_ACTIVITY, StreamData

NO_ACTIVITY_WEIGHT = 2.0  # of all frames without activity together, relative to those of the average class, at most


def frame_weights(data: StreamData, streams: IntArray) -> FloatArray | None:
    """Return how much a frame of each class, and last one without activity, counts in training, (K + 1,).

    In recordings of real life people do nothing in most frames. A recogniser for which all frames count alike learns to
    name nothing: it would be right in most frames, and in few activities, which are what is scored. So frames without
    activity together count at most `NO_ACTIVITY_WEIGHT` times as much as the average class's (in training it is the
    same as adjusting logits by a prior: Menon et al., ICLR 2021).

    Args:
        data: the streams.
        streams: those of the recogniser part.

    Returns:
        The weights; None if all frames count alike, as few are without activity.
    """
    classes = len(data.class_names)
    labels = np.concatenate([data.labels[data.offsets[one] : data.offsets[one + 1]] for one in streams])
    without = float((labels == NO_ACTIVITY).mean())
    most = NO_ACTIVITY_WEIGHT * (1 - without) / classes
    return None if without <= most else np.append(np.ones(classes), most / without)
