"""What is believed after every frame of recorded rollouts, of clips or of streams."""

import numpy as np

from ehar.arrays import FloatArray
from planners.value.belief.clips import BeliefModel, readout
from planners.value.belief.filters import read_streams
from planners.value.belief.streams import StreamBeliefModel

LEAST_PROBABILITY = 1e-12  # of a class that is read out; its logarithm is finite


def read_belief(
    model: BeliefModel | StreamBeliefModel, log_probs: FloatArray, viewpoints: FloatArray, *, fps: float
) -> FloatArray:
    """Return the believed log-probabilities after every frame of recorded rollouts, of clips or of streams.

    Args:
        model: the parameters.
        log_probs: (B, L, K), the recogniser's log-probabilities after every frame.
        viewpoints: (B, L, 3).
        fps: frames per second.
    """
    if isinstance(model, BeliefModel):
        return readout(model, log_probs, viewpoints)
    believed: FloatArray = np.log(np.maximum(read_streams(model, log_probs, viewpoints, fps=fps), LEAST_PROBABILITY))
    return believed
