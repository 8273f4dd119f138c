"""CTR-GCN as published (Chen et al., "Channel-wise Topology Refinement Graph Convolution", ICCV 2021).

Parameters and buffers are named as in the public implementation, so that its checkpoints load with `strict=True`.
This module uses the paper's letters for axes: N samples, C channels, T frames, V joints, M persons.
"""

import math
from collections.abc import Sequence
from typing import cast

import torch
from torch import Tensor, nn

from ehar.arrays import FloatArray
from ehar.errors import ModelError
from recognition.networks.pointwise import Pointwise, before_norm, bias_of, normed, product_of
from recognition.networks.sizes import PUBLISHED_STRIDES, PUBLISHED_WIDTHS

BRANCHES = 4


class CTRGC(nn.Module):
    """The affine maps psi, phi, T and xi of one part of the partition: `conv1`, `conv2`, `conv3` and `conv4`."""

    def __init__(self, *, in_channels: int, out_channels: int) -> None:
        """Create the maps; `relation_channels` gives the width of psi and phi."""
        super().__init__()
        relation = relation_channels(in_channels)
        self.conv1 = Pointwise(in_channels, relation)
        self.conv2 = Pointwise(in_channels, relation)
        self.conv3 = Pointwise(in_channels, out_channels)
        self.conv4 = Pointwise(relation, out_channels)


class SpatialUnit(nn.Module):
    """Spatial modelling (Sec. 3.4): the sum of one graph convolution for each part of the partition, with a residual.

    In a channel-wise topology refinement graph convolution (Sec. 3.2) each channel c of a sample has its own topology.
    It is the shared one, refined by a correlation of joints i and j:

        M_ij = tanh(psi(x_i) - phi(x_j))    correlation (M1 in the paper) of the features' means over time
        R_c  = A + alpha * xi(M)_c          channel-wise topology
        z_c  = R_c T(x)_c                   channel-wise aggregation of the transformed features

    The shared topology `PA` (3, V, V) and `alpha` are learned. `alpha` starts at 0, so there is no refinement at first.
    """

    def __init__(self, *, in_channels: int, out_channels: int, adjacency: Tensor) -> None:
        """Create the unit; the shared topology starts as `adjacency` (3, V, V)."""
        super().__init__()
        self.out_channels = out_channels
        self.convs = nn.ModuleList(CTRGC(in_channels=in_channels, out_channels=out_channels) for _ in adjacency)
        self.PA = nn.Parameter(adjacency.clone())
        self.alpha = nn.Parameter(torch.zeros(1))
        self.bn = nn.BatchNorm2d(out_channels)
        self.down: nn.Module = nn.Identity()
        if in_channels != out_channels:
            self.down = normed(in_channels, out_channels)

    def forward(self, x: Tensor) -> Tensor:
        """Convolve x (N, C, T, V) over joints, add the residual and activate, to (N, C', T, V)."""
        return torch.relu(self.bn(self.convolve(x)) + self.down(x))

    def convolve(self, x: Tensor) -> Tensor:
        """Return the sum of the graph convolutions; all parts are computed at once, in fewer and larger products."""
        samples, _, frames, joints = x.shape
        values = product_of(*self._maps("conv3"), x).view(samples, -1, self.out_channels, frames, joints)
        gathered = values @ self._topologies(x.mean(dim=2, keepdim=True)).transpose(-1, -2)
        return gathered.sum(dim=1)

    def _topologies(self, mean: Tensor) -> Tensor:
        """Return the topologies (N, 3, C', V, V) for features whose mean over time is `mean` (N, C, 1, V).

        The published code averages psi(x) and phi(x) over time. Both are affine, so their value at the mean is their
        average.
        """
        samples, parts, joints = len(mean), len(self.PA), mean.shape[3]
        psi, phi = (product_of(*self._maps(name), mean) for name in ("conv1", "conv2"))
        correlation = torch.tanh(psi.transpose(2, 3) - phi).view(samples, parts, -1, joints**2)
        weight, bias = self._maps("conv4")
        refined = weight.view(parts, self.out_channels, -1) @ correlation + bias.view(parts, -1, 1)
        return torch.addcmul(self.PA[:, None], refined.view(samples, parts, -1, joints, joints), self.alpha)

    def _maps(self, name: str) -> tuple[Tensor, Tensor]:
        """Return the weights (3 O, I) and the biases (3 O,) of a map of all parts."""
        maps = [cast("Pointwise", conv.get_submodule(name)) for conv in self.convs]
        return torch.cat([each.weight.flatten(1) for each in maps]), torch.cat([bias_of(each) for each in maps])


