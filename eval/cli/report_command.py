"""The command `ehar report`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from eval.cli.options import AS_RECORDED


@dataclass(frozen=True)
class ReportCommand:
    """Write a finished run as one HTML file, for any browser.

    Tables, figures and replays; it needs neither a server nor a network.

    Of planners and recognisers of one's own it runs the files that the run names.

    For example:
        ehar report runs/duo-perfect-moving

    Args:
        run: folder of a finished run.
        out: file to write.
        data: where the run's data lie now.
        models: where its weights lie now.
    """

    run: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    out: Annotated[Path | None, tyro.conf.arg(help_behavior_hint="(default: RUN/report.html)")] = None
    data: Annotated[str | None, AS_RECORDED] = None
    models: Annotated[Path | None, AS_RECORDED] = None

    def __call__(self) -> None:
        """Write the report, and say where it is."""
        from eval.reports.page import make_report

        print(f"written to {make_report(self.run, out=self.out, data=self.data, models=self.models)}")
