"""The optimiser of a recogniser's training: AdamW, or stochastic gradient descent as CTR-GCN was published with."""

import torch

from recognition.training.config import Optimiser

# CTR-GCN, Sec. 4.2 ("Implementation Details"), and the configuration of its public implementation for NTU RGB+D.
PUBLISHED_RATE = 0.1
PUBLISHED_MOMENTUM = 0.9  # Nesterov's
PUBLISHED_DECAY = 4e-4
PUBLISHED_EPOCHS = 65  # of which the first warm up
PUBLISHED_WARM_UP = 5  # epochs
PUBLISHED_DROPS = (35, 55)  # epochs from which the rate is a tenth of what it was


def make_optimiser(
    network: torch.nn.Module, optimiser: Optimiser, *, learning_rate: float, weight_decay: float
) -> torch.optim.Optimizer:
    """Return the optimiser of a network; the published one has its own rate and decay."""
    if optimiser == "published":
        return torch.optim.SGD(
            network.parameters(),
            lr=PUBLISHED_RATE,
            momentum=PUBLISHED_MOMENTUM,
            weight_decay=PUBLISHED_DECAY,
            nesterov=True,
        )
    return torch.optim.AdamW(network.parameters(), lr=learning_rate, weight_decay=weight_decay)


def published_rate(progress: float) -> float:
    """Return the published learning rate after a share of the training, 0 to 1.

    It rises over the first 5 of 65 epochs, epoch by epoch, and falls to a tenth at epochs 35 and 55. An epoch is a 65th
    of the clips here: they are drawn anew, so there is no pass over all of them.
    """
    epoch = int(progress * PUBLISHED_EPOCHS + 1e-9)
    if epoch < PUBLISHED_WARM_UP:
        return PUBLISHED_RATE * (epoch + 1) / PUBLISHED_WARM_UP
    return PUBLISHED_RATE * 0.1 ** sum(epoch >= drop for drop in PUBLISHED_DROPS)
