"""Imitation learning: behaviour cloning of demonstrations (Sec. 4.2), from best moves or from the worth of all 7."""

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from ehar.errors import ModelError
from planners.agents.config import ImitationSetting
from planners.agents.demonstrations import Demonstrations
from planners.agents.network import AgentNetwork
from planners.agents.validation import stopped_getting_better
from recognition.torch_threads import one_torch_thread


@one_torch_thread()
def clone(
    network: AgentNetwork,
    demonstrations: Demonstrations,
    setting: ImitationSetting,
    *,
    seed: int,
    held_out: Demonstrations | None = None,
) -> list[dict[str, float]]:
    r"""Train a network's policy on demonstrations, in place; the critic is left as it is.

    Training ends when the loss on held-out demonstrations has stopped getting smaller; the best weights are kept.

    With best moves, the loss is the standard cross-entropy. With soft labels, it is the expected loss of the policy
    :math:`\pi`, :math:`-\sum_a \pi(a | s) (v_a - \bar{v}) / \sigma - \eta H(\pi)`. Here v are the values of moves a,
    :math:`\sigma` is their standard deviation over all demonstrations, and :math:`\eta` is the weight of the entropy H.
    Where the moves differ little, the choice of a teacher who knows the label is arbitrary. This loss therefore weighs
    a frame by how much its moves differ. Its minimum is the softmax of the expected values. So the agent averages over
    what only the teacher knows, and does not imitate it.

    Args:
        network: the network, trained in place.
        demonstrations: N frames.
        setting: the settings of imitation.
        seed: seed of the order of the frames.
        held_out: demonstrations of other people; None trains for all epochs.

    Returns:
        the mean loss of each epoch, how often the policy's best move is the teacher's, and the loss on `held_out`.

    Raises:
        ModelError: a demonstration or the loss is not finite; the message names the step.
    """
    judged = _Judged(demonstrations)
    values, best = judged.values, judged.best
    unseen = None if held_out is None else _Judged(held_out, scale=judged.scale)
    kept: dict[str, Tensor] = {}
    weights = [weight for name, weight in network.named_parameters() if not name.startswith("critic.")]
    optimiser = torch.optim.AdamW(weights, lr=setting.learning_rate)
    order = np.random.default_rng(seed)
    network.train()
    per_epoch = max(1, len(values) // setting.batch)
    history = []
    for epoch in range(setting.epochs):
        frames = torch.from_numpy(order.permutation(len(values)))
        losses, agreed = [], []
        for i, rows in enumerate(frames.tensor_split(per_epoch)):
            step = epoch * per_epoch + i
            for group in optimiser.param_groups:
                group["lr"] = setting.learning_rate * (1 - step / (setting.epochs * per_epoch))
            logits, loss = judged.loss(network, rows, setting)
            if not bool(values[rows].isfinite().all()):  # argmax would pick the NaN
                raise ModelError(f"imitation: expected finite values of moves, got NaN or infinity at step {step}")
            if not bool(loss.isfinite()):
                raise ModelError(f"imitation: the loss is {float(loss.detach())} at step {step}: expected a finite one")
            optimiser.zero_grad(set_to_none=True)
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            losses.append(float(loss.detach()))
            agreed.append(float((logits.argmax(dim=1) == best[rows]).float().mean()))
        history.append({"loss": float(np.mean(losses)), "agreement": float(np.mean(agreed))})
        if unseen is not None:
            validation = unseen.mean_loss(network, setting)
            if validation < min((past["validation_loss"] for past in history[:-1]), default=float("inf")):
                kept = {name: weight.detach().clone() for name, weight in network.state_dict().items()}
            history[-1]["validation_loss"] = validation
            if stopped_getting_better([-past["validation_loss"] for past in history], setting.patience):
                break
    if kept:
        network.load_state_dict(kept)
    network.eval()
    return history


class _Judged:
    """Demonstrations as tensors, with what a policy loses on them.

    Args:
        demonstrations: N frames; they stay in half precision until they are needed.
        scale: the standard deviation that advantages are divided by; None takes that of these demonstrations.
    """

    def __init__(self, demonstrations: Demonstrations, scale: Tensor | None = None) -> None:
        self._inputs = {name: torch.from_numpy(values) for name, values in demonstrations.inputs.items()}
        self.values = torch.from_numpy(demonstrations.values).float()
        self.best = self.values.argmax(dim=1)
        advantage = self.values - self.values.mean(dim=1, keepdim=True)
        self.scale = advantage.std().clamp(min=1e-9) if scale is None else scale
        self._advantage = advantage / self.scale

    def loss(self, network: AgentNetwork, rows: Tensor | slice, setting: ImitationSetting) -> tuple[Tensor, Tensor]:
        """Return logits (B, 7) for some frames, and the mean loss."""
        logits = network.logits(network.state({name: seen[rows].float() for name, seen in self._inputs.items()}))
        if setting.labels == "best":
            return logits, functional.cross_entropy(logits, self.best[rows])
        return logits, expected_loss(logits, self._advantage[rows], setting.entropy)

    def mean_loss(self, network: AgentNetwork, setting: ImitationSetting) -> float:
        """Return the mean loss over all frames."""
        with torch.no_grad():
            return float(self.loss(network, slice(None), setting)[1])


def expected_loss(logits: Tensor, advantage: Tensor, entropy: float) -> Tensor:
    """Return the expected loss of a policy with logits (B, 7) for advantages (B, 7), less its weighted entropy."""
    log_policy = torch.log_softmax(logits, dim=1)
    loss: Tensor = (log_policy.exp() * (entropy * log_policy - advantage)).sum(dim=1).mean()
    return loss
