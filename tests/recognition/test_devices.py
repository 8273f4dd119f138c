"""Devices: all tensors of a recogniser lie on its own, and one that is missing ends in one line.

There is no GPU here. Tensors on torch's device `meta` have shapes without numbers. That is enough to see that no step
mixes devices, reads a number back from its own, or makes a tensor elsewhere.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

from ehar.camera import Camera
from ehar.errors import UsageError
from ehar.sensors.estimator import EstimatorSensor
from ehar.sensors.sensor import draw_noise
from ehar.world import PAPER
from recognition.devices import check_device
from recognition.networks.causal import CausalCTRGCN
from recognition.networks.features import features, with_view
from recognition.networks.spec import NetworkSpec
from recognition.networks.stepper import CausalStepper
from tests.helpers.fakes import tiny_data

GPU = torch.device("meta")
EPISODES, PERSONS, FORKS = 2, 2, 3
SPEC = NetworkSpec.of(tiny_data(persons=PERSONS), form="causal", size="small", length=8)
JOINTS = len(SPEC.skeleton.joint_names)


class OneDevice(TorchDispatchMode):
    """Raises an error if an operation takes tensors of two devices and is not there to copy one to the other."""

    def __torch_dispatch__(
        self, func: Any, types: Any, args: tuple[Any, ...] = (), kwargs: Mapping[str, Any] | None = None
    ) -> Any:
        """Look at what an operation takes; a number that was made a tensor may lie anywhere."""
        told = tree_leaves((args, dict(kwargs or {})))
        devices = {tensor.device.type for tensor in told if isinstance(tensor, Tensor) and tensor.dim() > 0}
        if len(devices) > 1 and "copy" not in str(func):
            raise AssertionError(f"{func} mixes {devices}")
        return func(*args, **(kwargs or {}))


def moved(network: nn.Module) -> nn.Module:
    """Move what `Module.to` moves, parameters and buffers; their numbers are lost."""
    for module in network.modules():
        for held in (module._parameters, module._buffers):
            for name, tensor in held.items():
                if tensor is not None:
                    fake = torch.empty(tensor.shape, dtype=tensor.dtype, device=GPU)
                    held[name] = nn.Parameter(fake, requires_grad=tensor.requires_grad)  # type: ignore[assignment]
    return network


def seen(*leading: int) -> Tensor:
    """Return features (..., P, J, C), made on the device."""
    joints_2d = torch.empty(*leading, PERSONS, JOINTS, 2, device=GPU)
    viewpoint = torch.empty(*leading, 3, device=GPU)
    parents = torch.empty(JOINTS, dtype=torch.int64, device=GPU)
    return with_view(features(joints_2d, joints_2d[..., 0], viewpoint[..., 0], parents, Camera()), viewpoint)


def built() -> CausalCTRGCN:
    network = SPEC.build()
    assert isinstance(network, CausalCTRGCN)
    return network


def test_steps_forks_and_resets_stay_on_the_device() -> None:
    stepper = CausalStepper(built().eval())
    with torch.inference_mode(), OneDevice():
        moved(stepper)
        state = stepper.start(EPISODES, PERSONS)
        for _ in range(3):
            logits, embedding, state = stepper.step(seen(EPISODES, 1), state)
        state = state.reset(torch.tensor([True, False]))
        for _ in range(2):  # the refreshes of the two episodes fall on different frames now
            logits, embedding, state = stepper.step(seen(EPISODES, 1), state)
        logits, embedding, forked = stepper.step(seen(EPISODES, FORKS), state.fork(FORKS))
        after = forked.select(torch.tensor([1, 0]))
        assert {logits.device, embedding.device, after.pooled.device} == {GPU}
        for block in after.blocks:
            assert {block.graph.total.device, block.graph.topology.device, *(h.device for h in block.history)} == {GPU}


def test_the_estimator_stays_on_the_device(monkeypatch: pytest.MonkeyPatch) -> None:
    copied: list[torch.device] = []

    def copy(tensor: Tensor) -> Tensor:
        copied.append(tensor.device)
        return torch.zeros(tensor.shape)

    monkeypatch.setattr(Tensor, "cpu", copy)  # what has no numbers can't be copied
    sensor = EstimatorSensor(skeleton=SPEC.skeleton, device=str(GPU))
    positions = np.zeros((EPISODES, PERSONS, JOINTS, 3), dtype=np.float32)
    noise = draw_noise(np.random.default_rng(0), (EPISODES,), PERSONS, JOINTS)
    with OneDevice():
        sensed = sensor.sense(positions, PAPER.sample_starts(np.random.default_rng(0), EPISODES), noise)
    assert copied == [GPU, GPU]
    assert sensed.confidence.shape == (EPISODES, PERSONS, JOINTS)


def test_a_tensor_that_was_left_behind_is_found() -> None:
    # Guards the test above: it would pass if mixed devices were no error.
    stepper = CausalStepper(built().eval())
    with torch.inference_mode(), OneDevice():
        moved(stepper)
        stepper.classify.weight = nn.Parameter(torch.empty(stepper.classify.weight.shape, device="cpu"))
        with pytest.raises((AssertionError, RuntimeError), match=r"mixes|device"):
            stepper.step(seen(EPISODES, 1), stepper.start(EPISODES, PERSONS))


def test_a_training_step_stays_on_the_device() -> None:
    network = built().train()
    with OneDevice():
        moved(network)
        logits = network(torch.empty(seen(EPISODES, 8).shape, device=GPU))
        loss = nn.functional.cross_entropy(logits.flatten(0, 1), torch.zeros(16, dtype=torch.int64, device=GPU))
        loss.backward()  # type: ignore[no-untyped-call]
        learned = [p for p in network.parameters() if p.requires_grad]
        assert all(p.grad is not None and p.grad.device == GPU for p in learned)


@pytest.mark.parametrize("device", ["tpu", "cuda:", "cuda:one", "", "cuda:99"])
def test_a_device_that_there_is_not_ends_in_one_line(device: str) -> None:
    with pytest.raises(UsageError, match=r"^--device .*expected [^\n]*$"):
        check_device(device)


def test_the_cpu_is_always_there() -> None:
    check_device("cpu")


def test_a_gpu_is_missing_or_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    check_device("cuda")
    check_device("cuda:0")
    with pytest.raises(UsageError, match=r"torch finds 1$"):
        check_device("cuda:1")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(UsageError, match=r"torch finds none$"):
        check_device("cuda")
