"""A learner with a second task: where joints are in the next frame."""

from typing import Any

import torch
from torch import Tensor, nn

from recognition.networks.causal import CausalCTRGCN
from recognition.networks.features import JOINT_CHANNELS
from recognition.training.learner import Learner

PLACE = 2  # the first features of a joint: where it is in the image, relative to the person [m]


class NextPoseLearner(Learner):
    """Learns classes, and from the same features of each joint where it is in the next frame, as InfoGCN++ does.

    The second head has no part in recognition.

    Args:
        network: the streaming network; the head is put into it.
        weight: weight of the mean squared error [1 / m^2], over joints that the next frame shows.
        settings: of the `Learner`.
    """

    def __init__(self, network: CausalCTRGCN, *, weight: float, **settings: Any) -> None:
        """Add the head to the network, so that its weights are learned too."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(0)
            network.foretell = nn.Conv2d(network.embedding_size, PLACE, 1).to(next(network.parameters()).device)
        super().__init__(network, **settings)
        self._weight = weight
        self._head = network.foretell
        # Registered after the average was copied, so only the network that learns keeps its last block's features.
        network.blocks[-1].register_forward_hook(self._keep)

    def _keep(self, block: nn.Module, inputs: tuple[Tensor, ...], features: Tensor) -> None:
        self._features = features

    def _loss(self, seen: Tensor, labels: Tensor) -> Tensor:
        """Return the usual loss, and that of the next pose."""
        loss = super()._loss(seen, labels)
        batch, frames, persons, joints, _ = seen.shape
        foretold = self._head(self._features.float()).view(batch, persons, PLACE, joints, frames)
        true = seen[..., :PLACE].permute(0, 2, 4, 3, 1)
        shown = (seen[..., JOINT_CHANNELS - 1] > 0).permute(0, 2, 3, 1)[:, :, None, :, 1:]
        squared: Tensor = (foretold[..., :-1] - true[..., 1:]).square() * shown
        error = squared.sum() / shown.expand_as(squared).sum().clamp(min=1)
        return loss + self._weight * error
