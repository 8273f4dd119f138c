"""Planners side by side: a device runs several chunks in lockstep, and each chunk keeps a planner of its own."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import EpisodeError
from ehar.motion import heading
from ehar.planner import Context, Observation, Planner


class SideBySide(Planner):
    """One planner a chunk, each with the random numbers and the batch that it has where chunks run one by one.

    So what a planner does depends on the number of chunks in lockstep only through the rounding of what it is shown.

    Args:
        planners: copies of one planner, which is not privileged.
        episodes: number of episodes of each chunk.
        generators: the generator of each chunk.
    """

    def __init__(
        self, planners: Sequence[Planner], episodes: Sequence[int], generators: Sequence[np.random.Generator]
    ) -> None:
        """Take the planners."""
        self.name = planners[0].name
        self.planners = tuple(planners)
        ends = np.cumsum(episodes)
        self._rows = [slice(int(end) - count, int(end)) for end, count in zip(ends, episodes, strict=True)]
        self._generators = tuple(generators)

    def reset(self, context: Context) -> None:
        """Prepare each planner for its chunk."""
        for planner, rows, rng in zip(self.planners, self._rows, self._generators, strict=True):
            planner.reset(replace(context, episodes=rows.stop - rows.start, rng=rng))

    def act(self, observation: Observation) -> FloatArray:
        """Return the targets (B, 3) of all chunks, one after another."""
        arrays: dict[str, Any] = {
            part.name: value
            for part in fields(observation)
            if isinstance(value := getattr(observation, part.name), np.ndarray)
        }
        targets = []
        for planner, rows in zip(self.planners, self._rows, strict=True):
            target = planner.act(replace(observation, **{name: array[rows] for name, array in arrays.items()}))
            expected = (rows.stop - rows.start, 3)
            if heading(target).shape != expected:
                where = f"planner {self.name!r}, frame {observation.frame}"
                raise EpisodeError(f"{where}: expected target viewpoints of shape {expected}, got {np.shape(target)}")
            targets.append(target)
        return np.concatenate(targets)
