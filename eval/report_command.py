"""The command `ehar report`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class ReportCommand:
    """Write a finished run as one HTML file: figures, tables and replays, for any browser, without a network.

    For example:

    ehar report runs/duo-perfect-moving

    Args:
        run: folder of a run of ehar benchmark.
        out: the file to write; by default report.html in the run's folder.
    """

    run: Annotated[Path, tyro.conf.Positional]
    out: Path | None = None

    def __call__(self) -> None:
        """Write the report, and say where it is."""
        from eval.report import make_report

        print(f"written to {make_report(self.run, out=self.out)}")
