"""The onsets of activities in streams, and a recogniser that is told them."""

from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np

from ehar.arrays import BoolArray, FloatArray, IntArray
from ehar.recogniser import Recogniser, Recognition
from ehar.sensors.sensor import Sensed

Onset = Literal["unknown", "known"]
ONSETS: tuple[Onset, ...] = get_args(Onset)


def begins(labels: IntArray, none: int) -> BoolArray:
    """Return in which frames an activity begins, (B, L); the first frame is no such frame, as nothing is seen before.

    Args:
        labels: (B, L) the class of each frame.
        none: the class of no activity, which does not begin.
    """
    new = np.zeros(labels.shape, dtype=bool)
    new[:, 1:] = (labels[:, 1:] != labels[:, :-1]) & (labels[:, 1:] != none)
    return new


@dataclass(frozen=True, eq=False)
class OnsetState:
    """The state of a recogniser that is told onsets.

    Args:
        state: the recogniser's state before the next frame.
        begins: (B, L) the frames in which an activity begins.
        frame: the next frame.
        imagined: whether it has been forked. What is imagined forgets in the first frame only: nobody has to know how
            to reset a forked state, and all that is imagined can be compared.
    """

    state: Any
    begins: BoolArray
    frame: int = 0
    imagined: bool = False

    @property
    def due(self) -> Any:
        """The recogniser's state, in which the episodes whose activity begins in the next frame have seen nothing."""
        new = self.begins[:, self.frame]
        return self.state.reset(new) if new.any() and not self.imagined else self.state

    def fork(self, forks: int) -> "OnsetState":
        """Return a state with F alternatives of each episode."""
        return replace(self, state=self.due.fork(forks), imagined=True)

    def select(self, choice: IntArray) -> "OnsetState":
        """Return the unforked state of alternative `choice` (B,) of each episode."""
        return replace(self, state=self.state.select(choice))

    def reset(self, mask: BoolArray) -> "OnsetState":
        """Return a state in which the episodes of `mask` (B,) have seen nothing yet."""
        return replace(self, state=self.state.reset(mask))


class ToldOnsets:
    """A recogniser that forgets what it saw whenever an activity begins; oracles imagine with it too.

    Args:
        recogniser: the recogniser that is told.
        begins: (B, L) the frames in which an activity begins, of the episodes that it will see.
    """

    def __init__(self, recogniser: Recogniser, begins: BoolArray) -> None:
        """Take the classes of the recogniser."""
        self.class_names, self.embedding_size = recogniser.class_names, recogniser.embedding_size
        self._recogniser, self._begins = recogniser, begins

    def start(self, episodes: int) -> OnsetState:
        """Return the state of B episodes that have seen nothing."""
        return OnsetState(self._recogniser.start(episodes), self._begins)

    def step(self, state: OnsetState, sensed: Sensed, viewpoint: FloatArray) -> tuple[Recognition, OnsetState]:
        """See one more frame; shapes as in `ehar.recogniser.Recogniser.step`."""
        recognition, after = self._recogniser.step(state.due, sensed, viewpoint)
        return recognition, replace(state, state=after, frame=state.frame + 1)
