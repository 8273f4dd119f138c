"""The two layers of CTR-GCN in causal form; each takes whole clips, or one frame at a time with the same result.

One layer is a graph convolution whose topology follows the running mean. The other is a left-padded multi-scale
temporal convolution. Tensors are (N, C, J, T) over clips and (N, C, F, J) over one frame, with N = B * P bodies and F
forks; with the frames last, the graph's product over clips needs no copy. A tensor of a state is (N, C, F', ...), with
F' = 1 as long as the forks share it.
"""

from contextlib import AbstractContextManager, nullcontext
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from recognition.networks.fading import Fading
from recognition.networks.pointwise import Pointwise, before_norm, bias_of, normed, product_of

KERNEL = 5  # Chen et al. 2021, Sec. 3.4: temporal kernels of 5 frames ...
DILATIONS = (1, 2)  # ... at two dilations,
POOL = 3  # ... and a max-pool over 3 frames
PIECE = 16  # topologies that are computed at once
FADING_TOPOLOGY = 60.0  # frames, the first memory of a topology whose evidence fades
FADING_REFRESH = 32  # frames from one refresh to the next, once the first are over, where evidence fades
HISTORY = (KERNEL - 1) * max(DILATIONS)  # frames that the temporal convolution looks back


class GraphState(NamedTuple):
    """What the graph convolution remembers."""

    total: Tensor  # (N, C_in, F', J), the sum of the input over the frames seen; where evidence fades, of what is left
    topology: Tensor  # (N, C_out, F', 3 J, J), held since the last refresh


def refreshes(count: int, *, fading: bool = False) -> bool:
    """Return whether the topology is refreshed at the `count`-th frame (from 1): at 1, 4, 16, 64, ...

    A mean over t frames moves by 1/t a frame. So the intervals can grow: a held topology drifts as little late in an
    episode as early in it. An episode of 60 frames costs 3 topologies instead of 60. A mean that fades keeps moving. So
    from frame 16 on it is refreshed at equal intervals, and late frames cost as much as early ones.
    """
    if fading and count > 16:
        return count % FADING_REFRESH == 16
    return count & (count - 1) == 0 and count.bit_length() % 2 == 1


class CausalGraphConvolution(nn.Module):
    """Channel-wise topology refinement graph convolution (Chen et al. 2021, Eq. 3-6), causal.

    The published layer averages its two embeddings over the whole clip. Here the mean runs over the frames seen
    so far; the embeddings are linear, so one running mean of the input serves all three subsets.

    Args:
        inputs: number C_in of input channels.
        outputs: number C_out of output channels.
        partition: (3, J, J) initial topologies, normalised; entry [s, i, j] carries joint j to joint i.
        fading: whether the mean forgets.
    """

    def __init__(self, *, inputs: int, outputs: int, partition: Tensor, fading: bool = False) -> None:
        """Create the layer. Its refinement starts at zero strength, as published, its convolutions as PyTorch's do."""
        super().__init__()
        self.fading = Fading(torch.tensor([FADING_TOPOLOGY])) if fading else None
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
        self.residual = nn.Identity() if inputs == outputs else normed(inputs, outputs)
        nn.init.constant_(self.norm.weight, 1e-6)  # as published: a block starts as its residual

    def refined(self, mean: Tensor) -> Tensor:
        """Return the topologies (n, C_out, 3 J, J), source to target, for a mean input (n, C_in, J).

        The three subsets stand side by side as sources, so one product with the values sums over the subsets.
        """
        n, j, relations = len(mean), self.joints, 3 * self.relations
        target = product_of(self.relate_target.weight[:, :, 0], bias_of(self.relate_target), mean)
        source = product_of(self.relate_source.weight[:, :, 0], bias_of(self.relate_source), mean)
        relation = torch.tanh(target[:, :, None] - source[..., None]).view(n, relations, j * j)
        weight, shared = self.refinement()
        refined = weight.expand(n, -1, -1) @ torch.cat([relation, shared.expand(n, -1, -1)], dim=1)
        return refined.view(n, self.outputs, 3 * j, j)

    def refinement(self) -> tuple[Tensor, Tensor]:
        """Return what `refined` multiplies relations with, (3 C_out, 3 R + 4), and four more relations, (4, J J).

        These are the same for all: the shared topology of each subset, and ones for the bias.
        """
        # We scale the small weight instead of the large refinement, and add within the product. Each saves a pass over
        # the refinement, and the second another for its gradient. Each subset refines its own relations, as in a
        # grouped convolution; a weight with zeros between the groups makes it one product.
        grouped = (self.refine.weight * self.strength).view(3, self.outputs, self.relations)
        weight = torch.diag_embed(grouped.permute(1, 2, 0)).permute(0, 2, 3, 1).reshape(-1, 3 * self.relations)
        own = torch.eye(3, device=weight.device).repeat(self.outputs, 1)
        bias = (bias_of(self.refine) * self.strength).view(3, self.outputs).t().reshape(-1, 1)
        shared = self.topology.transpose(-1, -2).flatten(1)
        return torch.cat([weight, own, bias], dim=1), torch.cat([shared, torch.ones_like(shared[:1])])

    def beside(self) -> tuple[Tensor, Tensor]:
        """Return the weight (3 C_out, C_in) and the bias (3 C_out,) of the values, by channel and then by subset.

        So the subsets stand side by side already in what they give.
        """
        weight = self.value.weight.view(3, self.outputs, -1).transpose(0, 1).reshape(3 * self.outputs, -1)
        return weight, bias_of(self.value).view(3, self.outputs).t().reshape(-1)

    def finish(self, product: Tensor, x: Tensor) -> Tensor:
        """Normalise the graph product, add the residual, and activate."""
        return functional.relu(self.norm(product) + self.residual(x))

    def forward(self, x: Tensor) -> Tensor:
        """Return the layer's output (N, C_out, J, T) for whole clips (N, C_in, J, T)."""
        n, _, j, frames = x.shape
        begins = [count - 1 for count in range(1, frames + 1) if refreshes(count, fading=self.fading is not None)]
        topologies = self._topologies(x, begins)
        # Frames that share a topology are cut out of the input, not of the values, which are three times as large.
        # A piece has to be copied for the product. With a channel of ones it brings the bias along, and its gradient.
        weight, bias = self.beside()
        weight = torch.cat([weight, bias[:, None]], dim=1).expand(n, -1, -1)
        pieces = []
        lengths = np.diff([*begins, frames]).tolist()
        for topology, piece in zip(topologies, torch.split(x, lengths, dim=3), strict=True):
            values = weight @ torch.cat([piece, torch.ones_like(piece[:, :1])], dim=1).flatten(2)
            pieces.append(topology.transpose(-1, -2) @ values.view(n, self.outputs, 3 * j, -1))
        return self.finish(torch.cat(pieces, dim=3), x)

    def _topologies(self, x: Tensor, begins: list[int]) -> Tensor:
        """Return the topologies (R, n, C_out, 3 J, J) from each of R frames of x (n, C_in, J, T) on."""
        # Filled there, as what is copied to a GPU can't be part of a step that it plays back.
        refreshed = torch.cat([torch.full((1,), begin, device=x.device) for begin in begins])
        age = refreshed - torch.arange(x.shape[3], device=x.device)[:, None]  # (T, R)
        seen = (age >= 0).float()
        shares = seen if self.fading is None else seen * self.fading.keep ** age.clamp(min=0)
        with _full_precision(x.device):  # in bfloat16 sums would lose the late frames
            means = x.float() @ (shares / shares.sum(dim=0))  # (n, C_in, J, R)
        refined = self.refined(means.permute(3, 0, 1, 2).flatten(0, 1))  # of all frames in one product
        return refined.view(len(begins), len(x), *refined.shape[1:])


