"""Values that are too many for memory: each is made when it is asked for."""

import pickle
from collections.abc import Callable, Iterator, Mapping, Sequence
from tempfile import TemporaryFile, gettempdir
from typing import TypeVar

from ehar.errors import UsageError

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


def put_aside(make: Callable[[str], Held]) -> Callable[[str], Held]:
    """Return a function that makes each value once: then it reads the value from a file of this process.

    The file has no name, so nobody else can write to it, and it is gone when the process ends.

    Args:
        make: returns the value of a key; it takes long.
    """
    places: dict[str, int] = {}
    file = TemporaryFile(prefix="ehar-")

    def held(name: str) -> Held:
        if name in places:
            file.seek(places[name])
            found: Held = pickle.load(file)
            return found
        value = make(name)
        begin = file.seek(0, 2)
        try:
            pickle.dump(value, file, protocol=pickle.HIGHEST_PROTOCOL)
            file.flush()
        except OSError as error:
            raise UsageError(f"{gettempdir()}: cannot be written: {error.strerror}") from error
        places[name] = begin
        return value

    return held
