"""The causal network for one frame at a time: the same function as over clips, in fewer and larger products.

Norms are folded into the products before or after them, and products of the same input are one. What does not depend
on the input is computed once. Tensors are (N, C, F, J), as in `layers`.
"""

import copy

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from ehar.arrays import BoolArray, IntArray
from recognition.networks.causal import (
    BlockState,
    CausalBlock,
    CausalCTRGCN,
    StreamingState,
    as_bodies,
    mean_of,
    weighted,
)
from recognition.networks.layers import (
    DILATIONS,
    HISTORY,
    KERNEL,
    PIECE,
    POOL,
    CausalGraphConvolution,
    CausalTemporalConvolution,
    GraphState,
    refreshes,
)
from recognition.networks.pointwise import bias_of, product_of


class CausalStepper(nn.Module):
    """A trained `CausalCTRGCN` that takes one frame at a time.

    It holds weights of its own, which follow from those of the network. So change the network first.

    Args:
        network: the network.
    """

    def __init__(self, network: CausalCTRGCN) -> None:
        """Fold the network."""
        super().__init__()
        self.embedding_size = network.embedding_size
        # The norm of the input stays as it is: where a channel hardly varies it magnifies, rounding errors too.
        self.input_norm = copy.deepcopy(network.input_norm).eval()
        self.blocks = nn.ModuleList(_BlockStep(block) for block in network.typed_blocks())
        self.weigh, self.classify = copy.deepcopy(network.weigh), copy.deepcopy(network.classify)
        self.fading = network.fading is not None
        self.keep = None if network.fading is None else _held(network.fading.keep.repeat(2)[:, None])
        self.requires_grad_(False)

    def start(self, episodes: int, persons: int) -> StreamingState:
        """Return the state of B episodes that have seen nothing."""
        weight = self.classify.weight
        weights = self.embedding_size if self.fading else 1
        return StreamingState(
            forks=1,
            count=np.zeros(episodes, dtype=np.int64),
            blocks=tuple(block.start(episodes * persons) for block in self._typed_blocks()),
            pooled=weight.new_zeros(episodes, self.embedding_size + weights, 1),
        )

    def step(self, x: Tensor, state: StreamingState) -> tuple[Tensor, Tensor, StreamingState]:
        """Take one frame: features (B, F, P, J, C), with F = 1 for an unforked state.

        Returns:
            logits (B, F, K), embedding (B, F, D), and the state after the frame.
        """
        persons = x.shape[2]
        count = state.count + 1
        due = np.array([refreshes(seen, fading=self.fading) for seen in count.tolist()])
        body_count, body_due = count.repeat(persons), due.repeat(persons)
        bodies = as_bodies(self.input_norm, x).contiguous()
        blocks = []
        for block, before in zip(self._typed_blocks(), state.blocks, strict=True):
            bodies, after = block.step(bodies, before, body_count, body_due)
            blocks.append(after)
        kept = state.pooled if self.keep is None else state.pooled * self.keep
        pooled = kept + weighted(self.weigh, x, bodies.mean(dim=3), fading=self.fading).transpose(1, 2)
        embedding = mean_of(pooled.transpose(1, 2), self.embedding_size)
        after_frame = StreamingState(state.forks, count, tuple(blocks), pooled)
        return self.classify(embedding), embedding, after_frame

    def _typed_blocks(self) -> list["_BlockStep"]:
        return [block for block in self.blocks if isinstance(block, _BlockStep)]


class _BlockStep(nn.Module):
    """One block. The residuals of its graph convolution and of the whole are one product, as they have one input."""

    def __init__(self, block: CausalBlock) -> None:
        super().__init__()
        self.outputs = block.graph.outputs
        self.graph = _GraphStep(block.graph)
        self.temporal = _TemporalStep(block.temporal)
        self.inner, self.outer = (isinstance(part, nn.Sequential) for part in (block.graph.residual, block.residual))
        self.has_outer = block.residual is not None
        parts = [_folded(*part) for part in (block.graph.residual, block.residual) if isinstance(part, nn.Sequential)]
        if self.inner:  # the shift of the graph's norm goes along with the residual that is added to it
            parts[0] = (parts[0][0], parts[0][1] + self.graph.shift)
        if parts:
            self.weight = _held(torch.cat([weight for weight, _ in parts]))
            self.bias = _held(torch.cat([bias for _, bias in parts]))

    def start(self, bodies: int) -> BlockState:
        return BlockState(self.graph.start(bodies), self.temporal.start(bodies, self.graph.joints))

    def step(self, x: Tensor, state: BlockState, count: IntArray, due: BoolArray) -> tuple[Tensor, BlockState]:
        inner, outer = None, x if self.has_outer else None
        if self.inner or self.outer:
            both = product_of(self.weight, self.bias, x)
            inner = both[:, : self.outputs] if self.inner else None
            outer = both[:, -self.outputs :] if self.outer else outer
        spatial, graph = self.graph.step(x, state.graph, count, due)
        spatial += x + self.graph.shift[:, None, None] if inner is None else inner
        joined, history = self.temporal.step(spatial.relu_(), state.history)
        if outer is not None:
            joined += outer
        return joined.relu_(), BlockState(graph, history)


