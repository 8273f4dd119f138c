import numpy as np
import pytest
import torch
from torch import nn

from eval.speed.flops import count_flops
from recognition.networks.ctrgcn import CTRGCN


def test_known_convolution():
    layer = nn.Conv2d(3, 4, (5, 1), padding=(2, 0))
    x = torch.ones(2, 3, 7, 6)
    assert count_flops(lambda: layer(x)) == 2 * (2 * 4 * 7 * 6) * (3 * 5)


@pytest.mark.parametrize("bias", [True, False])
@pytest.mark.parametrize("mode", [torch.enable_grad, torch.no_grad, torch.inference_mode])
def test_known_linear_layer(bias, mode):
    layer = nn.Linear(3, 4, bias=bias)
    x = torch.ones(2, 5, 3)
    with mode():
        assert count_flops(lambda: layer(x)) == 2 * (2 * 5 * 4) * 3


@pytest.mark.parametrize(
    "product",
    [
        lambda a, b: torch.bmm(a.flatten(0, 1), b.flatten(0, 1)),
        torch.matmul,
        lambda a, b: torch.einsum("nctv,ncvu->nctu", a, b),
    ],
)
def test_products_of_batches_of_matrices(product):
    a, b = torch.ones(2, 3, 4, 5), torch.ones(2, 3, 5, 6)
    assert count_flops(lambda: product(a, b)) == 2 * (2 * 3 * 4 * 6) * 5


@pytest.mark.parametrize("mode", [torch.enable_grad, torch.no_grad, torch.inference_mode])
def test_a_network_counts_the_same_with_and_without_gradients(mode):
    network = CTRGCN(
        classes=3, joints=4, persons=1, in_channels=3, adjacency=np.ones((3, 4, 4)), widths=(8,), strides=(1,)
    )
    layers = [  # outputs times inputs of each product of the only block, 2 frames and 4 joints
        3 * 2 * (8 * 4) * 3,  # psi and phi
        3 * (8 * 4 * 4) * 8,  # xi
        3 * (8 * 2 * 4) * 3,  # transformation
        3 * (8 * 2 * 4) * 4,  # aggregation
        (8 * 2 * 4) * 3,  # residual
        4 * (2 * 2 * 4) * 8,  # into the four branches
        2 * (2 * 2 * 4) * (2 * 5),  # along time
        3 * 8,  # classifier
    ]
    with mode():
        assert count_flops(lambda: network.eval()(torch.ones(1, 3, 2, 4, 1))) == 2 * sum(layers)


def test_what_runs_outside_is_not_counted():
    torch.ones(3, 3) @ torch.ones(3, 3)
    assert count_flops(lambda: torch.ones(3) + 1) == 0
