"""The commands that read finished runs: `ehar analyse` and `ehar overview`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from eval.commands import output_console
from eval.tables import Rendered, markdown


@dataclass(frozen=True)
class AnalyseCommand:
    """Analyse a finished run as the paper does: predictability, where cameras were, and which moves they made.

    Args:
        run: folder of a run of ehar benchmark.
        planners: whose behaviour is shown beside that of no-act; none takes il-ppo, or else nbv.
        states: a learned planner, such as il-ppo/0, that runs its episodes once more, so that its states are mapped.
        out: folder for analysis.json, analysis.md and the pictures; by default analysis in the run's.
    """

    run: Annotated[Path, tyro.conf.Positional]
    planners: tuple[str, ...] = ()
    states: str | None = None
    out: Path | None = None

    def __call__(self) -> None:
        """Analyse the run, and print the tables."""
        from eval.analyse import FOLDER, analyse
        from eval.analyse_tables import analysis_tables

        analysis = analyse(self.run, planners=self.planners, states=self.states, out=self.out)
        output_console().print(Rendered(*analysis_tables(analysis)))
        print(f"written to {self.out or self.run / FOLDER}")


@dataclass(frozen=True)
class OverviewCommand:
    """Show several finished runs side by side: one column a run, one row a planner.

    Args:
        runs: folders of runs of ehar benchmark.
        planner: whose paired differences from the others are shown too.
        out: a Markdown file to write as well.
    """

    runs: Annotated[tuple[Path, ...], tyro.conf.Positional]
    planner: str | None = None
    out: Path | None = None

    def __call__(self) -> None:
        """Read the summaries and print the tables."""
        from eval.overview import difference_table, gap_table, read_overview
        from eval.results import write_text

        read = read_overview(self.runs)
        tables = [gap_table(read), *([] if self.planner is None else [difference_table(read, self.planner)])]
        output_console().print(Rendered(*tables))
        if self.out is not None:
            write_text(self.out, ["\n".join(markdown(table) for table in tables)])
