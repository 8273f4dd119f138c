"""The streaming form of CTR-GCN: it takes whole clips in one pass, or one frame at a time with the same result."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor, nn

from ehar.arrays import IntArray
from recognition.networks.fading import Fading, spread_memories
from recognition.networks.layers import (
    CausalGraphConvolution,
    CausalTemporalConvolution,
    GraphState,
)
from recognition.networks.pointwise import normed

WEIGHING = 16  # hidden units of what weighs frames
LEAST_WEIGHT = 1e-6  # of a frame: the sum of weights, by which is divided, is never zero
FADING_POOL = (4.0, 120.0)  # frames, the first memories of pooled features where evidence fades


@dataclass(frozen=True)
class BlockState:
    """What one block remembers."""

    graph: GraphState
    history: tuple[Tensor, ...]


@dataclass(frozen=True)
class StreamingState:
    """Everything that the network remembers of B episodes. Tensors are never changed in place.

    Args:
        forks: number F of alternatives of each episode. A tensor that they still share has a fork axis of size 1.
        count: (B,) number of frames seen; an array, as it decides here what a device does.
        blocks: the state of each block, over B * P bodies.
        pooled: (B, D + 1, F') the weighted sum of pooled features over the frames seen, and last the sum of weights;
            where evidence fades, (B, 2 D, F'): each feature forgets at its own rate, and so do its weights.
    """

    forks: int
    count: IntArray
    blocks: tuple[BlockState, ...]
    pooled: Tensor

    def fork(self, forks: int) -> "StreamingState":
        """Return a state with F alternatives of each episode; nothing is copied.

        Raises:
            ValueError: the state is forked already.
        """
        if self.forks != 1:
            raise ValueError(f"expected an unforked state, got one of {self.forks} forks")
        return replace(self, forks=forks)

    def select(self, choice: Tensor) -> "StreamingState":
        """Return the unforked state of alternative `choice` (B,), on the CPU, of each episode."""
        bodies = len(self.blocks[0].graph.total) // len(choice)
        body_choice = choice.repeat_interleave(bodies)

        def pick(tensor: Tensor) -> Tensor:
            if tensor.shape[2] == 1:
                return tensor
            index = choice if len(tensor) == len(choice) and tensor is self.pooled else body_choice
            rows = torch.arange(len(tensor), device=tensor.device)
            return tensor[rows, :, index.to(tensor.device)].unsqueeze(2)

        return self._map(pick, forks=1)

    def reset(self, mask: Tensor) -> "StreamingState":
        """Return a state in which the episodes of `mask` (B,) bool, on the CPU, have seen nothing."""
        bodies = len(self.blocks[0].graph.total) // len(mask)
        body_mask = mask.repeat_interleave(bodies)

        def clear(tensor: Tensor) -> Tensor:
            rows = (mask if tensor is self.pooled else body_mask).to(tensor.device)
            return tensor.masked_fill(rows.view(-1, *[1] * (tensor.dim() - 1)), 0.0)

        return replace(self._map(clear, forks=self.forks), count=np.where(mask.numpy(), 0, self.count))

    def _map(self, change: Callable[[Tensor], Tensor], forks: int) -> "StreamingState":
        blocks = tuple(
            BlockState(
                GraphState(change(block.graph.total), change(block.graph.topology)),
                tuple(change(frame) for frame in block.history),
            )
            for block in self.blocks
        )
        return StreamingState(forks, self.count, blocks, change(self.pooled))


class CausalBlock(nn.Module):
    """A graph convolution, a temporal one, and a residual around both."""

    def __init__(self, *, inputs: int, outputs: int, partition: Tensor, residual: bool, fading: bool) -> None:
        """Create the block; the first one of the published network has no residual."""
        super().__init__()
        self.graph = CausalGraphConvolution(inputs=inputs, outputs=outputs, partition=partition, fading=fading)
        self.temporal = CausalTemporalConvolution(channels=outputs)
        self.residual: nn.Module | None = None
        if residual:
            self.residual = nn.Identity() if inputs == outputs else normed(inputs, outputs)

    def _join(self, temporal: Tensor, x: Tensor) -> Tensor:
        return torch.relu(temporal if self.residual is None else temporal + self.residual(x))

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, C_out, J, T) for whole clips (N, C_in, J, T)."""
        return self._join(self.temporal(self.graph(x)), x)


class CausalCTRGCN(nn.Module):
    """CTR-GCN with a running counterpart for every operation over time.

    The logits after frame t depend only on the frames up to t. So one pass over a clip gives the logits of every
    prefix, and training sees all observation ratios at once. The published network pools all frames alike. Here each
    frame has a weight, which it learns from the frame's own features: where a camera sees little, its frames count
    less, and a good view found late is not outvoted by the bad ones before it.

    In a stream one activity follows another. There evidence fades: the sums over frames forget at learned rates, some
    features soon and some late, so the network lets go of an activity that is over.

    Args:
        classes: number K of classes.
        channels: number C of features of a joint.
        partition: (3, J, J) the spatial partition of the skeleton.
        widths: output channels of each block, multiples of 4.
        dropout: rate of dropout on the pooled features.
        fading: whether evidence fades.
    """

    def __init__(
        self,
        *,
        classes: int,
        channels: int,
        partition: Tensor,
        widths: tuple[int, ...],
        dropout: float = 0.0,
        fading: bool = False,
    ) -> None:
        """Create the network."""
        super().__init__()
        joints = partition.shape[-1]
        self.embedding_size = widths[-1]
        self.input_norm = nn.BatchNorm1d(joints * channels)
        inputs = (channels, *widths[:-1])
        self.blocks = nn.ModuleList(
            CausalBlock(inputs=before, outputs=after, partition=partition, residual=i > 0, fading=fading)
            for i, (before, after) in enumerate(zip(inputs, widths, strict=True))
        )
        self.weigh = nn.Sequential(nn.Linear(widths[-1] + channels, WEIGHING), nn.ReLU(), nn.Linear(WEIGHING, 1))
        # A feature and its weights fade alike.
        self.fading = Fading(spread_memories(widths[-1], *FADING_POOL)) if fading else None
        self.dropout = nn.Dropout(dropout)
        self.classify = nn.Linear(widths[-1], classes)

    def _sums(self, frames: Tensor) -> Tensor:
        """Return the sums over time of what `weighted` returns."""
        if self.fading is None:
            return frames.cumsum(dim=1, dtype=torch.float32)
        return torch.cat([self.fading.sums(half) for half in frames.float().chunk(2, dim=2)], dim=2)

    def forward(self, x: Tensor) -> Tensor:
        """Return the logits (B, T, K) after every frame, from features (B, T, P, J, C)."""
        bodies = as_bodies(self.input_norm, x).transpose(2, 3).contiguous()
        for block in self.blocks:
            bodies = block(bodies)
        sums = self._sums(weighted(self.weigh, x, bodies.mean(dim=2), fading=self.fading is not None))
        logits: Tensor = self.classify(self.dropout(mean_of(sums, self.embedding_size)))
        return logits

    def typed_blocks(self) -> list[CausalBlock]:
        """Return the blocks."""
        return [block for block in self.blocks if isinstance(block, CausalBlock)]


def as_bodies(norm: nn.Module, x: Tensor) -> Tensor:
    """Turn features (B, T, P, J, C) into bodies (B * P, C, T, J), normalised by `norm`; T may be the fork axis."""
    batch, frames, persons, joints, channels = x.shape
    flat = x.transpose(1, 2).reshape(batch * persons, frames, joints * channels)
    normed: Tensor = norm(flat.transpose(1, 2))
    return normed.view(batch * persons, joints, channels, frames).permute(0, 2, 3, 1)


def weighted(weigh: nn.Module, x: Tensor, bodies: Tensor, *, fading: bool) -> Tensor:
    """Return the features of frames times their weights, and the weights last: (B, T, D + 1), fading (B, T, 2 D).

    A weight is between 0 and 1, but never 0. It depends on the pooled features, and on the mean of the frame's
    input: how sure the sensor is of its joints, and where the camera stands.

    Args:
        weigh: gives the logit of a frame's weight.
        x: (B, T, P, J, C), the input; T may be the fork axis.
        bodies: (B * P, D, T), the last block's features, pooled over joints.
        fading: whether each feature has weights of its own, as it forgets at its own rate.
    """
    batch, frames, persons = x.shape[:3]
    pooled = bodies.view(batch, persons, -1, frames).mean(dim=1).transpose(1, 2)
    weight = torch.sigmoid(weigh(torch.cat([pooled, x.mean(dim=(2, 3))], dim=2))) + LEAST_WEIGHT
    return torch.cat([weight * pooled, weight.expand_as(pooled) if fading else weight], dim=2)


def mean_of(sums: Tensor, size: int) -> Tensor:
    """Return the weighted means (..., D) of sums of features, with the sums of their weights behind them."""
    return sums[..., :size] / sums[..., size:]