def _full_precision(device: torch.device) -> AbstractContextManager[object]:
    """Return a context in which products are made in float32, whatever is around it."""
    kind = device.type
    return torch.autocast(kind, enabled=False) if torch.amp.is_autocast_available(kind) else nullcontext()


class CausalTemporalConvolution(nn.Module):
    """Multi-scale temporal convolution (Chen et al. 2021, Fig. 3c) that looks only back and has no strides.

    Four branches of C / 4 channels: two dilated convolutions, a max-pool, and the frame itself.

    Args:
        channels: C, a multiple of 4.
    """

    def __init__(self, *, channels: int) -> None:
        """Create the layer."""
        super().__init__()
        self.branch = channels // 4
        self.reduce = before_norm(Pointwise(channels, channels))
        self.reduce_norm = nn.BatchNorm2d(channels)
        self.convolutions = nn.ModuleList(
            before_norm(nn.Conv2d(self.branch, self.branch, (KERNEL, 1), dilation=(dilation, 1)))
            for dilation in DILATIONS
        )
        self.norm = nn.BatchNorm2d(3 * self.branch)

    def _reduced(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Return the three activated branches that look back, and the one that does not."""
        back, present = torch.split(self.reduce_norm(self.reduce(x)), [3 * self.branch, self.branch], dim=1)
        return functional.relu(back), present

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, C, J, T) for whole clips (N, C, J, T)."""
        back, present = self._reduced(x)
        *convolved, pooled = torch.split(back, self.branch, dim=1)
        outputs = []
        for convolution, branch, dilation in zip(self.convolutions, convolved, DILATIONS, strict=True):
            weight = convolution.weight
            assert isinstance(weight, Tensor)
            seen = functional.pad(branch, ((KERNEL - 1) * dilation, 0))
            outputs.append(
                functional.conv2d(seen, weight.transpose(2, 3), bias_of(convolution), dilation=(1, dilation))
            )
        # The padding is zero, and an activated branch is never below zero, so the pool may see the padding too.
        outputs.append(functional.max_pool2d(functional.pad(pooled, (POOL - 1, 0)), (1, POOL), stride=1))
        back = self.norm(torch.cat(outputs, dim=1))
        if back.requires_grad and back.device.type == "cpu":
            # The gradient is a slice of that of all branches, and batch norm is slow to go back from a slice there.
            back.register_hook(torch.Tensor.contiguous)
        return torch.cat([back, present], dim=1)
