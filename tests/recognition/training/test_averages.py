"""Averages of weights: what counts how much, on a GPU's way through torch too."""

from collections.abc import Callable

import pytest
import torch
from torch import nn
from torch.optim import swa_utils
from torch.optim.swa_utils import AveragedModel

from recognition.training.averages import equal_average, late_average

MOMENTS = 4


def moments(average: Callable[[nn.Module], AveragedModel]) -> tuple[nn.BatchNorm1d, list[torch.Tensor]]:
    """Return the average over moments of a norm that has taken in one batch before each, and its means there."""
    norm = nn.BatchNorm1d(3)
    averaged, means = average(norm), []
    for moment in range(MOMENTS):
        norm(torch.randn(8, 3, generator=torch.Generator().manual_seed(moment)) + moment)
        assert norm.running_mean is not None
        means.append(norm.running_mean.clone())
        averaged.update_parameters(norm)
    assert isinstance(averaged.module, nn.BatchNorm1d)
    return averaged.module, means


@pytest.fixture(params=["cpu", "as a gpu"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let torch average many tensors in one call, as it does on a GPU: its own mean of counters is an error there."""
    if request.param == "as a gpu":
        monkeypatch.setattr(swa_utils, "_get_foreach_kernels_supported_devices", lambda: ["cpu"])


@pytest.mark.usefixtures("way")
def test_all_moments_count_alike_and_counters_are_the_last() -> None:
    average, means = moments(equal_average)
    torch.testing.assert_close(average.running_mean, torch.stack(means).mean(dim=0))
    assert average.num_batches_tracked == MOMENTS


@pytest.mark.usefixtures("way")
def test_late_moments_count_more() -> None:
    average, means = moments(late_average)
    shares = [1.0, 9.0, 45.0, 165.0]  # (k + 1) (k + 2) ... (k + 8) / 8!
    expected = sum(share / sum(shares) * mean for share, mean in zip(shares, means, strict=True))
    torch.testing.assert_close(average.running_mean, expected)
    assert average.num_batches_tracked == MOMENTS


def test_torch_s_own_mean_of_counters_is_an_error_on_a_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    # Guards the tests above: they would pass if the way were not a GPU's.
    monkeypatch.setattr(swa_utils, "_get_foreach_kernels_supported_devices", lambda: ["cpu"])
    with pytest.raises(RuntimeError, match="Integer division"):
        moments(lambda norm: AveragedModel(norm, use_buffers=True))
