"""The streaming form: a step is the forward pass of the prefix, nothing looks ahead, forks and resets are exact."""

from dataclasses import dataclass

import numpy as np
import pytest
import torch
from torch import Tensor

from ehar.data.skeleton import Skeleton
from recognition.networks.causal import LEAST_WEIGHT, CausalCTRGCN, StreamingState
from recognition.networks.graph import partition
from recognition.networks.layers import (
    HISTORY,
    CausalGraphConvolution,
    CausalTemporalConvolution,
    refreshes,
)
from recognition.networks.stepper import CausalStepper
from tests.helpers.random_networks import randomised

SKELETON = Skeleton(tuple("abcde"), ((0, 1), (1, 2), (1, 3), (3, 4)))
JOINTS, CHANNELS, CLASSES = 5, 3, 4
TOLERANCE = 1e-5


@pytest.fixture(scope="module", params=[False, True], ids=["lasting", "fading"])
def network(request: pytest.FixtureRequest) -> CausalCTRGCN:
    """Blocks with and without a change of width, and without the outer residual; evidence lasts, or fades."""
    fresh = CausalCTRGCN(
        classes=CLASSES,
        channels=CHANNELS,
        partition=torch.from_numpy(partition(SKELETON)),
        widths=(8, 8, 12),
        dropout=0.3,
        fading=request.param,
    )
    randomised(fresh)
    return fresh.requires_grad_(False)


def clips(*, episodes: int = 2, frames: int = 20, persons: int = 1, seed: int = 0) -> Tensor:
    return torch.randn(episodes, frames, persons, JOINTS, CHANNELS, generator=torch.Generator().manual_seed(seed))


@dataclass
class Run:
    """Frames taken one at a time."""

    network: CausalStepper
    state: StreamingState

    def take(self, x: Tensor) -> Tensor:
        """Step over frames (B, T, P, J, C), or (B, T, F, P, J, C) when forked; return logits (B, T, F, K)."""
        outputs = []
        for frame in x.unbind(1):
            logits, _, self.state = self.network.step(frame if frame.dim() == 5 else frame[:, None], self.state)
            outputs.append(logits)
        return torch.stack(outputs, dim=1)


def begun(network: CausalCTRGCN, x: Tensor) -> Run:
    """Return a run of the episodes of frames (B, T, P, J, C) that has taken them."""
    stepper = CausalStepper(network)
    run = Run(stepper, stepper.start(len(x), x.shape[2]))
    if x.shape[1]:
        run.take(x)
    return run


def tensors(state: StreamingState) -> list[Tensor]:
    """Return all that a state holds over its fork axis."""
    held = [state.pooled]
    for block in state.blocks:
        held += [block.graph.total, block.graph.topology, *block.history]
    return held


def assert_close(actual: Tensor, expected: Tensor) -> None:
    # A sum of large terms may be small: what is rounded is as large as the greatest of a tensor.
    greatest = float(expected.detach().abs().max()) if expected.numel() else 0.0
    torch.testing.assert_close(actual, expected, atol=TOLERANCE * max(1.0, greatest), rtol=TOLERANCE)


def test_the_topology_is_refreshed_at_powers_of_four() -> None:
    assert [count for count in range(1, 300) if refreshes(count)] == [1, 4, 16, 64, 256]


def test_a_topology_that_fades_is_refreshed_at_equal_intervals() -> None:
    assert [count for count in range(1, 150) if refreshes(count, fading=True)] == [1, 4, 16, 48, 80, 112, 144]


@pytest.mark.parametrize("persons", [1, 2])
@pytest.mark.parametrize("length", [20, 70])
def test_every_step_is_the_forward_pass_of_its_prefix(network: CausalCTRGCN, persons: int, length: int) -> None:
    x = clips(frames=length, persons=persons)
    stepped = begun(network, x[:, :0]).take(x)[:, :, 0]
    assert 0.1 < stepped.std() < 10  # the tolerance means something
    for end in range(1, length + 1):
        assert_close(stepped[:, end - 1], network(x[:, :end])[:, -1])


def test_every_prefix_comes_out_of_one_pass(network: CausalCTRGCN) -> None:
    x = clips(frames=70, persons=2)
    whole = network(x)
    for end in (1, 3, 4, 15, 16, 17, 47, 48, 49, 63, 64, 65):
        assert_close(whole[:, :end], network(x[:, :end]))


