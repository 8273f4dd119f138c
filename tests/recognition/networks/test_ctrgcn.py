from itertools import product

import numpy as np
import pytest
import torch
from safetensors.torch import load_file
from torch import nn

from ehar.data.skeleton import Skeleton
from ehar.errors import ModelError
from recognition.networks.ctrgcn import CTRGCN, SpatialUnit, TemporalUnit, relation_channels
from recognition.networks.graph import partition
from tests.helpers.places import SHARED

REFERENCE = SHARED / "ctrgcn_reference.safetensors"
NTU_PARENT = (2, 21, 21, 3, 21, 5, 6, 7, 21, 9, 10, 11, 1, 13, 14, 15, 1, 17, 18, 19, 21, 23, 8, 25, 12)
NTU = Skeleton(
    tuple(f"joint{i + 1}" for i in range(25)),
    tuple((i, parent - 1) for i, parent in enumerate(NTU_PARENT) if parent != i + 1),
)
CHAIN = Skeleton(tuple("abcde"), ((0, 1), (1, 2), (2, 3), (3, 4)))


@pytest.fixture(autouse=True)
def one_thread():
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def ntu_network():
    return CTRGCN(classes=60, joints=25, persons=2, in_channels=3, adjacency=partition(NTU)).eval()


def small_network(**changes):
    sizes = {"classes": 6, "joints": 5, "persons": 2, "in_channels": 3, "widths": (8, 16), "strides": (1, 2)}
    return CTRGCN(**{**sizes, **changes}, adjacency=partition(CHAIN)).eval()


