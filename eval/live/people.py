"""Who is who: the same person keeps the same place from frame to frame, in whatever order people are given."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from ehar.arrays import FloatArray

FORGET = 1.0  # [s] after which somebody who is not seen gives up the place
FAR = 1.0  # heights of a person in the image that nobody moves between frames
SMALLEST = 20.0  # [px]; people of whom little is seen count as at least so tall


class Placed(NamedTuple):
    """The people of a frame in their places."""

    joints: FloatArray  # (P, J, 3): x [px], y [px], confidence; 0 where nobody or nothing is seen
    left_out: int  # people for whom there is no place


class People:
    """Gives each person one of P places.

    A number or a name that a tracker gives decides. Without one, people go where they were seen last, so that the sum
    of the ways is least (Hungarian method). Who is new takes a free place, in the order given.

    Args:
        persons: P.
        joints: J.
    """

    def __init__(self, persons: int, joints: int) -> None:
        """Begin with free places."""
        self._persons, self._joints = persons, joints
        self.start()

    def start(self) -> None:
        """Forget everybody."""
        self._ids: list[int | str | None] = [None] * self._persons
        self._last = np.zeros((self._persons, self._joints, 3))
        self._seen_at = np.full(self._persons, -np.inf)

    def place(self, people: Sequence[FloatArray], ids: Sequence[int | str | None], time: float) -> Placed:
        """Return the people of a frame in their places.

        Args:
            people: joints of each person, (J, 3): x [px], y [px], confidence.
            ids: what a tracker calls each of them; None for nobody.
            time: the frame's time [s].
        """
        held = [place for place in range(self._persons) if time - self._seen_at[place] <= FORGET]
        self._ids = [known if place in held else None for place, known in enumerate(self._ids)]
        found: dict[int, int] = {}  # person -> place
        for person, known in enumerate(ids):
            if known is not None and known in self._ids and self._ids.index(known) not in found.values():
                found[person] = self._ids.index(known)
        # Trackers lose people and give them new names, so a name that is new says nothing.
        loose = [person for person in range(len(people)) if person not in found]
        open_places = [place for place in held if place not in found.values()]
        if loose and open_places:
            cost = np.array([[_apart(people[person], self._last[place]) for place in open_places] for person in loose])
            for row, column in zip(*linear_sum_assignment(cost), strict=True):
                if cost[row, column] < FAR:
                    found[loose[row]] = open_places[column]
        free = [place for place in range(self._persons) if place not in found.values() and place not in held]
        newcomers = [person for person in range(len(people)) if person not in found]
        newcomers = sorted(newcomers, key=lambda person: -_height(people[person]))[: len(free)]
        found |= dict(zip(sorted(newcomers), free, strict=False))
        placed = np.zeros((self._persons, self._joints, 3))
        for person, place in found.items():
            placed[place] = people[person]
            if (people[person][:, 2] > 0).any():
                self._last[place], self._seen_at[place], self._ids[place] = people[person], time, ids[person]
        return Placed(placed, len(people) - len(found))


def _height(joints: FloatArray) -> float:
    """Return the larger side of the box around the joints that are seen [px], at least `SMALLEST`."""
    seen = joints[joints[:, 2] > 0, :2]
    return max(float(np.ptp(seen, axis=0).max()), SMALLEST) if len(seen) else SMALLEST


def _apart(joints: FloatArray, before: FloatArray) -> float:
    """Return how far apart two people are in the image, in heights; joints that only one of them shows do not count."""
    both = (joints[:, 2] > 0) & (before[:, 2] > 0)
    if not both.any():
        return 2 * FAR
    way = np.linalg.norm(joints[both, :2] - before[both, :2], axis=1)
    return float(np.median(way)) / _height(before)