def test_the_embedding_is_what_the_logits_are_linear_in(network: CausalCTRGCN) -> None:
    stepper = CausalStepper(network)
    logits, embedding, _ = stepper.step(clips(frames=1), stepper.start(2, 1))
    assert embedding.shape == (2, 1, network.embedding_size)
    assert_close(logits, network.classify(embedding))


def test_the_embedding_is_the_mean_of_frames_weighed_by_what_they_show(network: CausalCTRGCN) -> None:
    seen: dict[str, list[Tensor]] = {"pooled": [], "weight": []}

    def keep(module: torch.nn.Module, given: tuple[Tensor], logit: Tensor) -> None:
        seen["pooled"].append(given[0][..., : network.embedding_size])
        seen["weight"].append(torch.sigmoid(logit) + LEAST_WEIGHT)

    stepper = CausalStepper(network)
    x, state = clips(frames=9, persons=2), stepper.start(2, 2)
    hook = stepper.weigh.register_forward_hook(keep)
    for frame in x.unbind(1):
        _, embedding, state = stepper.step(frame[:, None], state)
    hook.remove()
    pooled, weight = (torch.cat(parts, dim=1) for parts in seen.values())
    assert weight.min() > 0 and weight.max() < 1 and weight.std() > 0.01  # not all alike
    if network.fading is not None:
        weight = weight * network.fading.keep ** torch.arange(8, -1, -1)[:, None]
    assert_close(embedding, (weight * pooled).sum(dim=1, keepdim=True) / weight.sum(dim=1, keepdim=True))
    assert_close(network(x)[:, -1:], network.classify(embedding))


def test_evidence_that_fades_lets_go_of_what_was_seen_long_ago() -> None:
    # Whatever came first, and however long: after enough other frames nothing is left of it, but for the convolutions.
    fresh = CausalCTRGCN(
        classes=CLASSES,
        channels=CHANNELS,
        partition=torch.from_numpy(partition(SKELETON)),
        widths=(8, 12),
        fading=True,
    )
    randomised(fresh).requires_grad_(False)
    assert fresh.fading is not None
    fresh.fading.log_memory.fill_(2.0)  # e^2 frames
    last = clips(frames=160, seed=1)
    short, other = (torch.cat([clips(frames=16, seed=seed), last], dim=1) for seed in (2, 3))
    long = torch.cat([clips(frames=208, seed=4), last], dim=1)
    assert (fresh(short)[:, 20] - fresh(other)[:, 20]).abs().max() > 100 * TOLERANCE
    assert_close(fresh(short)[:, -1], fresh(other)[:, -1])
    assert_close(fresh(short)[:, -1], fresh(long)[:, -1])  # both begin where the refreshes fall on the same frames


def test_frames_that_all_count_as_nothing_still_have_a_mean(network: CausalCTRGCN) -> None:
    bias = network.weigh[-1].bias.clone()
    try:
        network.weigh[-1].bias.fill_(-1e4)
        x = clips(persons=2)
        logits = network(x)
        assert torch.isfinite(logits).all()
        assert_close(begun(network, x[:, :0]).take(x)[:, :, 0], logits)
    finally:
        network.weigh[-1].bias.copy_(bias)


@pytest.mark.parametrize("frame", [0, 3, 9, 16, 19])
def test_no_output_depends_on_a_later_frame(network: CausalCTRGCN, frame: int) -> None:
    x = clips(persons=2).requires_grad_(True)
    network(x)[:, frame].square().sum().backward()
    assert x.grad is not None
    assert not x.grad[:, frame + 1 :].any()
    assert x.grad[:, : frame + 1].abs().amax(dim=(0, 2, 3, 4)).min() > 0  # and on every frame up to it


def test_an_output_depends_on_its_own_episode_only(network: CausalCTRGCN) -> None:
    x = clips(episodes=3, persons=2).requires_grad_(True)
    network(x)[1].square().sum().backward()
    assert x.grad is not None
    assert not x.grad[[0, 2]].any()
    assert x.grad[1].any()


@pytest.mark.parametrize("refined", [True, False])
def test_the_refinement_and_its_refresh_matter(network: CausalCTRGCN, refined: bool) -> None:
    # Guards the tests above: a topology that ignored its input would pass them.
    layer = network.blocks[0].graph
    assert isinstance(layer, CausalGraphConvolution)
    means = clips(episodes=2, frames=1)[:, 0, 0].transpose(1, 2)
    strength = layer.strength.clone()
    try:
        layer.strength.fill_(float(refined))
        first, second = layer.refined(means)
    finally:
        layer.strength.copy_(strength)
    assert torch.allclose(first, second) is not refined


