"""A planner that asks another one, and keeps its observations and its answers."""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ehar.arrays import FloatArray
from ehar.motion import heading
from ehar.planner import Context, Observation, Planner
from ehar.plugins.blame import blamed


class Recorder(Planner):
    """Asks a planner, and keeps the observations and targets of the present batch.

    Args:
        planner: the planner to ask.
        name: name in the run; None keeps the planner's own.
        answered: called after each answer with the planner's copy of the observation, which the planner may have
            changed.

    Attributes:
        context: context of the batch.
        observations: observation of each frame so far, without the truth, as it was before the planner saw it.
        targets: targets of each frame so far, (B, 3) if the planner keeps its contract; of paths their ends.
        seconds: time that the planner took for its answers [s].
    """

    def __init__(
        self, planner: Planner, *, name: str | None = None, answered: Callable[[Observation], None] | None = None
    ) -> None:
        """Keep nothing yet."""
        self.planner = planner
        self.name = planner.name if name is None else name
        self.privileged = planner.privileged
        self._answered = answered
        self._forget()

    def reset(self, context: Context) -> None:
        """Begin a new batch."""
        self._forget()
        self.context = context
        with blamed(self.planner, f"planner {self.name!r}, reset"):
            self.planner.reset(context)

    def act(self, observation: Observation) -> FloatArray:
        """Return the planner's targets; the planner gets a copy of the observation."""
        shown, kept = _copied(observation), _copied(observation)
        begin = time.perf_counter()
        with blamed(self.planner, f"planner {self.name!r}, frame {observation.frame}"):
            target = self.planner.act(shown)
        self.seconds += time.perf_counter() - begin
        self.observations.append(replace(kept, truth=None))
        self.targets.append(heading(target))
        if self._answered is not None:
            self._answered(shown)
        return target

    def _forget(self) -> None:
        self.observations: list[Observation] = []
        self.targets: list[FloatArray] = []
        self.seconds = 0.0


def array_names(observation: Observation) -> list[str]:
    """Return the names of an observation's arrays."""
    return [name for name, value in vars(observation).items() if isinstance(value, np.ndarray)]


def _copied(observation: Observation) -> Observation:
    return replace(observation, **{name: getattr(observation, name).copy() for name in array_names(observation)})
