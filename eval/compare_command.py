"""The command `ehar compare`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from eval.commands import output_console
from eval.tables import Rendered


@dataclass(frozen=True)
class CompareCommand:
    """Compare the planners of two finished runs on the same episodes: run A minus run B.

    For example a recogniser or a planner before and after a change:

    ehar compare runs/before runs/after

    Args:
        run_a: folder of a run of ehar benchmark.
        run_b: folder of another, of the same data, starts, seed, length and sensor.
        planners: one planner of A and one of B; none compares each that is in both with itself.
    """

    run_a: Annotated[Path, tyro.conf.Positional]
    run_b: Annotated[Path, tyro.conf.Positional]
    planners: Annotated[tuple[str, ...], tyro.conf.arg(metavar="A B")] = ()

    def __call__(self) -> None:
        """Compare the runs, and print the table."""
        from eval.compare import compare
        from eval.compare_table import compare_table

        output_console().print(Rendered(compare_table(compare(self.run_a, self.run_b, self.planners))))
