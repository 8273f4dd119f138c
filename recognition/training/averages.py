"""Averages of a network's weights over a training: over its late steps, or over some of its moments alike."""

from collections.abc import Sequence

from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel

LATE = 8.0  # how much late steps count: about the last ninth of them


def late_average(network: nn.Module) -> AveragedModel:
    """Return an average in which late steps count more, and the first ones are forgotten.

    It is the polynomial-decay averaging of Shamir and Zhang (ICML 2013, Sec. 4).
    """
    return AveragedModel(network, multi_avg_fn=_towards_late, use_buffers=True)


def equal_average(network: nn.Module) -> AveragedModel:
    """Return an average in which all moments count alike."""
    return AveragedModel(network, multi_avg_fn=_towards_mean, use_buffers=True)


def _towards_late(average: Sequence[Tensor], present: Sequence[Tensor], averaged: Tensor | int) -> None:
    _move(average, present, float((LATE + 1) / (averaged + LATE + 1)))


def _towards_mean(average: Sequence[Tensor], present: Sequence[Tensor], averaged: Tensor | int) -> None:
    _move(average, present, float(1 / (averaged + 1)))


def _move(average: Sequence[Tensor], present: Sequence[Tensor], share: float) -> None:
    """Move an average by a share of the way to the present weights.

    torch's own mean would divide counters of batches, which are integers, and on a GPU that is an error.
    """
    for mean, tensor in zip(average, present, strict=True):
        if mean.is_floating_point():
            mean.lerp_(tensor, share)
        else:
            mean.copy_(tensor)