class TemporalConvolution(nn.Module):
    """A convolution over time and its normalisation, padded so that only the stride shortens a clip."""

    def __init__(self, *, in_channels: int, out_channels: int, kernel: int, stride: int, dilation: int = 1) -> None:
        """Create the convolution over `kernel` frames that are `dilation` apart."""
        super().__init__()
        self.conv = nn.Conv2d(
            in_channels,
            out_channels,
            (kernel, 1),
            stride=(stride, 1),
            padding=(dilation * (kernel - 1) // 2, 0),
            dilation=(dilation, 1),
        )
        before_norm(self.conv)
        self.bn = nn.BatchNorm2d(out_channels)

    def forward(self, x: Tensor) -> Tensor:
        """Convolve x (N, C, T, V) to (N, C', ceil(T / stride), V)."""
        convolved: Tensor = self.bn(self.conv(x))
        return convolved


class TemporalUnit(nn.Module):
    """Multi-scale temporal modelling (Sec. 3.4): four branches, each with a quarter of the channels.

    The branches are convolutions of 5 frames with dilations 1 and 2, the maximum of 3 frames, and the frame itself.
    """

    def __init__(self, *, channels: int, stride: int) -> None:
        """Create the unit; the number of `channels` is a multiple of 4."""
        super().__init__()
        width = channels // BRANCHES

        def reduced(*rest: nn.Module) -> nn.Sequential:
            return nn.Sequential(*normed(channels, width), nn.ReLU(), *rest)

        def dilated(dilation: int) -> nn.Sequential:
            return reduced(
                TemporalConvolution(in_channels=width, out_channels=width, kernel=5, stride=stride, dilation=dilation)
            )

        pooled = reduced(nn.MaxPool2d((3, 1), stride=(stride, 1), padding=(1, 0)), nn.BatchNorm2d(width))
        point = nn.Sequential(before_norm(nn.Conv2d(channels, width, 1, stride=(stride, 1))), nn.BatchNorm2d(width))
        self.branches = nn.ModuleList([dilated(1), dilated(2), pooled, point])

    def forward(self, x: Tensor) -> Tensor:
        """Model x (N, C, T, V) over time, to (N, C, ceil(T / stride), V)."""
        return torch.cat([branch(x) for branch in self.branches], dim=1)


class Block(nn.Module):
    """A spatial unit, then a temporal one, and a residual around both (Sec. 3.4)."""

    def __init__(
        self, *, in_channels: int, out_channels: int, stride: int, adjacency: Tensor, residual: bool = True
    ) -> None:
        """Create the block; the first block of the published network has no residual."""
        super().__init__()
        self.gcn1 = SpatialUnit(in_channels=in_channels, out_channels=out_channels, adjacency=adjacency)
        self.tcn1 = TemporalUnit(channels=out_channels, stride=stride)
        self.residual: nn.Module | None = None
        if residual and in_channels == out_channels and stride == 1:
            self.residual = nn.Identity()
        elif residual:
            self.residual = TemporalConvolution(
                in_channels=in_channels, out_channels=out_channels, kernel=1, stride=stride
            )

    def forward(self, x: Tensor) -> Tensor:
        """Map x (N, C, T, V) to (N, C', ceil(T / stride), V)."""
        y = self.tcn1(self.gcn1(x))
        return torch.relu(y if self.residual is None else y + self.residual(x))


class CTRGCN(nn.Module):
    """CTR-GCN: blocks of channel-wise refined graph convolution and multi-scale temporal convolution (Sec. 3.4).

    A clip may have any length T of at least 1. Persons share all weights except the input normalisation, as published.
    """

    def __init__(
        self,
        *,
        classes: int,
        joints: int,
        persons: int,
        in_channels: int,
        adjacency: FloatArray,
        widths: Sequence[int] = PUBLISHED_WIDTHS,
        strides: Sequence[int] = PUBLISHED_STRIDES,
        generator: torch.Generator | None = None,
    ) -> None:
        """Create the network with random weights.

        Args:
            classes: number K of activities.
            joints: number V of joints of a person.
            persons: number M of persons.
            in_channels: number C of values of a joint.
            adjacency: the partition of the skeleton, (3, V, V); see `recognition.networks.graph.partition`.
            widths: channels of each block, each a multiple of 4.
            strides: the factor by which each block shortens time.
            generator: draws the first weights; by default a generator with a fixed seed.

        Raises:
            ModelError: the sizes contradict each other.
        """
        super().__init__()
        if adjacency.shape[1:] != (joints, joints):
            raise ModelError(f"adjacency has shape {adjacency.shape}, expected (3, {joints}, {joints})")
        if not widths or len(widths) != len(strides):
            raise ModelError(f"{len(widths)} widths and {len(strides)} strides, expected one of each for every block")
        if any(width <= 0 or width % BRANCHES for width in widths):
            raise ModelError(f"widths are {tuple(widths)}, expected positive multiples of {BRANCHES}")
        start = torch.as_tensor(adjacency, dtype=torch.float32)
        self.data_bn = nn.BatchNorm1d(persons * joints * in_channels)
        self._blocks: list[str] = []
        width_before = in_channels
        for number, (width, stride) in enumerate(zip(widths, strides, strict=True), start=1):
            self._blocks.append(f"l{number}")
            block = Block(
                in_channels=width_before, out_channels=width, stride=stride, adjacency=start, residual=number > 1
            )
            self.add_module(self._blocks[-1], block)
            width_before = width
        self.fc = nn.Linear(width_before, classes)
        self._initialise(generator or torch.Generator())

    def forward(self, x: Tensor) -> Tensor:
        """Return the logits (N, K) of clips x (N, C, T, V, M)."""
        logits: Tensor = self.fc(self.embed(x))
        return logits

    def embed(self, x: Tensor) -> Tensor:
        """Return the embeddings (N, D) of clips x: features averaged over T, V and M. The logits are linear in them."""
        samples, channels, frames, joints, persons = x.shape
        x = x.permute(0, 4, 3, 1, 2).reshape(samples, persons * joints * channels, frames)
        x = self.data_bn(x).reshape(samples, persons, joints, channels, frames).permute(0, 1, 3, 4, 2)
        x = x.reshape(samples * persons, channels, frames, joints)
        for name in self._blocks:
            x = self.get_submodule(name)(x)
        return x.mean(dim=(2, 3)).reshape(samples, persons, -1).mean(dim=1)

    def _initialise(self, generator: torch.Generator) -> None:
        """Draw convolutions as in He et al. (2015), with fan-out, and the classifier from N(0, 2 / K), as published."""
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, mode="fan_out", generator=generator)
                if module.bias is not None:
                    nn.init.zeros_(module.bias)
            elif isinstance(module, SpatialUnit):
                nn.init.constant_(module.bn.weight, 1e-6)  # a block starts as little more than its residual
        nn.init.normal_(self.fc.weight, 0.0, math.sqrt(2.0 / self.fc.out_features), generator=generator)
        nn.init.zeros_(self.fc.bias)


def relation_channels(in_channels: int) -> int:
    """Return the number of channels in which joints are correlated.

    As published, it is 8 for raw input, which has 3 or 9 channels there, and an eighth of the features otherwise. The
    floor of 4 is ours: below a width of 32, an eighth leaves too few. No published width is that narrow. Our raw
    input of several persons, of 10 channels, is.
    """
    return 8 if in_channels <= 9 else max(4, in_channels // 8)
