"""What is kept of a training is all that it goes on with, and nothing that could be executed."""

from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file
from torch import nn

from recognition.training.checkpoints import Checkpoint, load_checkpoint, save_checkpoint


def step(network: nn.Module, optimiser: torch.optim.Optimizer, seed: int) -> None:
    optimiser.zero_grad()
    network(torch.randn(8, 3, generator=torch.Generator().manual_seed(seed))).square().sum().backward()
    optimiser.step()


def made() -> tuple[nn.Module, torch.optim.Optimizer]:
    torch.manual_seed(0)
    network = nn.Sequential(nn.Linear(3, 4), nn.BatchNorm1d(4), nn.Linear(4, 2))
    return network, torch.optim.Adam(network.parameters(), lr=0.1, betas=(0.8, 0.99))


def test_what_was_stopped_goes_on_to_the_same_weights(tmp_path: Path) -> None:
    through, optimiser = made()
    for seed in range(2):
        step(through, optimiser, seed)
    states = {"network": through.state_dict()}
    save_checkpoint(tmp_path / "a" / "x.checkpoint", Checkpoint(states, optimiser.state_dict(), {"run": [1, 0.1]}))
    kept = load_checkpoint(tmp_path / "a" / "x.checkpoint")
    assert kept.held == {"run": [1, 0.1]}
    resumed, other = made()
    resumed.load_state_dict(kept.states["network"])
    other.load_state_dict(kept.optimiser or {})
    for seed in range(2, 4):
        step(through, optimiser, seed)
        step(resumed, other, seed)
    for name, expected in through.state_dict().items():
        torch.testing.assert_close(resumed.state_dict()[name], expected, rtol=0, atol=0)


def test_before_the_first_step_there_is_no_optimiser(tmp_path: Path) -> None:
    save_checkpoint(tmp_path / "x.checkpoint", Checkpoint({"network": {"a.b": torch.ones(2)}}, None, {}))
    kept = load_checkpoint(tmp_path / "x.checkpoint")
    assert kept.optimiser is None and kept.held == {}
    assert set(load_file(tmp_path / "x.checkpoint")) == {"network/a.b"}


def test_a_stop_while_writing_leaves_the_one_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "x.checkpoint"
    save_checkpoint(path, Checkpoint({}, None, {"step": 1}))

    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", stopped)
    with pytest.raises(KeyboardInterrupt):
        save_checkpoint(path, Checkpoint({}, None, {"step": 2}))
    assert load_checkpoint(path).held == {"step": 1}
