"""Your own planner over the trained gain field: head in the direction in which most is to be seen."""

import numpy as np

from ehar import Context, Observation, Planner
from ehar.viewpoint import MOVES
from planners.value.model import GainModel
from planners.value.view_basis import basis_at
from planners.value.view_value import ViewValue


class Rays(Planner):
    """Look along the 7 moves, some steps far. Head for the end of the ray whose mean gain is the highest.

    Args:
        model: the trained gain field. `ehar benchmark` hands it to an argument with this annotation.
        steps: how many steps of the grid a ray is long.
    """

    name = "rays"

    def __init__(self, *, model: GainModel, steps: int = 15) -> None:
        """Create the planner."""
        self.value, self.steps = ViewValue(model), steps

    def reset(self, context: Context) -> None:
        """Forget the episodes before."""
        self.value.reset(context)
        self.workspace = context.workspace
        self.rays = MOVES[:, None] * np.arange(1, self.steps + 1)[:, None] * self.workspace.step  # (7, steps, 3)

    def act(self, observation: Observation) -> np.ndarray:
        """Return the ends of the best rays, (B, 3)."""
        self.value.update(observation)
        views = self.workspace.clip(observation.viewpoint[:, None, None] + self.rays)  # (B, 7, steps, 3)
        gains = np.einsum("bmsk,bk->bm", basis_at(views, self.value.span), self.value.weights)
        best = np.argmax(gains, axis=1)
        return views[np.arange(len(best)), best, -1]
