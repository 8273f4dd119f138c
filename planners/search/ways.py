"""The ways to goals that a search values: straight, or around obstacles where the straight way is not free."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.obstacles.free_space import FreeSpace
from ehar.viewpoint import AZIMUTH, wrap_difference

NEVER = 1e6  # times as long as the straight way, where there is no way
SIGHTS = np.linspace(0, 1, 21)[1:]  # shares of a straight way at which its cells have to be free


class Detours(NamedTuple):
    """The ways around obstacles of one episode."""

    goals: IntArray  # (n,), which of the goals they lead to
    cells: FloatArray  # (n, N, 3), from here on; a way that is shorter stays at its last cell
    steps: IntArray  # (n,), moves of each


@dataclass(frozen=True, eq=False)
class Ways:
    """The ways from B viewpoints to G goals each.

    Args:
        here: (B, 3).
        goals: (B, G, 3).
        longer: (B, G) how many times as long as the straight way each is, 1 for a straight one, `NEVER` if there is no
            way.
        detours: those of each episode; none in an open world.
    """

    here: FloatArray
    goals: FloatArray
    longer: FloatArray
    detours: tuple[Detours, ...] = ()

    @property
    def straight(self) -> FloatArray:
        """The straight ways, (B, G, 3), the short way round."""
        way = self.goals - self.here[:, None]
        way[..., AZIMUTH] = wrap_difference(way[..., AZIMUTH])
        return way

    def at(self, share: FloatArray) -> FloatArray:
        """Return the viewpoints (B, G, 3) after a share (B, G) of each way."""
        places: FloatArray = self.here[:, None] + share[..., None] * self.straight
        for episode, (goals, cells, steps) in enumerate(self.detours):
            reached = np.rint(share[episode, goals] * steps).astype(np.int64)
            places[episode, goals] = cells[np.arange(len(goals)), reached]
        return places

    @staticmethod
    def to(goals: FloatArray, here: FloatArray, space: FreeSpace | None) -> "Ways":
        """Return the shortest free ways to goals (B, G, 3); a goal that is not free stands for the nearest free cell.

        Args:
            goals: (B, G, 3).
            here: (B, 3).
            space: the free cells; None if all are.
        """
        longer = np.ones(goals.shape[:2])
        if space is None:
            return Ways(here, goals, longer)
        ways = Ways(here, space.nearest(goals), longer)
        along = here[:, None, None] + SIGHTS[:, None] * ways.straight[:, :, None]
        free = np.asarray(space.is_free(along).all(axis=-1))
        moves = np.maximum(np.abs(ways.straight / space.workspace.step).sum(axis=-1), 1)
        detours = []
        for episode, viewpoint in enumerate(space.nearest(here)):
            blocked = np.flatnonzero(~free[episode])
            cells = space.ways(viewpoint, ways.goals[episode, blocked])
            steps = (np.diff(cells, axis=1) != 0).any(axis=2).sum(axis=1)
            longer[episode, blocked] = np.where(steps > 0, steps / moves[episode, blocked], NEVER)
            detours.append(Detours(blocked, cells, steps))
        return Ways(here, ways.goals, longer, tuple(detours))
