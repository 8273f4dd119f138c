"""The commands that read finished runs: `ehar analyse` and `ehar overview`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from eval.cli.options import Out
from eval.render.console import print_tables


@dataclass(frozen=True)
class AnalyseCommand:
    """Analyse a finished run as the paper does.

    Tables of encoders and predictability; figures of views, moves and states.

    For example:
        ehar analyse runs/mine --states il-ppo/0

    Args:
        run: folder of a finished run.
        planners: whose behaviour is shown beside no-act's.
        states: agent whose states are mapped, such as il-ppo/0; it runs its episodes once more.
        out: folder for analysis.json, analysis.md and figures.
    """

    run: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    planners: Annotated[
        tuple[str, ...], tyro.conf.arg(metavar="PLANNER ...", help_behavior_hint="(default: il-ppo, or else nbv)")
    ] = ()
    states: Annotated[str | None, tyro.conf.arg(metavar="AGENT", help_behavior_hint="(default: none)")] = None
    out: Annotated[Path | None, tyro.conf.arg(help_behavior_hint="(default: RUN/analysis)")] = None

    def __call__(self) -> None:
        """Analyse the run, and print the tables."""
        from eval.studies.analyse import FOLDER, analyse
        from eval.studies.analysis import analysis_tables

        analysis = analyse(self.run, planners=self.planners, states=self.states, out=self.out)
        print_tables(*analysis_tables(analysis))
        print(f"written to {self.out or self.run / FOLDER}")


@dataclass(frozen=True)
class OverviewCommand:
    """Show several finished runs side by side.

    One row a planner, one column a run: the share of the gap that it closes.

    For example:
        ehar overview runs/duo runs/solo --planner nbv

    Args:
        runs: folders of finished runs.
        planner: whose paired differences from the others are shown too.
        out: Markdown file to write as well.
    """

    runs: Annotated[
        tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="RUN ...", help_behavior_hint="(at least one)")
    ]
    planner: Annotated[str | None, tyro.conf.arg(metavar="PLANNER", help_behavior_hint="(default: none)")] = None
    out: Out = None

    def __call__(self) -> None:
        """Read the summaries and print the tables."""
        from ehar.files import write_text
        from eval.render.tables import markdown
        from eval.studies.overview import difference_table, gap_table, read_overview

        read = read_overview(self.runs)
        tables = [gap_table(read), *([] if self.planner is None else [difference_table(read, self.planner)])]
        print_tables(*tables)
        if self.out is not None:
            write_text(self.out, [markdown(*tables)])
