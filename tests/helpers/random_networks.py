"""Networks whose every weight and statistic matters; fresh ones hide most of themselves behind zeros and ones."""

from pathlib import Path

import torch
from torch import Tensor, nn

from ehar.conditions import Conditions
from ehar.data.motion_file import save_motion
from ehar.world import PAPER, World
from recognition.calibration import Temperature
from recognition.networks.spec import NetworkSpec
from recognition.storage import recogniser_path, save_recogniser
from tests.helpers.fakes import tiny_data


def randomised(network: nn.Module, seed: int = 0) -> nn.Module:
    """Draw all that a network has learnt, in place, so that activations stay near 1; return it in evaluation mode."""
    draw = torch.Generator().manual_seed(seed)

    def uniform(like: Tensor, low: float, high: float) -> Tensor:
        return low + (high - low) * torch.rand(like.shape, generator=draw)

    with torch.no_grad():
        for name, parameter in network.named_parameters():
            if parameter.numel() == 1:  # the strength of a refinement
                parameter.fill_(1.0)
            elif name.endswith("bias"):
                parameter.copy_(uniform(parameter, -0.3, 0.3))
            elif parameter.dim() > 1:
                nn.init.kaiming_uniform_(parameter, a=1.4, generator=draw)
        for layer in network.modules():
            if isinstance(layer, nn.BatchNorm1d | nn.BatchNorm2d):
                assert layer.running_mean is not None and layer.running_var is not None
                layer.weight.copy_(uniform(layer.weight, 0.5, 1.5))
                layer.running_mean.copy_(uniform(layer.running_mean, -0.5, 0.5))
                layer.running_var.copy_(uniform(layer.running_var, 0.5, 2.0))
    return network.eval()


def save_random_world(folder: Path, length: int, world: World = PAPER) -> None:
    """Write tiny.npz, and to models recognisers of both forms for episodes of `length` frames; they learned nothing."""
    data = tiny_data(sequences=24)
    save_motion(folder / "tiny.npz", data)
    for told in (Conditions(), Conditions(views="paper", form="ctrgcn")):
        spec = NetworkSpec.of(data, form=told.form, size="small", length=length, world=world)
        network = spec.build()
        randomised(network)
        run = {"size": "small", "views": told.views, "sensor": "perfect"}
        save_recogniser(recogniser_path(folder / "models", told), network, spec, Temperature(), {"run": run})
