"""The inputs of the agent's three encoders: the recognition so far, the present joints, the position (Sec. 4.1).

The inputs need only one frame and a running sum, so an agent streams: nothing of the past is computed again.
"""

from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray
from ehar.envs.observations import Observations

RECOGNITION, VISION, POSITION = "recognition", "vision", "position"
ENCODED = (RECOGNITION, VISION, POSITION)  # f^A, f^V and f^P
EMBEDDING, LOG_PROBS, TIME = "embedding", "log-probs", "time"  # the parts of what f^A takes
LEFT_OUT = (*ENCODED, EMBEDDING, LOG_PROBS, TIME)  # each can be left out: a whole encoder, or one part of f^A's inputs
LEAST_LOG_PROB = -8.0  # smaller log-probabilities say nothing more

Inputs = dict[str, FloatArray]


@dataclass(frozen=True)
class InputSizes:
    """The number of inputs of each encoder.

    Args:
        recognition: 2 D + K + 1: embedding, its mean over the frames so far, log-probabilities, observation ratio.
        vision: P (3 J + 4): a person's joints, their confidence, the person's place and size, the share of seen joints.
        position: 4, the azimuth as sine and cosine.
    """

    recognition: int
    vision: int
    position: int = 4

    @staticmethod
    def of(*, persons: int, joints: int, classes: int, embedding: int) -> "InputSizes":
        """Return the sizes for P persons of J joints, K classes and embeddings of D numbers."""
        return InputSizes(recognition=2 * embedding + classes + 1, vision=persons * (3 * joints + 4))


def recognition_parts(size: int, classes: int) -> dict[str, slice]:
    """Return the columns of each part of f^A's inputs: embeddings, last and mean; log-probabilities; time.

    Args:
        size: 2 D + K + 1.
        classes: K.
    """
    embeddings = size - classes - 1
    return {
        EMBEDDING: slice(0, embeddings),
        LOG_PROBS: slice(embeddings, embeddings + classes),
        TIME: slice(embeddings + classes, size),
    }


class AgentInputs:
    """Turns the observations of each frame into inputs of the encoders, for B episodes in lockstep.

    f^A is a function of all embeddings so far, e_0 to e_t. Its inputs are the last embedding, which is itself pooled
    over time, and the running mean. Their difference shows what is new.
    """

    def __init__(self) -> None:
        """Create an empty memory."""
        self._total: FloatArray | None = None
        self._frames = 0

    def see(self, shown: Observations) -> Inputs:
        """Return the inputs after one more frame, each (B, size) in float32.

        Args:
            shown: the observations of that frame, as `ehar.envs.observations.shown` returns them.
        """
        embedding = shown["embedding"].astype(np.float64)
        self._total = embedding if self._total is None else self._total + embedding
        self._frames += 1
        log_probs = np.maximum(np.log(np.maximum(shown["probabilities"], 1e-12)), LEAST_LOG_PROB)
        recognition = [embedding, self._total / self._frames, log_probs, shown["ratio"]]
        return {
            RECOGNITION: np.concatenate(recognition, axis=1).astype(np.float32),
            VISION: _bodies(shown["joints"], shown["confidence"]),
            POSITION: shown["viewpoint"],
        }


def _bodies(joints: FloatArray, confidence: FloatArray) -> FloatArray:
    """Return each person's shape without place and size, then confidence, place, size and share of seen joints.

    Args:
        joints: (B, P, J, 2).
        confidence: (B, P, J), 0 where a joint is missing.
    """
    seen = (confidence > 0)[..., None]
    count = np.maximum(seen.sum(axis=2, keepdims=True), 1)
    place = (joints * seen).sum(axis=2, keepdims=True) / count
    within = (joints - place) * seen
    size = np.sqrt((within**2).sum(axis=(2, 3), keepdims=True) / count) + 1e-3
    episodes = len(joints)
    pieces = [within / size, confidence, place, np.log(size), seen.mean(axis=2)]
    return np.concatenate([piece.reshape(episodes, -1) for piece in pieces], axis=1).astype(np.float32)
