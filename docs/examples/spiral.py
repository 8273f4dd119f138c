"""A scripted planner: come near, and circle while in doubt."""

import numpy as np

from ehar.planner import Observation, Planner


class Spiral(Planner):
    """Come near; turn for as long as no class is more probable than the others together.

    Args:
        distance: to end at [m].
        turn: how far ahead to head on the circle [rad].
    """

    name = "spiral"

    def __init__(self, *, distance: float = 5.0, turn: float = 0.5) -> None:
        """Create the planner."""
        self.distance, self.turn = distance, turn

    def act(self, observation: Observation) -> np.ndarray:
        """Return where the cameras should be, (B, 3)."""
        target = observation.viewpoint.copy()
        in_doubt = observation.log_probs.max(axis=1) < np.log(0.5)
        target[:, 0] = self.distance
        target[:, 1] += np.where(in_doubt, self.turn, 0.0)
        return target
