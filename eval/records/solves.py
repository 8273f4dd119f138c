"""Counts of a planner's plans: how many ended in each status, and how many fell back."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol, runtime_checkable

from ehar.planner import Planner


class Statistics(Protocol):
    """A planner's counts of its plans since its last reset; `nbv` passes on the counts of its solver."""

    @property
    def counts(self) -> Mapping[str, int]:
        """The number of plans that ended in each status."""
        ...

    @property
    def fallbacks(self) -> int:
        """The number of plans that the chosen solver did not find itself."""
        ...


@runtime_checkable
class CountsPlans(Protocol):
    """A planner that counts its plans; counting is optional."""

    @property
    def statistics(self) -> Statistics:
        """The counts of all plans since the last reset."""
        ...


class Solves(NamedTuple):
    """The number of plans by status, and of those that fell back."""

    counts: dict[str, int]  # by status, in alphabetical order
    fallbacks: int

    @property
    def total(self) -> int:
        """The number of plans."""
        return sum(self.counts.values())

    @property
    def fallback_share(self) -> float:
        """The share of plans that fell back; 0 without plans, as in episodes of one frame."""
        return self.fallbacks / max(self.total, 1)


def solves_of(planner: Planner) -> Solves | None:
    """Return a planner's counts since its last reset; None for a planner that does not count."""
    if not isinstance(planner, CountsPlans):
        return None
    counts = {str(status): int(count) for status, count in planner.statistics.counts.items()}
    return Solves(dict(sorted(counts.items())), planner.statistics.fallbacks)


def join_solves(pieces: Sequence[Solves | None]) -> Solves | None:
    """Return the counts of several batches of one planner as one."""
    counted = [piece for piece in pieces if piece is not None]
    if not counted:
        return None
    counts = sum((Counter(piece.counts) for piece in counted), Counter[str]())
    return Solves(dict(sorted(counts.items())), sum(piece.fallbacks for piece in counted))
