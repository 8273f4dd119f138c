"""The contract of a streaming recogniser: one frame in, class probabilities and an embedding out."""

from typing import Any, NamedTuple, Protocol

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.sensors.sensor import Sensed

NORMALISED = 1e-3  # largest distance from 1 of the sum of the probabilities in a frame


class Recognition(NamedTuple):
    """The answer of a recogniser after the frames seen so far."""

    log_probs: FloatArray  # (B, K), calibrated; (B, F, K) from a forked state
    embedding: FloatArray  # (B, D); (B, F, D) from a forked state


class RecogniserState(Protocol):
    """All that a recogniser remembers of B episodes. It is never changed in place, so forks share their common part."""

    def fork(self, forks: int) -> Any:
        """Return a state with F alternatives per episode: `step` then takes and returns arrays (B, F, ...)."""

    def select(self, choice: IntArray) -> Any:
        """Return the unforked state of alternative `choice` (B,) of each episode."""

    def reset(self, mask: BoolArray) -> Any:
        """Return a state in which the episodes of `mask` (B,) have seen nothing yet."""


class Recogniser(Protocol):
    """Recognises activities frame by frame; `step` costs the same at every frame.

    It may have a method `fingerprint()` that returns a hash of its weights as they are now, as bytes. Then a rollout
    notices if a planner wrote into them.
    """

    class_names: tuple[str, ...]
    embedding_size: int

    def start(self, episodes: int) -> Any:
        """Return the state of B episodes that have seen nothing."""

    def step(self, state: Any, sensed: Sensed, viewpoint: FloatArray) -> tuple[Recognition, Any]:
        """See one more frame.

        Args:
            state: the state before the frame; it stays valid.
            sensed: joints_2d (B, P, J, 2) [px] and confidence (B, P, J); (B, F, ...) for a forked state.
            viewpoint: (B, 3), where the camera was; (B, F, 3) for a forked state.

        Returns:
            the recognition after this frame, and the state after it.
        """
        ...


def total_probability(log_probs: FloatArray) -> FloatArray:
    """Return the sum of the probabilities of each row, (...), whose logarithms are (..., K); it should be 1."""
    with np.errstate(over="ignore"):  # what is beyond a float is infinite, and so no probability
        total: FloatArray = np.exp(np.logaddexp.reduce(log_probs, axis=-1))
    return total
