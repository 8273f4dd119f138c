"""A loss in which frames count in proportion to how many have been seen.

The first frames of a clip say little. Who has to name the class there all the same may learn clips by heart.
"""

import torch
from torch import Tensor
from torch.nn import functional


def late_cross_entropy(
    logits: Tensor, labels: Tensor, *, weight: Tensor | None = None, smoothing: float = 0.0
) -> Tensor:
    """Return the mean over clips of the cross-entropy of their frames, each weighed by how many have been seen.

    Args:
        logits: (B * L, K), of L frames of each of B clips.
        labels: (B, L), the class in each frame.
        weight: (K,), what each class counts; None means the same for all.
        smoothing: smoothing of labels.
    """
    seen = torch.arange(1, labels.shape[1] + 1, device=logits.device)
    each = functional.cross_entropy(
        logits, labels.flatten(), weight=weight, reduction="none", label_smoothing=smoothing
    ).view(labels.shape)
    return (each * seen).sum(dim=1).mean() / seen.sum()
