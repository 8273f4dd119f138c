"""The two layers of CTR-GCN in causal form, each over whole clips and, equally, one frame at a time.

A graph convolution whose topology follows the running mean, and a left-padded multi-scale temporal convolution.
Tensors are (N, C, T, J) over clips and (N, C, F, J) over one frame, N = B * P bodies, F forks. What a state
holds is (N, C, F', ...) with F' = 1 as long as the forks share it.
"""

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

KERNEL = 5  # Chen et al. 2021, Sec. 3.4: temporal kernels of 5 frames ...
DILATIONS = (1, 2)  # ... at two dilations,
POOL = 3  # ... and a max-pool over 3 frames
PIECE = 16  # topologies that are computed at once
HISTORY = (KERNEL - 1) * max(DILATIONS)  # frames that the temporal convolution looks back


class GraphState(NamedTuple):
    """What the graph convolution remembers."""

    total: Tensor  # (N, C_in, F', J), the sum of the input over the frames seen
    topology: Tensor  # (N, C_out, F', 3 J, J), held since the last refresh


def refreshes(count: int) -> bool:
    """Return whether the topology is refreshed at the `count`-th frame (from 1): at 1, 4, 16, 64, ...

    A mean over t frames moves by 1/t a frame, so growing intervals keep a held topology as fresh, relatively,
    late in an episode as early, and an episode of 60 frames costs 3 topologies instead of 60.
    """
    return count & (count - 1) == 0 and count.bit_length() % 2 == 1


