"""Planners that search the gain field without optimal control: one step ahead, or along straight ways to goals."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ehar.arrays import FloatArray, IntArray
from ehar.errors import EpisodeError, UsageError
from ehar.obstacles.free_space import needed_clearance
from ehar.planner import Context, Observation, Planner
from ehar.viewpoint import MOVES, cartesian
from planners.heading import HEADING_TIME, move_target
from planners.search.pace import pace_of
from planners.search.ways import Ways, free_spaces
from planners.value.model import GainModel
from planners.value.view_basis import basis_at, mean_direction
from planners.value.view_value import ViewValue, coarse_grid

WAY_POINTS = 15  # nodes along a straight way, over the rest of the episode


class NextBestViewGreedy(Planner):
    """Make the one of the 7 moves that raises the gain field most, without looking further ahead.

    Args:
        model: trained gain fields and belief.
    """

    name = "nbv-greedy"

    def __init__(self, *, model: GainModel) -> None:
        """Create the planner."""
        self._value = ViewValue(model)

    def reset(self, context: Context) -> None:
        """Forget everything."""
        self._context = context
        self._value.reset(context)

    def act(self, observation: Observation) -> FloatArray:
        """Return the best neighbouring viewpoints; for a vehicle they are a second away.

        Raises:
            EpisodeError: the field is not finite.
        """
        self._value.update(observation)
        here = np.repeat(observation.viewpoint[:, None], len(MOVES), axis=1)
        there = move_target(self._context, here, np.broadcast_to(np.arange(len(MOVES)), here.shape[:2]))
        if observation.centre is not None and self._context.vehicle is None:
            places = cartesian(there) + observation.centre[:, None]
            clear = self._value.obstacles.clearance(places) >= needed_clearance(there, self._context.workspace)
            there = np.where(clear[..., None], there, here)
        values = np.einsum("bmk,bk->bm", basis_at(there, self._value.span), self._value.weights)
        ahead = self._context.frame_time if self._context.vehicle is None else HEADING_TIME
        values *= self._value.seen(there, ahead)
        _check_finite(values, self.name, observation.frame)
        best = np.argmax(values + 1e-12 * (MOVES == 0).all(axis=1), axis=1)  # a tie is no reason to move
        chosen: FloatArray = there[np.arange(len(best)), best]
        return chosen


class NextBestViewSearch(Planner):
    """Head for the goal on a grid whose straight way collects most gain until the end of the episode.

    Args:
        model: trained gain fields and belief.
        replan: number of frames from one search to the next.
    """

    name = "nbv-search"

    def __init__(self, *, model: GainModel, replan: int = 10) -> None:
        """Create the planner."""
        if replan < 1:
            raise UsageError(f"{self.name}: expected to replan every 1 frame or more, got {replan}")
        self.replan = replan
        self._value = ViewValue(model)

    def reset(self, context: Context) -> None:
        """Forget everything."""
        self._context = context
        self._value.reset(context)

    def act(self, observation: Observation) -> FloatArray:
        """Return the goals; search every `replan` frames.

        Raises:
            EpisodeError: the field is not finite.
        """
        self._value.update(observation)
        if observation.frame % self.replan == 0:
            found = search_ways(self._value, observation, self._context)
            _check_finite(found.collected, self.name, observation.frame)
            best, ways = np.argmax(found.collected, axis=1), found.ways
            # Where the centre stays, the motion knows the free cells, and takes the shortest way through them.
            self._goal = ways.goals[np.arange(len(best)), best] if observation.centre is None else ways.heads(best)
        return self._goal


def _check_finite(values: FloatArray, name: str, frame: int) -> None:
    """Raise EpisodeError unless all values (B, ...) of views are finite: NaN has no best view."""
    finite = np.isfinite(values).reshape(len(values), -1).all(axis=1)
    if not finite.all():
        raise EpisodeError(
            f"planner {name!r}, episode {int(np.argmin(finite))} of the batch, frame {frame}: "
            "expected finite values of the gain field, got NaN or infinity"
        )


class Search(NamedTuple):
    """Ways to G goals, the first of which is to stay, and what they collect in B episodes.

    Attributes:
        ways: the ways.
        frames: (N,) frames from now, at which cameras are looked at along the ways.
        places: (B, N, G, 3) where they are then.
        collected: (B, G) the gain along each way, in the field's unit.
        planned: (B,) that of the plans; None without plans.
    """

    ways: Ways
    frames: IntArray
    places: FloatArray
    collected: FloatArray
    planned: FloatArray | None = None


def search_ways(
    value: ViewValue,
    observation: Observation,
    context: Context,
    plans: Callable[[IntArray], FloatArray] | None = None,
) -> Search:
    """Return ways to a grid of goals, and their gain.

    The ways are straight in the three coordinates, or lead around obstacles. They end at rest, and go at the pace of
    the grid, or at that of the vehicle from its present motion. A view counts as far as it shows people.

    Args:
        value: the value of views after the present frame.
        observation: the observation of the present frame.
        context: the context of the episodes.
        plans: gives where plans lead, (B, N, 3), after frames (N,) from now.
    """
    here = observation.viewpoint
    grid = coarse_grid(context.workspace)
    goals = np.concatenate([here[:, None], np.broadcast_to(grid, (len(here), *grid.shape))], axis=1)
    ways = Ways.to(goals, here, free_spaces(context, observation))
    node_frames, gains, weights = value.coming(WAY_POINTS)
    pace = pace_of(ways, observation, context)
    nodes = np.flatnonzero(gains)
    frames, counts = (nodes + 1) * node_frames, gains[nodes]
    there = pace.places(ways, frames, context.workspace)
    if plans is not None:
        there = np.concatenate([there, plans(frames)[:, :, None]], axis=2)
    basis = basis_at(there, value.span)
    seen = counts[:, None] * value.seen(there, frames * context.frame_time)  # (B, N, G)
    collected = np.einsum("bng,bng->bg", seen, (basis @ weights[:, nodes, :, None])[..., 0])
    looking = np.einsum("bng,bngi->bgi", seen, mean_direction(basis))
    # A pair of views that differ tells more than two alike, if both show people.
    collected += value.field.spread * (seen.sum(axis=1) ** 2 - (looking**2).sum(axis=-1))
    if plans is None:
        return Search(ways, frames, there, collected)
    return Search(ways, frames, there[:, :, :-1], collected[:, :-1], collected[:, -1])
