"""What is said while a run goes on: a progress bar where there is a terminal, lines where there is none."""

from typing import Protocol

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn


class Reporter(Protocol):
    """Hears of a run's progress."""

    def note(self, line: str) -> None:
        """Hear what the user should know."""

    def begin(self, jobs: int) -> None:
        """Hear that so many jobs begin."""

    def advance(self, planner: str) -> None:
        """Hear that one job of a planner is done."""

    def end(self) -> None:
        """Hear that no more jobs follow."""


class ConsoleReporter:
    """Reports on standard error, which leaves standard output to results."""

    def __init__(self) -> None:
        """Create the reporter; it draws nothing yet."""
        self._console = Console(stderr=True)
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=self._console,
            transient=True,
            disable=not self._console.is_terminal,
        )

    def note(self, line: str) -> None:
        """Print a line."""
        self._console.print(line, markup=False, highlight=False, soft_wrap=True)

    def begin(self, jobs: int) -> None:
        """Start a bar of so many jobs."""
        self._bar.start()
        self._bar.add_task("", total=jobs)

    def advance(self, planner: str) -> None:
        """Advance the bar, and show which planner it was."""
        if self._bar.task_ids:
            self._bar.update(self._bar.task_ids[-1], advance=1, description=planner)

    def end(self) -> None:
        """Take the bar away."""
        self._bar.stop()
        for task in self._bar.task_ids:
            self._bar.remove_task(task)
