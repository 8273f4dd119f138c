"""The inputs of the agent's three encoders: the recognition so far, the present joints, the position (Sec. 4.1).

The inputs need only one frame and a running sum, so an agent streams: nothing of the past is computed again. In a
stream the sum fades, so an agent is the same after minutes as after seconds.
"""

from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray
from ehar.envs.observations import Observations, scaled_velocity, shown_to_agent
from ehar.obstacles.free_ways import WAYS
from ehar.planner import Context, Observation

RECOGNITION, VISION, POSITION = "recognition", "vision", "position"
ENCODED = (RECOGNITION, VISION, POSITION)  # f^A, f^V and f^P
EMBEDDING, LOG_PROBS, TIME = "embedding", "log-probs", "time"  # the parts of what f^A takes
LEFT_OUT = (*ENCODED, EMBEDDING, LOG_PROBS, TIME)  # each can be left out: a whole encoder, or one part of f^A's inputs
LEAST_LOG_PROB = -8.0  # smaller log-probabilities say nothing more
AT_REST = 4  # numbers of a viewpoint
PLACED = ("viewpoint", "velocity", "distances")  # the observations that f^P takes, as far as there are any
MEMORY = 2.0  # [s] that an embedding counts for in the mean over those of a stream

Inputs = dict[str, FloatArray]


@dataclass(frozen=True)
class InputSizes:
    """The number of inputs of each encoder.

    Args:
        recognition: 2 D + K + 1: embedding, its mean over the frames so far, log-probabilities, observation ratio. In
            streams 2 D + K, with no activity among the K: nobody knows the ratio.
        vision: P (3 J + 4): a person's joints, their confidence, the person's place and size, the share of seen joints.
        position: 4, the azimuth as sine and cosine; 3 more of an agent that was trained in flight, the velocity; 6 more
            of one that was trained where something stands, how far it may go each way.
    """

    recognition: int
    vision: int
    position: int = AT_REST

    @staticmethod
    def of(
        *,
        persons: int,
        joints: int,
        classes: int,
        embedding: int,
        streams: bool = False,
        flown: bool = False,
        distances: bool = False,
    ) -> "InputSizes":
        """Return the sizes for P persons of J joints, K classes and embeddings of D numbers.

        Args:
            persons: P.
            joints: J.
            classes: K.
            embedding: D.
            streams: whether they are of streams.
            flown: whether the agent sees its velocity.
            distances: whether it sees how far it may go.
        """
        return InputSizes(
            recognition=2 * embedding + classes + (not streams),
            vision=persons * (3 * joints + 4),
            position=AT_REST + 3 * flown + WAYS * distances,
        )

    @property
    def flown(self) -> bool:
        """Whether the agent sees its velocity."""
        return (self.position - AT_REST) % WAYS > 0

    @property
    def distances(self) -> bool:
        """Whether the agent sees how far it may go."""
        return self.position - AT_REST >= WAYS


def recognition_parts(size: int, classes: int, *, streams: bool = False) -> dict[str, slice]:
    """Return the columns of each part of f^A's inputs: embeddings, last and mean; log-probabilities; time.

    Args:
        size: 2 D + K + 1, in streams 2 D + K.
        classes: K.
        streams: whether they are of streams, where no column tells the time.
    """
    embeddings = size - classes - (not streams)
    return {
        EMBEDDING: slice(0, embeddings),
        LOG_PROBS: slice(embeddings, embeddings + classes),
        TIME: slice(embeddings + classes, size),
    }


class AgentInputs:
    """Turns the observations of each frame into inputs of the encoders, for B episodes in lockstep.

    f^A is a function of all embeddings so far, e_0 to e_t. Its inputs are the last embedding, which is itself pooled
    over time, and the running mean. Their difference shows what is new. In a stream late embeddings count more in the
    mean: each loses its weight with a time constant of `MEMORY`.

    Args:
        frame_time: duration of a frame of a stream [s]; None in clips, where all embeddings count the same.
    """

    def __init__(self, frame_time: float | None = None) -> None:
        """Create an empty memory."""
        self._kept = 1.0 if frame_time is None else float(np.exp(-frame_time / MEMORY))
        self._total: FloatArray | None = None
        self._weight = 0.0

    @staticmethod
    def of(context: Context) -> "AgentInputs":
        """Return an empty memory for episodes of clips or of streams."""
        return AgentInputs(context.frame_time if context.length is None else None)

    def see(self, shown: Observations) -> Inputs:
        """Return the inputs after one more frame, each (B, size) in float32.

        Args:
            shown: the observations of that frame, as `ehar.envs.observations.shown` returns them; in flight with the
                velocity.
        """
        embedding = shown["embedding"].astype(np.float64)
        self._total = embedding if self._total is None else self._kept * self._total + embedding
        self._weight = self._kept * self._weight + 1
        log_probs = np.maximum(np.log(np.maximum(shown["probabilities"], 1e-12)), LEAST_LOG_PROB)
        when = [shown["ratio"]] if "ratio" in shown else []
        recognition = [embedding, self._total / self._weight, log_probs, *when]
        return {
            RECOGNITION: np.concatenate(recognition, axis=1).astype(np.float32),
            VISION: _bodies(shown["joints"], shown["confidence"]),
            POSITION: np.concatenate([shown[name] for name in PLACED if name in shown], axis=1),
        }


def seen_by_agent(observation: Observation, context: Context, *, flown: bool, distances: bool) -> Observations:
    """Return what an agent is shown of a frame.

    Args:
        observation: what planners are told.
        context: the conditions.
        flown: whether it was trained in flight, and sees its velocity.
        distances: whether it was trained where something stands, and sees how far it may go; in an open world anywhere.
    """
    shown = shown_to_agent(observation, context)
    free = shown.pop("distances", np.ones((len(observation.viewpoint), WAYS), dtype=np.float32))
    if distances:
        shown["distances"] = free
    if not flown:
        return shown
    if context.vehicle is None:
        return shown | {"velocity": np.zeros(observation.velocity.shape, dtype=np.float32)}
    return shown | {"velocity": scaled_velocity(observation.velocity, context.vehicle, context.workspace)}


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