def test_a_topology_is_held_between_refreshes(network: CausalCTRGCN) -> None:
    x = clips(frames=17, persons=2)
    run = begun(network, x[:, :0])
    for count, frame in enumerate(x.split(1, dim=1), start=1):
        before = [block.graph.topology for block in run.state.blocks]
        run.take(frame)
        after = [block.graph.topology for block in run.state.blocks]
        for old, new in zip(before, after, strict=True):
            assert (old is new) is not refreshes(count, fading=network.fading is not None)


def test_the_graph_convolution_by_hand() -> None:
    # Without refinement: the sum over the subsets of topology @ value, normalised, plus the residual, activated.
    layer = CausalGraphConvolution(inputs=4, outputs=4, partition=torch.from_numpy(partition(SKELETON))).eval()
    torch.nn.init.uniform_(layer.norm.weight, 0.5, 1.5, generator=torch.Generator().manual_seed(0))
    x = torch.randn(2, 4, 6, JOINTS, generator=torch.Generator().manual_seed(1))
    values = torch.einsum("oc,nctj->notj", layer.value.weight[:, :, 0, 0], x) + layer.value.bias[:, None, None]
    product = torch.einsum("sij,nsotj->noti", layer.topology, values.view(2, 3, 4, 6, JOINTS))
    assert_close(layer(x.transpose(2, 3)).transpose(2, 3), torch.relu(layer.norm(product) + x))


@pytest.mark.parametrize("fading", [False, True])
def test_biases_that_do_not_learn_are_those_that_a_norm_takes_away(fading: bool) -> None:
    fresh = CausalCTRGCN(
        classes=CLASSES,
        channels=CHANNELS,
        partition=torch.from_numpy(partition(SKELETON)),
        widths=(8, 12),
        fading=fading,
    )
    randomised(fresh)
    x = clips(episodes=4)
    before = fresh.train()(x)
    still = {name for name, parameter in fresh.named_parameters() if not parameter.requires_grad}
    for name, parameter in fresh.named_parameters():
        if name in still:
            parameter.data += torch.linspace(-3, 3, len(parameter))
    torch.testing.assert_close(fresh(x), before, rtol=0, atol=1e-4)
    # Each block has them in its temporal convolution; a change of width has one around it, and one around both.
    temporal = {f"blocks.{block}.temporal.{part}.bias" for block in (0, 1) for part in ("reduce", "convolutions.0")}
    assert temporal < still and all(name.endswith("bias") for name in still)
    assert len(still) == 2 * 3 + 3
    learned = [name for name, parameter in fresh.named_parameters() if parameter.requires_grad]
    assert {"blocks.0.graph.value.bias", "blocks.0.temporal.norm.bias", "classify.bias"} < set(learned)


def test_the_temporal_convolution_looks_back_as_far_as_its_history() -> None:
    layer = CausalTemporalConvolution(channels=8)
    randomised(layer)
    x = torch.randn(1, 8, JOINTS, 20, generator=torch.Generator().manual_seed(0), requires_grad=True)
    layer(x)[..., 15].square().sum().backward()
    assert x.grad is not None
    reached = x.grad.abs().amax(dim=(0, 1, 2)) > 0
    assert reached.nonzero().min() == 15 - HISTORY
    assert reached.nonzero().max() == 15


FORKS = 3


@pytest.mark.parametrize("persons", [1, 2])
@pytest.mark.parametrize("before", [0, 1, 3, 7, 14])  # forked frames across the refreshes at 1, 4 and 16, and none
def test_forks_are_what_each_alternative_alone_would_be(network: CausalCTRGCN, persons: int, before: int) -> None:
    past, future = clips(frames=before, persons=persons), clips(frames=4, persons=persons, seed=1)
    alternatives = clips(episodes=2, frames=12, persons=persons, seed=2).view(2, 4, FORKS, persons, JOINTS, CHANNELS)
    forked = begun(network, past)
    forked.state = forked.state.fork(FORKS)
    logits = forked.take(alternatives)
    assert logits.shape == (2, 4, FORKS, CLASSES)
    alone = [begun(network, past) for _ in range(FORKS)]
    for fork, run in enumerate(alone):
        assert_close(logits[:, :, fork], run.take(alternatives[:, :, fork])[:, :, 0])
    chosen = Run(forked.network, forked.state.select(torch.tensor([2, 0])))
    assert chosen.state.forks == 1
    after = chosen.take(future)
    assert_close(after[0], alone[2].take(future)[0])
    assert_close(after[1], alone[0].take(future)[1])


