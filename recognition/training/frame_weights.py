"""How much frames count when a recogniser learns: those without activity less than they are many, late ones more."""

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

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


def late_cross_entropy(
    logits: Tensor, labels: Tensor, *, weight: Tensor | None = None, smoothing: float = 0.0
) -> Tensor:
    """Return the mean over clips of the cross-entropy of their frames, each weighed by how many have been seen.

    The first frames of a clip say little. Who has to name the class there all the same may learn clips by heart.

    Args:
        logits: (B * L, K), of L frames of each of B clips.
        labels: (B, L), the class in each frame.
        weight: (K,), what each class counts; None means the same for all.
        smoothing: the share of a label that is spread over all classes.
    """
    seen = torch.arange(1, labels.shape[1] + 1, device=logits.device)
    each = functional.cross_entropy(
        logits, labels.flatten(), weight=weight, reduction="none", label_smoothing=smoothing
    ).view(labels.shape)
    return (each * seen).sum(dim=1).mean() / seen.sum()
