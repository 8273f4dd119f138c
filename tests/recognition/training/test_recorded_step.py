"""A recorded step on a GPU does what the step does; where there is no GPU this is skipped."""

import pytest
import torch

from recognition.training.recorded_step import FIRST_STEPS, RecordedStep

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no GPU here")


def test_recorded_steps_learn_like_steps_one_by_one() -> None:
    gpu = torch.device("cuda")
    torch.manual_seed(0)
    network = torch.nn.Sequential(torch.nn.Linear(4, 8), torch.nn.ReLU(), torch.nn.Linear(8, 3)).to(gpu)
    other = torch.nn.Sequential(torch.nn.Linear(4, 8), torch.nn.ReLU(), torch.nn.Linear(8, 3)).to(gpu)
    other.load_state_dict(network.state_dict())

    def learner(learning: torch.nn.Module) -> tuple[torch.optim.Optimizer, object]:
        optimiser = torch.optim.SGD(learning.parameters(), lr=0.1, momentum=0.9, nesterov=True)

        def step(x: torch.Tensor, labels: torch.Tensor) -> torch.Tensor:
            optimiser.zero_grad(set_to_none=True)
            loss = torch.nn.functional.cross_entropy(learning(x), labels)
            loss.backward()
            optimiser.step()
            return loss.detach()

        return optimiser, step

    batches = [(torch.randn(5, 4, device=gpu), torch.randint(3, (5,), device=gpu)) for _ in range(4 * FIRST_STEPS)]
    (one, step), (two, recorded_step) = learner(network), learner(other)
    recorded = RecordedStep(recorded_step, batches[0], gpu)  # type: ignore[arg-type]
    for rate in (0.1, 0.01):
        for optimiser in (one, two):
            optimiser.param_groups[0]["lr"] = rate
        recorded.record_anew()
        losses = [float(step(*batch)) for batch in batches]  # type: ignore[operator]
        for batch in batches:
            recorded.make(*batch)
        assert recorded.mean_loss() == pytest.approx(sum(losses) / len(losses), rel=1e-5)
    for weight, same in zip(network.parameters(), other.parameters(), strict=True):
        torch.testing.assert_close(weight, same)