class _GraphStep(nn.Module):
    """The graph convolution up to its norm's scale; `shift` is what the norm adds."""

    def __init__(self, layer: CausalGraphConvolution) -> None:
        super().__init__()
        self.inputs, self.outputs, self.joints = layer.value.in_channels, layer.outputs, layer.joints
        scale, shift = _affine(layer.norm)
        weight, bias = layer.beside()
        self.weight = _held(weight * scale.repeat_interleave(3)[:, None])
        self.bias = _held(bias * scale.repeat_interleave(3))
        self.shift = _held(shift)
        relate = (layer.relate_target, layer.relate_source)
        self.related = _held(torch.cat([part.weight[:, :, 0] for part in relate]))
        self.related_bias = _held(torch.cat([bias_of(part) for part in relate]))
        self.fading = copy.deepcopy(layer.fading)
        refine, shared = layer.refinement()
        self.refine, self.shared = _held(refine), _held(shared)

    def start(self, bodies: int) -> GraphState:
        empty = self.weight.new_zeros
        topology = empty(1, 1, 1, 1, 1).expand(bodies, self.outputs, 1, 3 * self.joints, self.joints)
        return GraphState(empty(bodies, self.inputs, 1, self.joints), topology)

    def step(self, x: Tensor, state: GraphState, count: IntArray, due: BoolArray) -> tuple[Tensor, GraphState]:
        total = (state.total if self.fading is None else state.total * self.fading.keep) + x
        topology = state.topology
        if due.all():
            topology = self._fresh(total, torch.as_tensor(count, dtype=total.dtype, device=total.device))
        elif due.any():
            rows = torch.as_tensor(np.flatnonzero(due), device=total.device)
            seen = torch.as_tensor(count[due], dtype=total.dtype, device=total.device)
            topology = topology.expand(-1, -1, total.shape[2], -1, -1).clone()
            topology[rows] = self._fresh(total[rows], seen)
        n, _, forks, j = x.shape
        values = product_of(self.weight, self.bias, x).view(n, self.outputs, 3, forks, j)
        beside = values.transpose(2, 3).reshape(n, self.outputs, forks, 3 * j)  # a view if there are no forks
        if topology.shape[2] == 1:
            product = beside @ topology[:, :, 0]
        else:
            product = (beside[:, :, :, None] @ topology)[:, :, :, 0]
        return product, GraphState(total, topology)

    def refined(self, mean: Tensor) -> Tensor:
        """Return the topologies (n, C_out, 3 J, J) for a mean input (n, C_in, J)."""
        n, j, relations = mean.shape[0], self.joints, self.refine.shape[1] - len(self.shared)
        both = product_of(self.related, self.related_bias, mean) * 2
        relation = both[:, :relations, None] - both[:, relations:, :, None]
        # tanh(x) = 2 sigmoid(2 x) - 1; torch's tanh takes ten times as long as its sigmoid.
        relation = relation.sigmoid_().mul_(2).sub_(1).view(n, relations, j * j)
        refined = self.refine.expand(n, -1, -1) @ torch.cat([relation, self.shared.expand(n, -1, -1)], dim=1)
        return refined.view(n, self.outputs, 3 * j, j)

    def _fresh(self, total: Tensor, count: Tensor) -> Tensor:
        """Return topologies (n, C_out, F, 3 J, J) from sums (n, C_in, F, J) over `count` (n,) frames."""
        n, inputs, forks, j = total.shape
        weight = count if self.fading is None else self.fading.weight(count)
        if forks == 1:
            return self.refined(total[:, :, 0] / weight[:, None, None])[:, :, None]
        fresh = total.new_empty(n, self.outputs, forks, 3 * j, j)
        # Forks stand behind channels, as in the whole state. We go piece by piece, so the data that the copy below
        # reads is still in the cache. This takes half the time, and no second gigabyte.
        size = max(1, PIECE // forks)
        for sums, weights, piece in zip(*(torch.split(t, size) for t in (total, weight, fresh)), strict=True):
            mean = (sums / weights[:, None, None, None]).transpose(1, 2).reshape(-1, inputs, j)
            refined = self.refined(mean)
            piece.copy_(refined.view(-1, forks, *refined.shape[1:]).transpose(1, 2))
        return fresh


class _TemporalStep(nn.Module):
    """The temporal convolution."""

    def __init__(self, layer: CausalTemporalConvolution) -> None:
        super().__init__()
        self.branch = b = layer.branch
        weight, bias = _folded(layer.reduce, layer.reduce_norm)
        self.weight, self.bias = _held(weight), _held(bias)
        scale, shift = _affine(layer.norm)
        taps, biases = [], []
        for i, convolution in enumerate(layer.convolutions):
            here = slice(i * b, (i + 1) * b)
            assert isinstance(convolution, nn.Conv2d)
            taps.append(convolution.weight[:, :, :, 0].transpose(1, 2).flatten(1) * scale[here, None])
            biases.append(bias_of(convolution) * scale[here] + shift[here])
        self.taps, self.tap_bias = _held(torch.stack(taps)), _held(torch.stack(biases))  # (2, b, 5 b), oldest first
        self.pool_scale, self.pool_shift = _held(scale[2 * b :, None, None]), _held(shift[2 * b :, None, None])

    def start(self, bodies: int, joints: int) -> tuple[Tensor, ...]:
        return (self.weight.new_zeros(bodies, 3 * self.branch, 1, joints),) * HISTORY

    def step(self, x: Tensor, history: tuple[Tensor, ...]) -> tuple[Tensor, tuple[Tensor, ...]]:
        b = self.branch
        reduced = product_of(self.weight, self.bias, x)
        back = functional.relu(reduced[:, : 3 * b])
        outputs = []
        for i, dilation in enumerate(DILATIONS):
            channels = slice(i * b, (i + 1) * b)
            past = [frame[:, channels] for frame in history[HISTORY - (KERNEL - 1) * dilation :: dilation]]
            outputs.append(self._tap(i, past, back[:, channels]))
        pooled = back[:, 2 * b :]
        for frame in history[HISTORY - POOL + 1 :]:
            pooled = torch.maximum(pooled, frame[:, 2 * b :])
        outputs += [torch.addcmul(self.pool_shift, pooled, self.pool_scale), reduced[:, 3 * b :]]
        return torch.cat(outputs, dim=1), (*history[1:], back)

    def _tap(self, i: int, past: list[Tensor], present: Tensor) -> Tensor:
        """Return one output frame of a temporal convolution; the past that forks share is convolved once."""
        weight, bias = self.taps[i], self.tap_bias[i]
        forks = max(frame.shape[2] for frame in past)
        if forks == present.shape[2]:  # all have the same size: a single product
            same = [frame.expand(-1, -1, forks, -1) for frame in past] if forks > 1 else past
            return product_of(weight, bias, torch.cat([*same, present], dim=1))
        joined = torch.cat([frame.expand(-1, -1, forks, -1) for frame in past], dim=1)
        before = product_of(weight[:, : -self.branch], bias, joined)
        return before + product_of(weight[:, -self.branch :], torch.zeros_like(bias), present)


def _affine(norm: nn.Module) -> tuple[Tensor, Tensor]:
    """Return what a batch norm multiplies and adds in evaluation, in double precision."""
    assert isinstance(norm, nn.BatchNorm1d | nn.BatchNorm2d)
    assert norm.running_mean is not None and norm.running_var is not None
    scale = norm.weight.double() / (norm.running_var.double() + norm.eps).sqrt()
    return scale, norm.bias.double() - norm.running_mean.double() * scale


def _folded(convolution: nn.Module, norm: nn.Module) -> tuple[Tensor, Tensor]:
    """Return the weight (C_out, C_in) and the bias (C_out,) of a 1 x 1 convolution and the norm behind it."""
    assert isinstance(convolution, nn.Conv2d)
    scale, shift = _affine(norm)
    return convolution.weight.flatten(1) * scale[:, None], bias_of(convolution) * scale + shift


def _held(tensor: Tensor) -> nn.Parameter:
    """Return a constant of a module, in single precision."""
    return nn.Parameter(tensor.detach().float().contiguous(), requires_grad=False)
