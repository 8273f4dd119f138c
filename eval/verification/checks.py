"""The result of verifying a run: one line for each check."""

from dataclasses import dataclass
from typing import NamedTuple

from eval.render.tables import Table

OK, FAILED, UNCHECKED = "ok", "failed", "not checked"


class Check(NamedTuple):
    """One check of a run.

    Args:
        name: name of the check.
        result: `OK`, `FAILED` or `UNCHECKED`.
        what: what was checked, or why it was not. If the check failed: the place of the first difference, the value in
            the run's files (got), and the value that they should hold (expected).
    """

    name: str
    result: str
    what: str


@dataclass(frozen=True)
class Verification:
    """All checks of a run, in order, and notes for the reader."""

    checks: tuple[Check, ...]
    notes: tuple[str, ...]

    @property
    def difference(self) -> str | None:
        """The first difference; None if no check failed."""
        return next((check.what for check in self.checks if check.result == FAILED), None)

    @property
    def verdict(self) -> str:
        """Whether the run is verified, in one line."""
        if self.difference is not None:
            return f"not verified: {self.difference}"
        unchecked = [check.name for check in self.checks if check.result == UNCHECKED]
        return f"verified, but for what was not checked: {', '.join(unchecked)}" if unchecked else "verified"

    @property
    def table(self) -> Table:
        """A table with one row for each check."""
        return Table(
            title="Checks of the run",
            header=("checked", "result", "what"),
            rows=tuple((check.name, check.result, check.what) for check in self.checks),
            footnotes=(),
            words=frozenset((1, 2)),
        )