def randomised(module, seed=0):
    """Give every parameter and statistic a value that matters; published first values hide most of the network."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.copy_(0.5 * torch.randn(parameter.shape, generator=generator))
        for layer in module.modules():
            if isinstance(layer, nn.BatchNorm1d | nn.BatchNorm2d):
                layer.running_mean.copy_(torch.randn(layer.running_mean.shape, generator=generator))
                layer.running_var.copy_(0.5 + torch.rand(layer.running_var.shape, generator=generator))
    return module.eval()


def noise(*shape, seed=1):
    return torch.randn(shape, generator=torch.Generator().manual_seed(seed))


def test_published_logits():
    if not REFERENCE.exists():
        pytest.skip("shared/data/ctrgcn_reference.safetensors is absent")
    tensors = load_file(REFERENCE)
    network = ntu_network()
    state = {name.removeprefix("state."): value for name, value in tensors.items() if name.startswith("state.")}
    network.load_state_dict(state, strict=True)
    with torch.inference_mode():
        torch.testing.assert_close(network(tensors["input"]), tensors["logits"], atol=1e-5, rtol=0)


def test_published_parameter_count():
    assert sum(parameter.numel() for parameter in ntu_network().parameters()) == 1_446_672


def test_unit_is_the_papers_formula():
    """z_ctu = sum over parts and v of (A + alpha * xi(tanh(psi(x_u) - phi(x_v))))_cuv T(x)_ctv, joint by joint."""
    unit = randomised(SpatialUnit(in_channels=3, out_channels=4, adjacency=noise(3, 5, 5, seed=2))).double()
    x = noise(2, 3, 6, 5).double()
    with torch.no_grad():
        unit.alpha.fill_(0.75)
        z = unit.convolve(x).numpy()

    def affine(layer, features):
        return layer.weight.detach().numpy()[:, :, 0, 0] @ features + layer.bias.detach().numpy()

    expected = np.zeros((2, 4, 6, 5))
    for (n, sample), (shared, part), u, v in product(
        enumerate(x.numpy()), zip(unit.PA.detach().numpy(), unit.convs, strict=True), range(5), range(5)
    ):
        psi = np.mean([affine(part.conv1, sample[:, t, u]) for t in range(6)], axis=0)
        phi = np.mean([affine(part.conv2, sample[:, t, v]) for t in range(6)], axis=0)
        refined = shared[u, v] + 0.75 * affine(part.conv4, np.tanh(psi - phi))
        for t in range(6):
            expected[n, :, t, u] += refined * affine(part.conv3, sample[:, t, v])
    np.testing.assert_allclose(z, expected, rtol=1e-10, atol=1e-12)


def test_spatial_unit_without_refinement_is_a_plain_graph_convolution():
    adjacency = torch.from_numpy(partition(CHAIN))
    unit = randomised(SpatialUnit(in_channels=4, out_channels=4, adjacency=adjacency))
    x = noise(2, 4, 3, 5)
    with torch.no_grad():
        unit.alpha.zero_()
        unit.PA.copy_(adjacency)
        z = sum(torch.einsum("uv,nctv->nctu", a, c.conv3(x)) for a, c in zip(adjacency, unit.convs, strict=True))
        torch.testing.assert_close(unit(x), torch.relu(unit.bn(z) + x))


@pytest.mark.parametrize(("branch", "reach"), [(0, 2), (1, 4), (2, 1), (3, 0)])
def test_how_many_frames_a_temporal_branch_sees(branch, reach):
    unit = randomised(TemporalUnit(channels=8, stride=1))
    x = noise(1, 8, 15, 2).requires_grad_()
    unit.branches[branch](x)[:, :, 7].sum().backward()
    seen = x.grad.abs().sum(dim=(0, 1, 3)).nonzero().flatten()
    assert seen.min() >= 7 - reach
    assert seen.max() <= 7 + reach
    if branch != 2:  # the maximum passes a gradient only to the frames that attain it
        assert (seen.min().item(), seen.max().item()) == (7 - reach, 7 + reach)


@pytest.mark.parametrize("frames", [1, 2, 3, 4, 5, 64])
@pytest.mark.parametrize("stride", [1, 2, 3])
def test_a_stride_rounds_up(frames, stride):
    with torch.no_grad():
        assert TemporalUnit(channels=8, stride=stride)(torch.zeros(1, 8, frames, 2)).shape[2] == -(-frames // stride)


@pytest.mark.parametrize("frames", [1, 2, 3, 4, 5, 7, 8, 33, 64])
def test_clips_of_any_length(frames):
    with torch.inference_mode():
        logits = randomised(small_network(widths=(8, 8, 8), strides=(2, 2, 2)))(noise(2, 3, frames, 5, 2))
    assert logits.shape == (2, 6)
    assert logits.isfinite().all()


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_published_network_takes_short_clips(frames):
    with torch.inference_mode():
        assert ntu_network()(noise(1, 3, frames, 25, 2)).isfinite().all()


def test_a_single_frame_trains():
    network = small_network().train()
    network(noise(4, 3, 1, 5, 2)).sum().backward()
    still = {name for name, parameter in network.named_parameters() if parameter.grad is None}
    assert still and all(name.endswith("bias") for name in still)


def test_biases_that_do_not_learn_are_those_that_a_norm_takes_away():
    network = randomised(small_network()).train()
    x = noise(4, 3, 8, 5, 2)
    before = network(x)
    still = [parameter for parameter in network.parameters() if not parameter.requires_grad]
    assert still
    for parameter in still:
        parameter.data += torch.linspace(-3, 3, len(parameter))
    torch.testing.assert_close(network(x), before, rtol=0, atol=1e-4)


@pytest.mark.parametrize("persons", [1, 3])
@pytest.mark.parametrize("channels", [2, 5, 9, 12])
def test_small_widths_and_any_input(persons, channels):
    network = small_network(persons=persons, in_channels=channels, widths=(32, 32, 48, 48), strides=(1, 1, 1, 1))
    with torch.inference_mode():
        assert network(noise(2, channels, 4, 5, persons)).shape == (2, 6)


def test_the_order_of_persons_does_not_matter():
    network = randomised(small_network(persons=3))
    with torch.inference_mode():
        for values in (*network.data_bn.parameters(), network.data_bn.running_mean, network.data_bn.running_var):
            values.copy_(
                values.reshape(3, -1)[:1].expand(3, -1).flatten()
            )  # the only weights that persons do not share
        x = noise(2, 3, 8, 5, 3)
        torch.testing.assert_close(network(x), network(x[..., [2, 0, 1]]), atol=1e-5, rtol=1e-5)


def test_a_sample_does_not_depend_on_the_others():
    network = randomised(small_network())
    x = noise(3, 3, 8, 5, 2)
    with torch.inference_mode():
        torch.testing.assert_close(network(x)[1:2], network(x[1:2]), atol=1e-5, rtol=1e-5)


def test_logits_are_linear_in_the_embedding():
    network = randomised(small_network())
    x = noise(2, 3, 8, 5, 2)
    with torch.inference_mode():
        assert network.embed(x).shape == (2, 16)
        torch.testing.assert_close(network.fc(network.embed(x)), network(x))


def test_first_weights_follow_the_generator():
    same, again = (small_network(generator=torch.Generator().manual_seed(5)).state_dict() for _ in range(2))
    other = small_network(generator=torch.Generator().manual_seed(6)).state_dict()
    assert all(torch.equal(value, again[name]) for name, value in same.items())
    assert not torch.equal(same["fc.weight"], other["fc.weight"])


def test_relation_channels():
    assert [relation_channels(width) for width in (3, 9, 64, 128, 256)] == [8, 8, 8, 16, 32]
    assert [relation_channels(width) for width in (2, 12, 32, 48)] == [8, 4, 4, 6]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joints": 7}, r"\(3, 5, 5\), expected \(3, 7, 7\)"),
        ({"strides": (1,)}, "2 widths and 1 strides"),
        ({"widths": (8, 18)}, "multiples of 4"),
    ],
)
def test_sizes_that_contradict_each_other(change, message):
    with pytest.raises(ModelError, match=message):
        small_network(**change)
