"""The paper's heuristic planners (Sec. 5.1): none of them looks at what it sees."""

import numpy as np

from ehar.arrays import FloatArray
from ehar.planner import Context, Observation, Planner
from ehar.viewpoint import MOVE_NAMES, MOVES
from planners.heading import heading


class NoAct(Planner):
    """Stay where the episode begins."""

    name = "no-act"

    def reset(self, context: Context) -> None:
        """Nothing is remembered."""

    def act(self, observation: Observation) -> FloatArray:
        """Return the present viewpoints."""
        return observation.viewpoint


class Random(Planner):
    """Make one of the 7 moves, each as likely as the others, anew at every frame."""

    name = "random"

    def reset(self, context: Context) -> None:
        """Take the generator and the track of these episodes."""
        self._context = context

    def act(self, observation: Observation) -> FloatArray:
        """Return where the drawn moves lead."""
        moves = self._context.rng.integers(0, len(MOVES), size=len(observation.viewpoint))
        return heading(self._context, observation.viewpoint, moves)


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
    """Return where the same move leads in every episode, (B, 3)."""
    moves = np.full(len(observation.viewpoint), MOVE_NAMES.index(move_name))
    return heading(context, observation.viewpoint, moves)
