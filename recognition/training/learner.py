"""A network that learns: steps on clips, and a running average of its weights, which is what counts."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from ehar.arrays import FloatArray
from recognition.networks.causal import CausalCTRGCN
from recognition.networks.spec import Network
from recognition.training.arithmetic import quick_products
from recognition.training.averages import late_average
from recognition.training.clips import Clips
from recognition.training.config import Optimiser
from recognition.training.frame_weights import late_cross_entropy
from recognition.training.optimisers import make_optimiser, published_rate
from recognition.training.recorded_step import RecordedStep

WARM_UP = 150  # steps in which the learning rate rises; then it stays
GRADIENT_NORM = 1.0  # gradients are clipped to this norm
PREFIXES = 10  # on which the published form is validated, from the first frame to all: they are not cheap


class Learner:
    """A network in training.

    With AdamW the learning rate is constant after a short rise, and the weights that count are a running average over
    the steps, see `recognition.training.averages`. So no length has to be known beforehand. With the published
    optimiser the rate follows its schedule, and the weights count as the last step left them. With either,
    `recognition.training.trainer` keeps those of its best evaluation.

    Args:
        network: the network, on the device where it learns.
        optimiser: adamw or published.
        learning_rate: peak of the schedule (AdamW).
        weight_decay: weight decay of AdamW.
        batch: clips that are evaluated at once.
        class_weights: (K,) how much a frame of each class counts; None means all alike.
        smoothing: share of the probability that the loss spreads over all classes (Szegedy et al., CVPR 2016, Sec. 7).
        late: whether frames count in the loss by how many have been seen, see `late_cross_entropy`; of no meaning to
            the published form.
    """

    def __init__(
        self,
        network: Network,
        *,
        optimiser: Optimiser,
        learning_rate: float,
        weight_decay: float,
        batch: int,
        class_weights: FloatArray | None = None,
        smoothing: float = 0.0,
        late: bool = False,
    ) -> None:
        """Begin at the weights that the network has."""
        self.network = network
        self.device = next(network.parameters()).device
        self.average = late_average(network)
        self.optimiser = make_optimiser(network, optimiser, learning_rate=learning_rate, weight_decay=weight_decay)
        self._published, self._rate, self._batch = optimiser == "published", learning_rate, batch
        self._weights = None
        if class_weights is not None:
            self._weights = torch.from_numpy(class_weights.astype(np.float32)).to(self.device)
        self._smoothing = smoothing
        self._late = late and isinstance(network, CausalCTRGCN)
        self._recorded: RecordedStep | None = None  # on a GPU

    def learn(self, clips: Clips, rng: np.random.Generator, *, step: int, steps: int) -> float:
        """Make one step and return its loss; where that is not finite, the weights stay as they are.

        Args:
            clips: the batch.
            rng: draws what is random in the step, such as dropout.
            step: number of steps before this one.
            steps: number of steps of the whole training, which the published schedule follows.
        """
        rate = published_rate(step / steps) if self._published else self._rate * min(1.0, (step + 1) / WARM_UP)
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        self.network.train()
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(int(rng.integers(2**31)))  # dropout
            loss = self._find_gradients(clips, rng)
        if not np.isfinite(loss):
            return loss
        if not self._published:
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), GRADIENT_NORM)
        self.optimiser.step()
        self.average.update_parameters(self.network)
        return loss

    def _find_gradients(self, clips: Clips, rng: np.random.Generator) -> float:
        """Find the gradients of a batch and return its loss; for the published form, of one prefix of all its clips."""
        seen, labels = clips.features, clips.frame_labels
        if not isinstance(self.network, CausalCTRGCN):
            prefix = int(rng.integers(1, seen.shape[1] + 1))  # each length is a shape of its own
            return float(self._backward(seen[:, :prefix].to(self.device), clips.labels.to(self.device)))
        batch = seen.to(self.device), labels.to(self.device)
        if self.device.type == "cpu":
            return float(self._backward(*batch))
        if self._recorded is None:
            self._recorded = RecordedStep(self._backward, batch, self.device)
        self._recorded.make(*batch)
        return self._recorded.mean_loss()

    def _backward(self, seen: Tensor, labels: Tensor) -> Tensor:
        """Leave the gradients of a batch with the weights, and return its loss."""
        self.optimiser.zero_grad(set_to_none=True)
        loss = self._loss(seen, labels)
        loss.backward()  # type: ignore[no-untyped-call]
        return loss.detach()

    def _loss(self, seen: Tensor, labels: Tensor) -> Tensor:
        """Return the mean cross-entropy over clips and frames; for the published form, over clips (B, L, P, J, C)."""
        with quick_products(self.device):
            if isinstance(self.network, CausalCTRGCN):
                logits = self.network(seen).flatten(0, 1)
            else:
                logits = self.network(seen.permute(0, 4, 1, 3, 2))
        return self._cross_entropy(logits.float(), labels)

    def _cross_entropy(self, logits: Tensor, labels: Tensor) -> Tensor:
        """Return the mean cross-entropy of logits (B * L, K) against labels (B, L); for the published form (B,)."""
        if self._late:
            return late_cross_entropy(logits, labels, weight=self._weights, smoothing=self._smoothing)
        return functional.cross_entropy(logits, labels.flatten(), weight=self._weights, label_smoothing=self._smoothing)

    @property
    def averaged(self) -> Network:
        """The network with the weights that count now: with the published optimiser those of the last step so far."""
        network = self.network if self._published else self.average.module
        assert isinstance(network, Network)
        return network

    def logits(self, network: Network, features: Tensor) -> FloatArray:
        """Return logits (N, L, K) after every frame; for the published form, a frame takes those of the last prefix.

        So no frame knows more than it would know in an episode.

        Args:
            network: this network, with the weights that count or others.
            features: (N, L, P, J, C).
        """
        network.eval()
        pieces = []
        length = features.shape[1]
        with torch.inference_mode():
            for seen in torch.split(features, self._batch):
                batch = seen.to(self.device)
                if isinstance(network, CausalCTRGCN):
                    pieces.append(network(batch).cpu())
                else:
                    ends = np.unique(np.linspace(1, length, PREFIXES).round().astype(int))
                    known = [network(batch[:, :end].permute(0, 4, 1, 3, 2)).cpu() for end in ends]
                    last = np.searchsorted(ends, np.arange(1, length + 1), side="right") - 1
                    pieces.append(torch.stack([known[i] for i in last], 1))
        return torch.cat(pieces).numpy()

    def states(self) -> dict[str, Mapping[str, Tensor]]:
        """Return the weights, and their average."""
        return {"network": self.network.state_dict(), "average": self.average.state_dict()}

    def load(self, states: Mapping[str, Mapping[str, Tensor]], optimiser: dict[str, Any] | None) -> None:
        """Go on from what `states` returned, and from the optimiser's state_dict."""
        self.network.load_state_dict(states["network"])
        self.average.load_state_dict(states["average"])
        self.optimiser.load_state_dict(optimiser or {})
