"""Reports the progress of a run: a bar on a terminal, lines without one."""

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

from recognition.training.stopping import Evaluation, doubling_gain

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID
    from rich.table import Table


class Reporter(Protocol):
    """Is told of a run's progress."""

    def note(self, line: str) -> None:
        """Take a line that the user should read."""

    def begin(self, jobs: int) -> None:
        """Note that a number of jobs begin."""

    def advance(self, planner: str) -> None:
        """Note that one job of a planner is done."""

    def end(self) -> None:
        """Note that no more jobs follow."""


def _bar() -> "tuple[Console, Progress]":
    """Return standard error, and a bar that is drawn there if it is a terminal, and leaves nothing behind."""
    from rich import progress  # here, as the help of commands does not wait for rich
    from rich.console import Console

    console = Console(stderr=True)
    bar = progress.Progress(
        progress.TextColumn("{task.description}"),
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        progress.TimeElapsedColumn(),
        progress.TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )
    return console, bar


class ConsoleReporter:
    """Reports on standard error, which leaves standard output to results."""

    def __init__(self) -> None:
        """Create the reporter; it draws nothing yet."""
        self._console, self._bar = _bar()

    def note(self, line: str) -> None:
        """Print a line."""
        self._console.print(line, markup=False, highlight=False, soft_wrap=True)

    def begin(self, jobs: int) -> None:
        """Start a bar for a number of jobs."""
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


class TrainingProgress:
    """A bar over the steps of a training run, and a line for each look at the validation clips."""

    def __init__(self) -> None:
        """Create the bar; it is drawn on standard error, and only on a terminal."""
        self._console, self._bar = _bar()

    def __enter__(self) -> "TrainingProgress":
        """Draw the bar."""
        self._bar.start()
        self._task = self._bar.add_task("training clips")
        self._begun: tuple[float, int] | None = None  # the time and the clips at the first report
        return self

    def __exit__(self, *error: object) -> None:
        """Take the bar away."""
        self._bar.stop()

    def report(self, clips: int, expected: int, evaluations: Sequence[Evaluation] | None) -> None:
        """Advance to a number of clips, and print the last evaluation and what more clips would bring."""
        if self._begun is None:
            self._begun = (time.monotonic(), clips)
        self._bar.update(self._task, completed=clips, total=expected)
        if not evaluations:
            return
        last, gain = evaluations[-1], doubling_gain(evaluations)
        line = f"{clips:,} clips: training loss {last.train_loss:.3f}, validation accuracy {100 * last.accuracy:.1f} %"
        begun, before = self._begun
        if gain is not None and clips > before:
            minutes = (time.monotonic() - begun) / (clips - before) * clips / 60
            line += (
                f"; the last doubling gained {100 * gain:.1f} points, the next takes {minutes:.0f} min: "
                f"at most {100 * gain / max(minutes, 1e-9):.2f} points a minute"
            )
        self._console.print(line, highlight=False, soft_wrap=True)


class StageProgress:
    """A bar for each stage of a longer task, and a line where there is no terminal."""

    def __init__(self) -> None:
        """Create the bars; they are drawn on standard error."""
        self._console, self._bar = _bar()
        self._tasks: dict[str, TaskID] = {}

    def __enter__(self) -> "StageProgress":
        """Draw the bars."""
        self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        """Take the bars away."""
        self._bar.stop()

    def report(self, stage: str, done: int, total: int) -> None:
        """Advance a stage."""
        if stage not in self._tasks:
            self._tasks[stage] = self._bar.add_task(stage)
        self._bar.update(self._tasks[stage], completed=done, total=total)
        if done == total:
            self._console.print(f"{stage}: {total} done", highlight=False)

    def note(self, line: str) -> None:
        """Print a line."""
        self._console.print(line, markup=False, highlight=False, soft_wrap=True)


class TableProgress:
    """A table of what is done, drawn anew on a terminal; without one, only lines.

    Args:
        corner: name of the first column.
        header: names of the others.
    """

    def __init__(self, corner: str, header: Sequence[str]) -> None:
        """Create the table; it is drawn on standard error."""
        from rich.console import Console  # here, as the help of commands does not wait for rich
        from rich.live import Live

        self._console = Console(stderr=True)
        self._live = Live(console=self._console, auto_refresh=False)
        self._header = (corner, *header)

    def __enter__(self) -> "TableProgress":
        """Draw the table."""
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(self, *error: object) -> None:
        """Leave the table as it is."""
        self._live.stop()

    def show(self, rows: Sequence[Sequence[str]]) -> None:
        """Draw the rows in place of those before."""
        if self._live.is_started:
            self._live.update(self._drawn(rows), refresh=True)

    def note(self, line: str) -> None:
        """Print a line, above the table."""
        self._console.print(line, markup=False, highlight=False, soft_wrap=True)

    def _drawn(self, rows: Sequence[Sequence[str]]) -> "Table":
        from rich.table import Table  # here, as the help of commands does not wait for rich

        table = Table(*self._header)
        for row in rows:
            table.add_row(*row)
        return table
