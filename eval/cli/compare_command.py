"""The command `ehar compare`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from eval.render.console import print_tables


@dataclass(frozen=True)
class CompareCommand:
    """Compare two finished runs on the same episodes: A minus B.

    For example:
        ehar compare runs/before runs/after
        ehar compare runs/before runs/after --planners nbv il-ppo

    Args:
        run_a: folder of a finished run.
        run_b: folder of another, of the same data, starts, seed, length and sensor.
        planners: one of A and one of B.
    """

    run_a: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="A")]
    run_b: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="B")]
    planners: Annotated[
        tuple[str, ...],
        tyro.conf.arg(metavar="PLANNER-A PLANNER-B", help_behavior_hint="(default: each with itself)"),
    ] = ()

    def __call__(self) -> None:
        """Compare the runs, and print the table."""
        from eval.studies.compare import compare
        from eval.studies.compare_table import compare_table

        print_tables(compare_table(compare(self.run_a, self.run_b, self.planners)))
