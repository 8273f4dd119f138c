"""What came of verifying a run: one line for each thing that was looked at."""

from dataclasses import dataclass
from typing import NamedTuple

from eval.render.tables import Table

OK, FAILED, UNCHECKED = "ok", "failed", "not checked"


class Check(NamedTuple):
    """One thing that was looked at.

    Args:
        name: of it.
        result: `OK`, `FAILED` or `UNCHECKED`.
        what: was checked, or why it was not; where it failed, the first difference: where, what the run's files hold
            (got), and what they should hold (expected).
    """

    name: str
    result: str
    what: str


@dataclass(frozen=True)
class Verification:
    """What was checked of a run, in order, and what its reader should know."""

    checks: tuple[Check, ...]
    notes: tuple[str, ...]

    @property
    def difference(self) -> str | None:
        """The first difference; None where nothing failed."""
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
        """One row a check."""
        return Table(
            title="Checks of the run",
            header=("checked", "result", "what"),
            rows=tuple((check.name, check.result, check.what) for check in self.checks),
            footnotes=(),
            words=frozenset((1, 2)),
        )
