"""A scripted planner: come near, and circle while in doubt."""

import numpy as np

from ehar import Observation, Planner


class Spiral(Planner):
    """Come near. Turn as long as no class is more probable than all others together.

    Args:
        distance: where to end [m].
        turn: how far ahead on the circle to head [rad].
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
