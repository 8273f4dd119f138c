"""Evidence that fades: running sums in which older frames count less, at rates that are learned."""

import math

import torch
from torch import Tensor, nn
from torch.nn import functional


class Fading(nn.Module):
    """Running sums over time, of which each frame keeps a share: `sum_t = keep * sum_(t-1) + x_t`.

    A frame counts for about as many frames as its memory. The memories are learned, as logarithms, so they stay above
    zero.

    Args:
        memories: the first values [frames], one for each channel.
    """

    def __init__(self, memories: Tensor) -> None:
        """Create the sums."""
        super().__init__()
        self.log_memory = nn.Parameter(memories.log())

    @property
    def keep(self) -> Tensor:
        """The share of each channel's sum that is left a frame later, (C,), above 0 and below 1."""
        return torch.exp(-torch.exp(-self.log_memory))

    def sums(self, x: Tensor) -> Tensor:
        """Return the sums (B, T, C) after every frame of x (B, T, C).

        Each pass doubles the frames that a sum reaches back: eight passes for 256 frames, not a step for each.
        """
        back, keep = 1, self.keep
        while back < x.shape[1]:
            x = x + functional.pad(x[:, :-back], (0, 0, back, 0)) * keep
            back, keep = 2 * back, keep * keep
        return x

    def weight(self, count: Tensor) -> Tensor:
        """Return what a sum of ones is after `count` frames, as the counts are shaped; for a single channel."""
        return (1 - self.keep**count) / (1 - self.keep)


def spread_memories(channels: int, shortest: float, longest: float) -> Tensor:
    """Return memories (C,) [frames], evenly spaced on a logarithmic scale."""
    return torch.exp(torch.linspace(math.log(shortest), math.log(longest), channels))
