"""The paper's heuristic planners (Sec. 5.1): they ignore what the camera sees."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.planner import Context, Observation, Planner
from ehar.viewpoint import MOVE_NAMES, MOVES
from planners.heading import move_target


class NoAct(Planner):
    """Stay where the episode begins."""

    name = "no-act"

    def reset(self, context: Context) -> None:
        """Do nothing: this planner remembers nothing."""

    def act(self, observation: Observation) -> FloatArray:
        """Return the present viewpoints."""
        return observation.viewpoint


class Random(Planner):
    """Draw one of the 7 moves at every frame, all with the same probability."""

    name = "random"

    def reset(self, context: Context) -> None:
        """Take the generator and the track of these episodes."""
        self._context = context

    def act(self, observation: Observation) -> FloatArray:
        """Return the targets of the drawn moves."""
        moves = self._context.rng.integers(0, len(MOVES), size=len(observation.viewpoint))
        return move_target(self._context, observation.viewpoint, moves)


class Towards(Planner):
    """Approach the people as far as the workspace allows."""

    name = "towards"

    def reset(self, context: Context) -> None:
        """Take the track."""
        self._context = context

    def act(self, observation: Observation) -> FloatArray:
        """Return the next nearer viewpoints."""
        return _repeat("distance-", observation, self._context)


class HRotate(Planner):
    """Circle around the people, always in the same direction."""

    name = "h-rotate"

    def reset(self, context: Context) -> None:
        """Take the track."""
        self._context = context

    def act(self, observation: Observation) -> FloatArray:
        """Return the next viewpoints on the circle."""
        return _repeat("azimuth+", observation, self._context)


class VRotate(Planner):
    """Descend to the level of the people: the paper lowers its elevation, which raises the polar angle."""

    name = "v-rotate"

    def reset(self, context: Context) -> None:
        """Take the track."""
        self._context = context

    def act(self, observation: Observation) -> FloatArray:
        """Return the next lower viewpoints."""
        return _repeat("polar+", observation, self._context)


def _repeat(move_name: str, observation: Observation, context: Context) -> FloatArray:
    """Return the targets (B, 3) of the same move in every episode."""
    moves = np.full(len(observation.viewpoint), MOVE_NAMES.index(move_name))
    return move_target(context, observation.viewpoint, moves)
