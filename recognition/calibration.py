"""Temperature scaling that depends on the observation ratio (Guo et al. 2017), one temperature for each knot."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import log_softmax

from ehar.arrays import FloatArray, IntArray

KNOTS = (0.0, 0.25, 0.5, 0.75, 1.0)  # observation ratios between which the log-temperature is interpolated
SMOOTHNESS = 1e-2  # keeps neighbouring knots together where validation data is scarce [nats]


@dataclass(frozen=True)
class Temperature:
    """Divides logits by a temperature, so that probabilities are calibrated early and late in an episode.

    Args:
        log_temperatures: one log-temperature for each of `KNOTS`.
    """

    log_temperatures: tuple[float, ...] = (0.0,) * len(KNOTS)

    def __post_init__(self) -> None:
        """Raise ValueError unless there is one finite number for each knot."""
        if len(self.log_temperatures) != len(KNOTS) or not np.isfinite(self.log_temperatures).all():
            raise ValueError(f"log_temperatures: expected {len(KNOTS)} finite numbers, got {self.log_temperatures}")

    def at(self, ratio: FloatArray) -> FloatArray:
        """Return the temperatures at observation ratios; a ratio above 1 counts as 1."""
        return np.exp(np.interp(ratio, KNOTS, self.log_temperatures))


def fit_temperature(logits: FloatArray, labels: IntArray, weights: FloatArray | None = None) -> Temperature:
    """Return the temperature that minimises the NLL over all frames, and a little how it changes from knot to knot.

    Args:
        logits: (N, L, K), the logits of validation clips after every frame.
        labels: (N,), the true classes; of streams (N, L), for each frame its own.
        weights: (K,) how much a frame of each class counts; None means all alike.
    """
    length = logits.shape[1]
    true = np.broadcast_to(labels.reshape(len(labels), -1, 1), (*logits.shape[:2], 1))
    ratio = np.arange(1, length + 1) / length
    wide = logits.astype(np.float64)
    counts = None if weights is None else weights[true]

    def loss(log_temperatures: FloatArray) -> float:
        temperature = np.exp(np.interp(ratio, KNOTS, log_temperatures))
        log_probs = log_softmax(wide / temperature[:, None], axis=-1)
        nll = -np.average(np.take_along_axis(log_probs, true, axis=-1), weights=counts)
        return float(nll + SMOOTHNESS * np.square(np.diff(log_temperatures)).sum())

    fitted = minimize(loss, np.zeros(len(KNOTS)), method="L-BFGS-B", bounds=[(-3.0, 4.0)] * len(KNOTS))
    return Temperature(tuple(float(value) for value in fitted.x))