def test_a_selected_state_forks_again(network: CausalCTRGCN) -> None:
    # What the oracle does: fork, one frame, select, at every frame.
    alternatives = clips(frames=18 * FORKS).view(2, 18, FORKS, 1, JOINTS, CHANNELS)
    choice = torch.randint(FORKS, (18, 2), generator=torch.Generator().manual_seed(0))
    run = begun(network, clips(frames=0))
    for frame, chosen in enumerate(choice):
        run.state = run.state.fork(FORKS)
        run.take(alternatives[:, frame : frame + 1])
        run.state = run.state.select(chosen)
    taken = torch.stack([alternatives[b, torch.arange(18), choice[:, b]] for b in range(2)])
    for stepped, whole in zip(tensors(run.state), tensors(begun(network, taken).state), strict=True):
        assert_close(stepped, whole)


def test_a_fork_copies_nothing(network: CausalCTRGCN) -> None:
    run = begun(network, clips(frames=5, persons=2))
    original = tensors(run.state)
    forked = run.state.fork(FORKS)
    assert all(mine is theirs for mine, theirs in zip(tensors(forked), original, strict=True))
    logits, _, after = run.network.step(clips(frames=FORKS, persons=2, seed=1), forked)
    assert logits.shape == (2, FORKS, CLASSES)
    for old, new in zip(run.state.blocks, after.blocks, strict=True):
        assert new.graph.topology is old.graph.topology  # held: no refresh at frame 6
        assert all(mine is theirs for mine, theirs in zip(new.history[:-1], old.history[1:], strict=True))
        assert new.history[-1].shape[2] == new.graph.total.shape[2] == FORKS


def test_a_forked_state_cannot_be_forked(network: CausalCTRGCN) -> None:
    with pytest.raises(ValueError, match="got one of 3 forks"):
        CausalStepper(network).start(2, 1).fork(3).fork(2)


def test_stepping_leaves_the_state_before_as_it_was(network: CausalCTRGCN) -> None:
    run = begun(network, clips(frames=3))
    before = run.state
    copies = [tensor.clone() for tensor in tensors(before)]
    count = before.count.copy()
    run.take(clips(frames=2, seed=1))
    before.reset(torch.tensor([True, False]))
    assert all(torch.equal(mine, copy) for mine, copy in zip(tensors(before), copies, strict=True))
    assert np.array_equal(before.count, count)


@pytest.mark.parametrize("persons", [1, 2])
@pytest.mark.parametrize("at", [2, 10])
def test_reset_episodes_begin_anew_and_the_others_go_on(network: CausalCTRGCN, persons: int, at: int) -> None:
    # After the reset the episodes' refreshes fall on different frames.
    x = clips(episodes=3, frames=at + 18, persons=persons)
    mask = torch.tensor([True, False, True])
    run = begun(network, x[:, :at])
    run.state = run.state.reset(mask)
    assert run.state.count.tolist() == [0, at, 0]
    after = run.take(x[:, at:])[:, :, 0]
    assert_close(after[mask], network(x[mask, at:]))
    assert_close(after[~mask], network(x[~mask])[:, at:])


def test_forks_of_episodes_that_began_at_different_times(network: CausalCTRGCN) -> None:
    # Some of the forked frames refresh the topology of one episode and not of the other.
    x, alternatives = clips(frames=15, persons=2), clips(frames=4 * FORKS, persons=2, seed=1)
    forked_frames = alternatives.view(2, 4, FORKS, 2, JOINTS, CHANNELS)
    run = begun(network, x[:, :13])
    run.state = run.state.reset(torch.tensor([True, False]))
    run.take(x[:, 13:])
    run.state = run.state.fork(FORKS)
    logits = run.take(forked_frames)
    for fork in range(FORKS):
        whole = torch.cat([x, forked_frames[:, :, fork]], dim=1)
        assert_close(logits[0, :, fork], network(whole[:1, 13:])[0, 2:])
        assert_close(logits[1, :, fork], network(whole[1:])[0, 15:])


def test_a_forked_state_resets_whole_episodes(network: CausalCTRGCN) -> None:
    run = begun(network, clips(frames=4))
    run.state = run.state.fork(FORKS)
    run.take(clips(frames=FORKS, seed=1).view(2, 1, FORKS, 1, JOINTS, CHANNELS))
    run.state = run.state.reset(torch.tensor([False, True]))
    alternatives = clips(frames=FORKS, seed=2).view(2, 1, FORKS, 1, JOINTS, CHANNELS)
    logits = run.take(alternatives)
    assert_close(logits[1, 0], network(alternatives[1].transpose(0, 1))[:, 0])
