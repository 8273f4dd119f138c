"""The results of a conformance kit: one line for each check, and for a failed one got, expected, and how to mend it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ehar.arrays import FloatArray
from ehar.errors import EharError

FEW = 0.05  # share of sequences, or of frames, that may be odd without a failure


@dataclass(frozen=True)
class ContractCheck:
    """One check.

    Args:
        name: what has to hold.
        passed: whether it holds; None if it could not be checked.
        got: the wrong value, or why it could not be checked.
        expected: the right value.
        mend: how to mend it.
        doubtful: whether it holds, but somebody should look at what it got.
    """

    name: str
    passed: bool | None
    got: str = ""
    expected: str = ""
    mend: str = ""
    doubtful: bool = False

    def lines(self) -> list[str]:
        """Return the check for people to read."""
        status = "warning" if self.doubtful else {True: "passed", False: "FAILED", None: "not checked"}[self.passed]
        first = f"  {status:<12} {self.name}" + (f": {self.got}" if self.got and self.passed is not False else "")
        if self.passed is not False:
            return [first]
        said = (("got", self.got), ("expected", self.expected), ("to mend", self.mend))
        return [first, *(f"{'':15}{what}: {text}" for what, text in said)]


@dataclass(frozen=True)
class Conformance:
    """The results of a kit. A test asserts `check_planner(mine).passed`; `print` shows them.

    Args:
        subject: the name of what was checked.
        checks: the checks, in the order in which they were made.
    """

    subject: str
    checks: tuple[ContractCheck, ...]

    @property
    def passed(self) -> bool:
        """Whether no check failed."""
        return not self.failed

    @property
    def failed(self) -> tuple[ContractCheck, ...]:
        """The checks that failed."""
        return tuple(check for check in self.checks if check.passed is False)

    def __str__(self) -> str:
        """Return the counts, and a line for each check."""
        counts = [sum(check.passed is status for check in self.checks) for status in (True, False, None)]
        doubtful = sum(check.doubtful for check in self.checks)
        words = ("passed", "failed", "not checked", "of them with a warning")
        count = ", ".join(f"{n} {what}" for n, what in zip((*counts, doubtful), words, strict=True) if n)
        return "\n".join([f"{self.subject}: {count}", *(line for check in self.checks for line in check.lines())])


def attempt(name: str, check: Callable[[], str | None], *, expected: str, mend: str) -> ContractCheck:
    """Make a check; an error that it raises is a failure too.

    Args:
        name: what has to hold.
        check: returns the wrong value in words; None if there is none.
        expected: as in `ContractCheck`.
        mend: as in `ContractCheck`.
    """
    try:
        got = check()
    except EharError as error:
        got = str(error)
        mend = mend if error.__cause__ is None else f"that line of your code raised it; {mend}"
    return ContractCheck(name, True) if got is None else ContractCheck(name, False, got, expected, mend)


def first_difference(
    one: FloatArray, other: FloatArray, rows: tuple[str, str], *, tolerance: float, what: str = "target"
) -> str | None:
    """Return in words where two arrays (T, B, ...) first differ by more than a tolerance; None if they do not.

    Args:
        one: the first array.
        other: the second array, of the same shape.
        rows: the names of both arrays.
        tolerance: the largest difference that is allowed; 0 demands equal arrays.
        what: the name of their values.
    """
    if one.shape != other.shape:
        return f"arrays of {what}s of shape {one.shape} {rows[0]} and {other.shape} {rows[1]}"
    differs = ~(np.abs(one - other) <= tolerance)
    if not differs.any():
        return None
    frame, row = (int(index) for index in np.argwhere(differs.reshape(*one.shape[:2], -1).any(axis=-1))[0])
    texts = [
        np.array2string(np.asarray(array[frame, row]), precision=4, threshold=8, edgeitems=3) for array in (one, other)
    ]
    return f"{what} of row {row} after frame {frame}: " + ", ".join(
        f"{' '.join(text.split())} {name}" for text, name in zip(texts, rows, strict=True)
    )
