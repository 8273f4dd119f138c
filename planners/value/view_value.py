"""The value of viewpoints at the present frame, from the tracked situation and the gain field."""

from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import UsageError
from ehar.planner import Context, Observation
from ehar.viewpoint import Workspace
from planners.heading import known_obstacles
from planners.value.line_of_sight import seen_share
from planners.value.model import FULL, GainModel
from planners.value.situation import Situation, Tracker, coming_gains
from planners.value.view_basis import BASIS_SIZE, DistanceRange, basis_at

GRID = (4, 16, 6)  # distances, azimuths, polar angles of a coarse grid over the workspace


class NodeValues(NamedTuple):
    """What views are worth at H nodes to come, in B episodes."""

    node_frames: int  # from one node to the next
    gains: FloatArray  # (H,) the weight of the view at each node, they sum to 1
    weights: FloatArray  # (B, H, 21) the field's weights for each


class ViewValue:
    """Tracks B episodes, and gives the value of views.

    Args:
        model: the trained model.
        variant: name of one of its fields; all but `full` are for ablations.

    Attributes:
        field: the gain field.
        span: the range of distances of the world, after a reset.
        obstacles: those whose place is known, after an update; relative to where the centre was in the first frame.
        meets_passers: whether cameras may meet passers-by, after a reset.

    Raises:
        UsageError: the model has no such field.
    """

    def __init__(self, model: GainModel, *, variant: str = FULL) -> None:
        """Create the valuation; `reset` it before the first frame."""
        if variant not in model.fields:
            raise UsageError(f"unknown gain field {variant!r}; expected one of: {', '.join(model.fields)}")
        self.field = model.fields[variant]
        self._tracker = Tracker(belief=model.belief, pairs=model.pairs, memory=model.memory, lookahead=model.lookahead)
        self._memory = model.memory

    def reset(self, context: Context) -> None:
        """Forget everything."""
        self.span = DistanceRange.of(context.world.workspace)
        self.meets_passers = context.world.meets_passers
        self._tracker.reset(context)
        self._everywhere = basis_at(coarse_grid(context.workspace), self.span)

    def update(self, observation: Observation) -> None:
        """Take in one more frame."""
        self._tracker.update(observation)
        self.obstacles = known_obstacles(self._tracker.context, observation)
        self._hides = bool(self.obstacles) or self._tracker.context.world.passers_by > 0

    def coming(self, nodes: int, node_frames: int | None = None) -> NodeValues:
        """Return what views are worth at nodes to come.

        Node h stands for the frames up to its own, and the last one for all frames after it as well. The belief of a
        node is what is expected of its own frames: activities end, and others follow.

        Args:
            nodes: number H of nodes.
            node_frames: frames from one node to the next; by default so many that they reach as far as planners look.
        """
        context, observation = self._tracker.context, self._tracker.observation
        gains = coming_gains(observation, context, self._memory)
        if node_frames is None:
            node_frames = -(-len(gains) // nodes)
        if observation.length is not None:
            weights = np.repeat(self.weights[:, None], nodes, axis=1)
        else:
            ends = np.minimum(np.arange(1, nodes + 1) * node_frames, len(gains))
            ends[-1] = len(gains)
            parts, of_node = np.unique(ends, return_inverse=True)  # nodes after the end have no frames of their own
            expected = self._tracker.beliefs(parts.tolist())
            weights = np.moveaxis(self._clear(self.field.weights(self.situation, expected)), 0, 1)[:, of_node]
        return NodeValues(node_frames, node_gains(gains, nodes, node_frames), weights)

    @property
    def situation(self) -> Situation:
        """The situation after the last frame."""
        return self._tracker.situation

    @property
    def weights(self) -> FloatArray:
        """The field's weights, (B, 21), see `view_basis.field_value`.

        Where something is in the way they can be multiplied by `seen`. A field of the open, where only differences
        between views count, is raised so that its least value over the workspace is 0: what is not seen tells as
        little as the worst view.
        """
        return self._clear(self.field.weights(self.situation))

    def _clear(self, weights: FloatArray) -> FloatArray:
        """Return weights (..., 21) of fields that can be multiplied by `seen`."""
        if self._hides and not self.field.knows_hidden:
            least = (weights @ self._everywhere.T).min(axis=-1)
            weights = weights - least[..., None] * (np.arange(BASIS_SIZE) == 0)
        return weights

    def seen(self, viewpoint: FloatArray, ahead: FloatArray | float) -> FloatArray:
        """Return the share of people that is seen from viewpoints (B, ..., 3), (B, ...); 1 where nothing is in the way.

        Args:
            viewpoint: the viewpoints.
            ahead: how far ahead cameras will be there [s]; or (N,), for viewpoints (B, N, ..., 3).
        """
        observation = self._tracker.observation
        position, passers, centre = self.situation.position, observation.passers, observation.centre
        return seen_share(viewpoint, position, self.obstacles, passers, ahead, centre)


def coarse_grid(workspace: Workspace) -> FloatArray:
    """Return a grid of viewpoints over a workspace, (G, 3)."""
    distances = np.linspace(workspace.distance_min, workspace.distance_max, GRID[0])
    azimuths = np.arange(GRID[1]) * 2 * np.pi / GRID[1]
    polars = np.linspace(workspace.polar_min, workspace.polar_max, GRID[2])
    return np.stack(np.meshgrid(distances, azimuths, polars, indexing="ij"), axis=-1).reshape(-1, 3)


def node_gains(gains: FloatArray, nodes: int, node_frames: int) -> FloatArray:
    """Return the weight of the view at each node, (nodes,): the sum of the frames' weights (R,) over the node's frames.

    The weights sum to 1. Node h stands for the `node_frames` frames up to its own. The last node also stands for all
    frames after it. Nodes after the end of the episode have weight 0, so the horizon may outlast the episode.
    """
    node = np.minimum(np.arange(len(gains)) // node_frames, nodes - 1)
    weights: FloatArray = np.zeros(nodes)
    np.add.at(weights, node, gains)
    return weights
