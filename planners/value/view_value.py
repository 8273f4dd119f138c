"""The value of viewpoints at the present frame, from the tracked situation and the gain field."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import UsageError
from ehar.planner import Context, Observation
from planners.value.model import FULL, GainModel
from planners.value.situation import Situation, Tracker, coming_gains
from planners.value.view_basis import DistanceRange


class ViewValue:
    """Tracks B episodes, and gives the value of views.

    Args:
        model: the trained model.
        variant: name of one of its fields; all but `full` are for ablations.

    Attributes:
        field: the gain field.
        span: the range of distances of the world, after a reset.

    Raises:
        UsageError: the model has no such field.
    """

    def __init__(self, model: GainModel, *, variant: str = FULL) -> None:
        """Create the valuation; `reset` it before the first frame."""
        if variant not in model.fields:
            raise UsageError(f"unknown gain field {variant!r}; expected one of: {', '.join(model.fields)}")
        self.field = model.fields[variant]
        self._tracker = Tracker(belief=model.belief, pairs=model.pairs, memory=model.memory)
        self._memory = model.memory

    def reset(self, context: Context) -> None:
        """Forget everything."""
        self.span = DistanceRange.of(context.world.workspace)
        self._tracker.reset(context)

    def update(self, observation: Observation) -> None:
        """Take in one more frame."""
        self._tracker.update(observation)

    @property
    def gains(self) -> FloatArray:
        """The weight of the view in each frame to come, (R,); the weights sum to 1."""
        return coming_gains(self._tracker.observation, self._tracker.context, self._memory)

    @property
    def situation(self) -> Situation:
        """The situation after the last frame."""
        return self._tracker.situation

    @property
    def weights(self) -> FloatArray:
        """The field's weights, (B, 21), see `view_basis.field_value`."""
        return self.field.weights(self.situation)


def node_gains(gains: FloatArray, nodes: int, node_frames: int) -> FloatArray:
    """Return the weight of the view at each node, (nodes,): the sum of the frames' weights (R,) over the node's frames.

    The weights sum to 1. Node h stands for the `node_frames` frames up to its own. The last node also stands for all
    frames after it. Nodes after the end of the episode have weight 0, so the horizon may outlast the episode.
    """
    node = np.minimum(np.arange(len(gains)) // node_frames, nodes - 1)
    weights: FloatArray = np.zeros(nodes)
    np.add.at(weights, node, gains)
    return weights
