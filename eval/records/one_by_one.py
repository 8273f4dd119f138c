"""Values that are too many for memory: each is made when it is asked for."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TypeVar

Held = TypeVar("Held")


class OneByOne(Mapping[str, Held]):
    """A mapping that makes a value when it is asked for, and keeps only the last one.

    Args:
        names: the keys, in order.
        make: returns the value of a key.
    """

    def __init__(self, names: Sequence[str], make: Callable[[str], Held]) -> None:
        """Make nothing yet."""
        self._names, self._make = tuple(names), make
        self._last: tuple[str, Held] | None = None

    def __getitem__(self, name: str) -> Held:
        """Return the value of a key, made anew unless it was asked for last."""
        if name not in self._names:
            raise KeyError(name)
        if self._last is None or self._last[0] != name:
            self._last = None  # before the next one is made, so that there are never two
            self._last = name, self._make(name)
        return self._last[1]

    def __iter__(self) -> Iterator[str]:
        """Return the keys, in order."""
        return iter(self._names)

    def __len__(self) -> int:
        """Return the number of keys."""
        return len(self._names)
