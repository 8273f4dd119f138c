"""The ways to goals that a search values: straight, or around obstacles where the straight way is not free."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.errors import UsageError
from ehar.obstacles.free_space import FreeSpace
from ehar.obstacles.shapes import MARGIN
from ehar.planner import Context, Observation
from ehar.viewpoint import AZIMUTH, cartesian, wrap_difference
from planners.heading import free_space, known_obstacles

NEVER = 1e6  # times as long as the straight way, where there is no way
SIGHTS = np.linspace(0, 1, 21)[1:]  # shares of a straight way at which its cells have to be free
COARSER = (5, 2)  # steps of distance and angle in one of a stream, whose free cells are found anew for each search


class Detours(NamedTuple):
    """The ways around obstacles of one episode."""

    space: FreeSpace
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
        detours: those of each episode; none in an open world, and None where nobody knows what is free.
    """

    here: FloatArray
    goals: FloatArray
    longer: FloatArray
    detours: "tuple[Detours | None, ...]" = ()

    @property
    def straight(self) -> FloatArray:
        """The straight ways, (B, G, 3), the short way round."""
        way = self.goals - self.here[:, None]
        way[..., AZIMUTH] = wrap_difference(way[..., AZIMUTH])
        return way

    def at(self, share: FloatArray) -> FloatArray:
        """Return the viewpoints (B, N, G, 3) after shares (B, N, G) of each way."""
        places: FloatArray = self.here[:, None, None] + share[..., None] * self.straight[:, None]
        for episode, detour in enumerate(self.detours):
            if detour is None:
                continue
            _, goals, cells, steps = detour
            reached = np.rint(share[episode][:, goals].clip(0, 1) * steps).astype(np.int64)
            places[episode][:, goals] = cells[np.arange(len(goals)), reached]
        return places

    def heads(self, chosen: IntArray) -> FloatArray:
        """Return where cameras head for first to get to the goals `chosen` (B,), (B, 3): there, or to a corner.

        It is the last place of a detour to which the straight way is free.
        """
        heads: FloatArray = self.goals[np.arange(len(chosen)), chosen].copy()
        for episode, detour in enumerate(self.detours):
            if detour is None or chosen[episode] not in detour.goals:
                continue
            index = int(np.flatnonzero(detour.goals == chosen[episode])[0])
            cells = detour.cells[index, 1 : max(detour.steps[index], 1) + 1]
            way = cells - self.here[episode]
            way[:, AZIMUTH] = wrap_difference(way[:, AZIMUTH])
            in_sight = detour.space.is_free(self.here[episode] + SIGHTS[:, None, None] * way).all(axis=0)
            if len(cells):
                heads[episode] = cells[max(np.flatnonzero(in_sight), default=0)]
        return heads

    @staticmethod
    def to(goals: FloatArray, here: FloatArray, spaces: Sequence[FreeSpace | None] = ()) -> "Ways":
        """Return the shortest free ways to goals (B, G, 3); a goal that is not free stands for the nearest free cell.

        A camera that keeps the margin may stay where it is, though its cell as a whole is not free.

        Args:
            goals: (B, G, 3).
            here: (B, 3).
            spaces: the free cells of each episode, None where nobody knows them; empty if all are free.
        """
        longer = np.ones(goals.shape[:2])
        if not any(spaces):
            return Ways(here, goals, longer)
        nearest = [goal if space is None else space.nearest(goal) for goal, space in zip(goals, spaces, strict=True)]
        clear = [
            space is None or space.obstacles.clearance(cartesian(place)) >= MARGIN
            for place, space in zip(here, spaces, strict=True)
        ]
        stays = (goals == here[:, None]).all(axis=-1) & np.array(clear)[:, None]
        ways = Ways(here, np.where(stays[..., None], goals, np.stack(nearest)), longer)
        along = here[:, None, None] + SIGHTS[:, None] * ways.straight[:, :, None]
        detours: list[Detours | None] = []
        for episode, space in enumerate(spaces):
            if space is None:
                detours.append(None)
                continue
            blocked = np.flatnonzero(~space.is_free(along[episode]).all(axis=-1) & ~stays[episode])
            cells = space.ways(space.nearest(here[episode]), ways.goals[episode, blocked])
            steps = (np.diff(cells, axis=1) != 0).any(axis=2).sum(axis=1)
            moves = np.maximum(np.abs(ways.straight[episode, blocked] / space.workspace.step).sum(axis=-1), 1)
            longer[episode, blocked] = np.where(steps > 0, steps / moves, NEVER)
            detours.append(Detours(space, blocked, cells, steps))
        return Ways(here, ways.goals, longer, tuple(detours))


def free_spaces(context: Context, observation: Observation) -> list[FreeSpace | None]:
    """Return the cells that keep clear of obstacles for each episode; none in an open world.

    In a stream they are those of a coarser grid, around where the centre is now. None stands for a place in which no
    cell is free, or from none anything is seen.
    """
    obstacles = known_obstacles(context, observation)
    if not obstacles:
        return []
    if observation.centre is None:
        return [free_space(context)] * len(observation.viewpoint)
    workspace = context.workspace
    turns = max(workspace.cells[AZIMUTH] // COARSER[1], 1)
    coarse = replace(workspace, distance_step=COARSER[0] * workspace.distance_step, angle_step=float(2 * np.pi / turns))
    spaces: list[FreeSpace | None] = []
    for centre in observation.centre:
        try:
            spaces.append(FreeSpace(coarse, obstacles.relative_to(centre)))
        except UsageError:
            spaces.append(None)
    return spaces
