"""The agent's network: what it starts from, what it takes, and what it leaves alone."""

import numpy as np
import pytest
import torch
from torch import Tensor

from ehar.errors import ModelError
from planners.agents.inputs import ENCODED, AgentInputs, InputSizes, recognition_parts
from planners.agents.network import STATE, AgentNetwork, AgentSpec
from tests.helpers.agents import untrained_network
from tests.helpers.fakes import CLASS_NAMES

SIZES = InputSizes(recognition=10, vision=22, position=4)


def random_inputs(sizes: InputSizes, *, episodes: int = 50, seed: int = 0) -> dict[str, Tensor]:
    draw = torch.Generator().manual_seed(seed)
    return {name: torch.randn(episodes, getattr(sizes, name), generator=draw) for name in ENCODED}


@pytest.mark.parametrize("without", [(), *((name,) for name in ENCODED), ENCODED[:2]])
def test_a_network_takes_the_inputs_that_are_left_and_no_other(without: tuple[str, ...]) -> None:
    network = untrained_network(without=without)
    inputs = random_inputs(network.spec.sizes)
    state = network.state(inputs)
    assert state.shape == (50, STATE)
    assert network.logits(state).shape == (50, 7)
    assert network.value(state).shape == (50,)
    assert tuple(network.encoders) == network.spec.encoded == tuple(name for name in ENCODED if name not in without)
    other = random_inputs(network.spec.sizes, seed=1)
    for name in ENCODED:
        changed = network.state({**inputs, name: other[name]})
        assert torch.equal(changed, state) == (name in without)
        if name not in without:
            assert not torch.isclose(changed, state).all(dim=1).any(), "it matters in every row"


@pytest.mark.parametrize("left", ["embedding", "log-probs", "time"])
def test_a_part_of_what_f_a_takes_is_left_out_alone(left: str) -> None:
    network = untrained_network(without=(left,))
    assert network.spec.encoded == ENCODED
    inputs = random_inputs(network.spec.sizes)
    state = network.state(inputs)
    for part, columns in recognition_parts(network.spec.sizes.recognition, len(CLASS_NAMES)).items():
        seen = inputs["recognition"].clone()
        seen[:, columns] += 1 + torch.arange(columns.stop - columns.start)  # normalised inputs do not see a shift
        changed = network.state({**inputs, "recognition": seen})
        assert torch.equal(changed, state) == (part == left)


def test_parts_follow_each_other_as_inputs_do() -> None:
    shown = {
        "joints": np.zeros((1, 1, 6, 2)),
        "confidence": np.ones((1, 1, 6)),
        "viewpoint": np.zeros((1, 4)),
        "probabilities": np.full((1, 3), np.exp(-2)),
        "embedding": np.full((1, 5), 7.0),
        "ratio": np.full((1, 1), 0.5),
    }
    seen = AgentInputs().see(shown)["recognition"][0]
    parts = {name: seen[columns].round(5).tolist() for name, columns in recognition_parts(len(seen), 3).items()}
    assert parts == {"embedding": [7] * 10, "log-probs": [-2] * 3, "time": [0.5]}


def test_the_first_policy_is_nearly_uniform() -> None:
    network = AgentNetwork(AgentSpec(SIZES))
    policy = torch.softmax(network.logits(network.state(random_inputs(SIZES))), dim=1)
    np.testing.assert_allclose(policy.detach().numpy(), 1 / 7, atol=0.01)


def test_a_seed_decides_the_weights_and_nothing_else() -> None:
    torch.manual_seed(3)
    expected = torch.rand(1)
    torch.manual_seed(3)
    one, again, other = (AgentNetwork(AgentSpec(SIZES), seed=seed) for seed in (0, 0, 1))
    assert torch.equal(torch.rand(1), expected)
    for name, weight in one.state_dict().items():
        assert torch.equal(weight, again.state_dict()[name])
    assert not torch.equal(one.encoders["vision"][0].weight, other.encoders["vision"][0].weight)  # type: ignore[index]


def test_embeddings_of_any_scale_do() -> None:
    network = untrained_network()
    inputs = random_inputs(network.spec.sizes)
    scaled = {**inputs, "recognition": 1000 * inputs["recognition"] + 20}
    torch.testing.assert_close(network.state(scaled), network.state(inputs), rtol=1e-3, atol=1e-3)


def test_hindsight_is_for_the_critic_only() -> None:
    network = untrained_network(hindsight=5)
    inputs = random_inputs(network.spec.sizes)
    state = network.state(inputs)
    values = [network.value(state, hindsight) for hindsight in (torch.zeros(50, 5), torch.ones(50, 5))]
    assert not torch.isclose(*values).any()
    assert network.logits(state).shape == (50, 7)  # without any


@pytest.mark.parametrize(
    ("sizes", "without", "hindsight", "message"),
    [
        (InputSizes(0, 22), (), 0, "expected sizes of at least 1, got .*recognition=0"),
        (InputSizes(10, -3), (), 0, "expected sizes of at least 1, got .*vision=-3"),
        (SIZES, (), -1, "got .*hindsight -1"),
        (SIZES, ("sound",), 0, "expected some of recognition, vision, position, .* but not all, got .'sound'"),
        (SIZES, ("embedding", "log-probs", "time"), 0, "but not all, got .'embedding', 'log-probs', 'time'"),
        (SIZES, ENCODED, 0, "not all, got .'recognition', 'vision', 'position'"),
    ],
)
def test_what_no_network_can_be_built_for(
    sizes: InputSizes, without: tuple[str, ...], hindsight: int, message: str
) -> None:
    with pytest.raises(ModelError, match=message):
        AgentSpec(sizes, without, hindsight)
