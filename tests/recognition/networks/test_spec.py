"""Which network a spec builds, and that a seed alone decides its first weights."""

import pytest
import torch

from ehar.conditions import Form
from recognition.networks.causal import CausalCTRGCN
from recognition.networks.ctrgcn import CTRGCN
from recognition.networks.features import channel_count
from recognition.networks.sizes import PUBLISHED_WIDTHS
from recognition.networks.spec import NetworkSpec
from recognition.training.config import Size
from tests.helpers.fakes import tiny_data


def spec(form: Form, size: Size = "small") -> NetworkSpec:
    return NetworkSpec.of(tiny_data(persons=2), form=form, size=size, length=10)


def test_a_spec_is_what_the_data_says() -> None:
    data = tiny_data(persons=2)
    of_data = spec("causal")
    assert (of_data.class_names, of_data.skeleton, of_data.persons) == (data.class_names, data.skeleton, 2)
    assert (of_data.fps, of_data.length) == (data.fps, 10)


@pytest.mark.parametrize("form", ["causal", "ctrgcn"])
def test_the_seed_decides_every_weight_that_is_drawn(form: Form) -> None:
    first, again, other = (spec(form).build(seed).state_dict() for seed in (3, 3, 4))
    assert all(torch.equal(first[name], again[name]) for name in first)
    assert not torch.equal(first[_classifier(form)], other[_classifier(form)])
    drawn = [name for name in first if first[name].dim() == 4]  # every convolution over frames and joints
    assert drawn
    assert not any(torch.equal(first[name], other[name]) for name in drawn)


def _classifier(form: Form) -> str:
    return "classify.weight" if form == "causal" else "fc.weight"


@pytest.mark.parametrize("form", ["causal", "ctrgcn"])
def test_building_leaves_the_global_generator_as_it_was(form: Form) -> None:
    before = torch.random.get_rng_state()
    spec(form).build(5)
    assert torch.equal(torch.random.get_rng_state(), before)


@pytest.mark.parametrize("form", ["causal", "ctrgcn"])
def test_the_published_size_has_the_published_widths(form: Form) -> None:
    published, small = spec(form, "published"), spec(form)
    assert published.widths == PUBLISHED_WIDTHS
    sizes = [sum(weight.numel() for weight in built.build().parameters()) for built in (published, small)]
    assert sizes[0] > 1_000_000
    assert sizes[1] < 250_000  # 1 MB in float32: it ships


def test_half_of_the_widths_has_all_blocks_and_both_strides() -> None:
    half, published = spec("ctrgcn", "half"), spec("ctrgcn", "published")
    assert half.widths == (32, 32, 32, 32, 64, 64, 64, 128, 128, 128)
    strides, whole = (
        [module.stride for module in built.build().modules() if isinstance(module, torch.nn.Conv2d)]
        for built in (half, published)
    )
    assert strides == whole and (2, 1) in strides


@pytest.mark.parametrize("form", ["causal", "ctrgcn"])
def test_takes_the_data_s_features(form: Form) -> None:
    network = spec(form).build().eval()
    x = torch.randn(2, 10, 2, 6, channel_count(2, view=form == "causal"), generator=torch.Generator().manual_seed(0))
    with torch.inference_mode():
        if isinstance(network, CausalCTRGCN):
            assert network(x).shape == (2, 10, 3)
        else:
            assert isinstance(network, CTRGCN)
            assert network(x.permute(0, 4, 1, 3, 2)).shape == (2, 3)
