"""What each viewpoint is worth at the present frame: the situation, tracked, and the gain field that fits it."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import UsageError
from ehar.planner import Context, Observation
from planners.value.model import FULL, GainModel
from planners.value.situation import Situation, Tracker, frame_gains


class ViewValue:
    """Follows B episodes and says what views are worth.

    Args:
        model: trained.
        variant: which of its fields; all but `full` are for ablations.

    Raises:
        UsageError: the model has no such field.
    """

    def __init__(self, model: GainModel, *, variant: str = FULL) -> None:
        """Create the valuation; `reset` it before the first frame."""
        if variant not in model.fields:
            raise UsageError(f"unknown gain field {variant!r}; expected one of: {', '.join(model.fields)}")
        self.field = model.fields[variant]
        self._tracker = Tracker(belief=model.belief, pairs=model.pairs)

    def reset(self, context: Context) -> None:
        """Forget everything."""
        self._tracker.reset(context)

    def update(self, observation: Observation) -> None:
        """Take in one more frame."""
        self._tracker.update(observation)

    @property
    def situation(self) -> Situation:
        """What is known after the last frame."""
        return self._tracker.situation

    @property
    def weights(self) -> FloatArray:
        """The field's weights, (B, 21), see `view_basis.field_value`."""
        return self.field.weights(self.situation)


def node_gains(frame: int, length: int, nodes: int, node_frames: int) -> FloatArray:
    """Return how much the view at each node weighs, (nodes,), summing to 1: `frame_gains` of the frames it stands for.

    Node h stands for the `node_frames` frames up to its own, the last one for all that follow too. Nodes beyond the
    end of the episode weigh nothing, so that a horizon may be longer than what is left.
    """
    gains = frame_gains(frame, length)
    node = np.minimum(np.arange(len(gains)) // node_frames, nodes - 1)
    weights: FloatArray = np.zeros(nodes)
    np.add.at(weights, node, gains)
    return weights