class Pointwise(nn.Conv2d):
    """A 1 x 1 convolution as a matrix product: about twice as fast as a convolution's kernel, in training too.

    Args:
        inputs: C_in.
        outputs: C_out.
    """

    def __init__(self, inputs: int, outputs: int) -> None:
        """Create the convolution, initialised as any other."""
        super().__init__(inputs, outputs, 1)

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, C_out, T, J) of x (N, C_in, T, J)."""
        assert self.bias is not None
        return _product(self.weight.flatten(1), self.bias, x)


def _product(weight: Tensor, bias: Tensor, x: Tensor) -> Tensor:
    """Return a weight (C_out, C_in) and a bias (C_out,) applied to the channels of x (N, C_in, T, J)."""
    product = torch.baddbmm(bias[:, None], weight.expand(len(x), -1, -1), x.flatten(2))
    return product.view(len(x), len(weight), *x.shape[2:])


class CausalGraphConvolution(nn.Module):
    """Channel-wise topology refinement graph convolution (Chen et al. 2021, Eq. 3-6), causal.

    The published layer averages its two embeddings over the whole clip. Here the mean runs over the frames seen
    so far; the embeddings are linear, so one running mean of the input serves all three subsets.

    Args:
        inputs: C_in.
        outputs: C_out.
        partition: (3, J, J) initial topologies, normalised; entry [s, i, j] carries joint j to joint i.
    """

    def __init__(self, *, inputs: int, outputs: int, partition: Tensor) -> None:
        """Create the layer with the published initialisation: the refinement starts at zero strength."""
        super().__init__()
        self.outputs = outputs
        self.joints = partition.shape[-1]
        self.relations = max(8, inputs // 8)
        self.value = Pointwise(inputs, 3 * outputs)
        self.relate_target = nn.Conv1d(inputs, 3 * self.relations, 1)
        self.relate_source = nn.Conv1d(inputs, 3 * self.relations, 1)
        self.refine = nn.Conv1d(3 * self.relations, 3 * outputs, 1, groups=3)
        self.strength = nn.Parameter(torch.zeros(1))
        self.topology = nn.Parameter(partition.clone())
        self.norm = nn.BatchNorm2d(outputs)
        self.residual = (
            nn.Identity() if inputs == outputs else nn.Sequential(Pointwise(inputs, outputs), nn.BatchNorm2d(outputs))
        )
        nn.init.constant_(self.norm.weight, 1e-6)  # as published: a block starts as its residual

    def refined(self, mean: Tensor) -> Tensor:
        """Return the topologies (n, 3, C_out, J, J), source to target, that a mean input (n, C_in, J) calls for."""
        n, j = len(mean), self.joints
        target = self.relate_target(mean).view(n, 3 * self.relations, 1, j)
        source = self.relate_source(mean).view(n, 3 * self.relations, j, 1)
        relation = torch.tanh(target - source).view(n, 3 * self.relations, j * j)
        # Scaling the small weight instead of the large refinement saves a pass over it; so does adding in place.
        weight, bias = self.refine.weight * self.strength, self.refine.bias
        refinement = functional.conv1d(relation, weight, groups=3).view(n, 3, self.outputs, j, j)
        assert bias is not None
        shared = self.topology.transpose(-1, -2)[:, None] + (bias * self.strength).view(3, self.outputs, 1, 1)
        return refinement.add_(shared)

    def finish(self, product: Tensor, x: Tensor) -> Tensor:
        """Return normalisation, residual and activation of the graph product."""
        return functional.relu(self.norm(product) + self.residual(x))

    def forward(self, x: Tensor) -> Tensor:
        """Return the layer's output (N, C_out, T, J) for whole clips (N, C_in, T, J)."""
        frames = x.shape[2]
        begins = [count - 1 for count in range(1, frames + 1) if refreshes(count)]
        counts = torch.arange(1, frames + 1, device=x.device, dtype=x.dtype)[:, None]
        means = (x.cumsum(dim=2) / counts)[:, :, begins]
        n, inputs, segments, j = means.shape
        topologies = self.refined(means.transpose(1, 2).reshape(n * segments, inputs, j))
        values = self.value(x).view(n, 3, self.outputs, frames, j)
        lengths = [end - begin for begin, end in zip(begins, [*begins[1:], frames], strict=True)]
        pieces = [
            (value @ topology).sum(dim=1)
            for value, topology in zip(
                values.split(lengths, dim=3), topologies.view(n, segments, *topologies.shape[1:]).unbind(1), strict=True
            )
        ]
        return self.finish(torch.cat(pieces, dim=2), x)

    def start(self, bodies: int) -> GraphState:
        """Return the state of N bodies that have seen nothing."""
        empty = self.topology.new_zeros
        return GraphState(
            empty(bodies, self.value.in_channels, 1, self.joints),
            empty(bodies, self.outputs, 1, 3 * self.joints, self.joints),
        )

    def step(self, x: Tensor, state: GraphState, count: Tensor, due: Tensor) -> tuple[Tensor, GraphState]:
        """Take one frame.

        Args:
            x: (N, C_in, F, J).
            state: before the frame.
            count: (N,) frames seen, this one included.
            due: (N,) bool, whose topology is refreshed.
        """
        total = state.total + x
        topology = state.topology
        if bool(due.all()):
            topology = self._fresh(total, count)
        elif bool(due.any()):
            topology = topology.expand(-1, -1, total.shape[2], -1, -1).clone()
            topology[due] = self._fresh(total[due], count[due])
        n, _, forks, j = x.shape
        values = self.value(x).view(n, 3, self.outputs, forks, j).permute(0, 2, 3, 1, 4).reshape(n, -1, forks, 3 * j)
        if topology.shape[2] == 1:
            product = values @ topology[:, :, 0]
        else:
            product = (values[:, :, :, None] @ topology)[:, :, :, 0]
        return self.finish(product, x), GraphState(total, topology)

    def _fresh(self, total: Tensor, count: Tensor) -> Tensor:
        """Return topologies (n, C_out, F, 3 J, J) from sums (n, C_in, F, J) over `count` (n,) frames."""
        n, inputs, forks, j = total.shape
        fresh = total.new_empty(n, self.outputs, forks, 3 * j, j)
        # Piece by piece: what the copy below reads is then still in the cache. Half the time, and no second gigabyte.
        size = max(1, PIECE // forks)
        for sums, counts, piece in zip(*(torch.split(t, size) for t in (total, count, fresh)), strict=True):
            mean = (sums / counts[:, None, None, None]).transpose(1, 2).reshape(-1, inputs, j)
            refined = self.refined(mean).view(-1, forks, 3, self.outputs, j, j)
            # The three subsets end up side by side as sources: one product a frame instead of three.
            piece.view(-1, self.outputs, forks, 3, j, j).copy_(refined.permute(0, 3, 1, 2, 4, 5))
        return fresh


class CausalTemporalConvolution(nn.Module):
    """Multi-scale temporal convolution (Chen et al. 2021, Fig. 3c) that looks only back; no strides.

    Four branches of C / 4 channels: two dilated convolutions, a max-pool, and the frame itself.

    Args:
        channels: C, a multiple of 4.
    """

    def __init__(self, *, channels: int) -> None:
        """Create the layer."""
        super().__init__()
        self.branch = channels // 4
        self.reduce = Pointwise(channels, channels)
        self.reduce_norm = nn.BatchNorm2d(channels)
        self.convolutions = nn.ModuleList(
            nn.Conv2d(self.branch, self.branch, (KERNEL, 1), dilation=(dilation, 1)) for dilation in DILATIONS
        )
        self.norm = nn.BatchNorm2d(3 * self.branch)

    def _reduced(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Return the three activated branches that look back, and the one that does not."""
        reduced = self.reduce_norm(self.reduce(x))
        return functional.relu(reduced[:, : 3 * self.branch]), reduced[:, 3 * self.branch :]

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, C, T, J) for whole clips (N, C, T, J)."""
        back, present = self._reduced(x)
        # What precedes a clip is zero, and an activated branch is never below it: the pool may see the padding too.
        padded = functional.pad(back, (0, 0, HISTORY, 0))
        outputs = []
        for i, (convolution, dilation) in enumerate(zip(self.convolutions, DILATIONS, strict=True)):
            skip = HISTORY - (KERNEL - 1) * dilation
            outputs.append(convolution(padded[:, i * self.branch : (i + 1) * self.branch, skip:]))
        outputs.append(functional.max_pool2d(padded[:, 2 * self.branch :, HISTORY - POOL + 1 :], (POOL, 1), stride=1))
        return torch.cat([self.norm(torch.cat(outputs, dim=1)), present], dim=1)

    def start(self, bodies: int, joints: int) -> tuple[Tensor, ...]:
        """Return the last HISTORY frames of bodies that have seen nothing, each (N, 3 C / 4, 1, J)."""
        return (self.reduce.weight.new_zeros(bodies, 3 * self.branch, 1, joints),) * HISTORY

    def step(self, x: Tensor, history: tuple[Tensor, ...]) -> tuple[Tensor, tuple[Tensor, ...]]:
        """Take one frame (N, C, F, J); return the output and the history after it."""
        back, present = self._reduced(x)
        outputs = []
        for i, (convolution, dilation) in enumerate(zip(self.convolutions, DILATIONS, strict=True)):
            channels = slice(i * self.branch, (i + 1) * self.branch)
            past = [frame[:, channels] for frame in history[HISTORY - (KERNEL - 1) * dilation :: dilation]]
            outputs.append(_tap(convolution, past, back[:, channels]))
        pooled = back[:, 2 * self.branch :]
        for frame in history[HISTORY - POOL + 1 :]:
            pooled = torch.maximum(pooled, frame[:, 2 * self.branch :])
        outputs.append(pooled)
        return torch.cat([self.norm(torch.cat(outputs, dim=1)), present], dim=1), (*history[1:], back)


def _tap(convolution: nn.Module, past: list[Tensor], present: Tensor) -> Tensor:
    """Return one output frame of a temporal convolution; what forks share of the past is convolved once."""
    weight, bias = convolution.weight, convolution.bias
    assert isinstance(weight, Tensor) and isinstance(bias, Tensor)
    forks = max(frame.shape[2] for frame in past)
    joined = torch.cat([frame.expand(-1, -1, forks, -1) for frame in past], dim=1)
    taps = weight[:, :, :, 0]
    before = _product(taps[:, :, :-1].transpose(1, 2).flatten(1), bias, joined)
    return before + _product(taps[:, :, -1].contiguous(), torch.zeros_like(bias), present)
