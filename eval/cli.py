"""The command line, `ehar`: one subcommand for each thing to do."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, cast

import tyro
from tyro.conf import OmitArgPrefixes, OmitSubcommandPrefixes, arg, subcommand

from ehar.errors import EharError
from eval.analyse_commands import AnalyseCommand, OverviewCommand
from eval.check_commands import CheckCommand, CheckPlanner, CheckRecogniser
from eval.commands import Bench, Benchmark, HeadroomCommand, TrainAgent, TrainAll, TrainGainField, TrainRecogniser
from eval.compare_command import CompareCommand
from eval.data_commands import Describe, PrepareAistpp, PrepareBvh, PrepareExpi
from eval.nbv_commands import AblationCommand, BeliefCommand, Explain
from eval.own_flags import fold_flags, options_of
from eval.replay_command import ReplayCommand
from eval.report_command import ReportCommand
from eval.results import package_version
from eval.verify_commands import VerifyCommand

Prepare = (
    Annotated[PrepareExpi, subcommand("expi")]
    | Annotated[PrepareAistpp, subcommand("aistpp")]
    | Annotated[PrepareBvh, subcommand("bvh")]
)


@dataclass(frozen=True)
class PrepareCommand:
    """Read original files and write a prepared .npz."""

    source_format: Annotated[Prepare, arg(name="")]

    def __call__(self) -> None:
        """Run the format's command."""
        self.source_format()


@dataclass(frozen=True)
class DataCommand:
    """Prepare motion data, and describe it."""

    action: Annotated[
        Annotated[PrepareCommand, subcommand("prepare")] | Annotated[Describe, subcommand("describe")], arg(name="")
    ]

    def __call__(self) -> None:
        """Run the action."""
        self.action()


@dataclass(frozen=True)
class TrainCommand:
    """Train a recogniser, and what planners learn with it."""

    action: Annotated[
        Annotated[TrainRecogniser, subcommand("recogniser")]
        | Annotated[TrainGainField, subcommand("gain-field")]
        | Annotated[TrainAgent, subcommand("agent")]
        | Annotated[TrainAll, subcommand("all")],
        arg(name=""),
    ]

    def __call__(self) -> None:
        """Run the training."""
        self.action()


Command = (
    Annotated[Benchmark, subcommand("benchmark")]
    | Annotated[HeadroomCommand, subcommand("headroom")]
    | Annotated[Explain, subcommand("explain")]
    | Annotated[AblationCommand, subcommand("ablation")]
    | Annotated[BeliefCommand, subcommand("belief")]
    | Annotated[AnalyseCommand, subcommand("analyse")]
    | Annotated[OverviewCommand, subcommand("overview")]
    | Annotated[CompareCommand, subcommand("compare")]
    | Annotated[VerifyCommand, subcommand("verify")]
    | Annotated[ReportCommand, subcommand("report")]
    | Annotated[ReplayCommand, subcommand("replay")]
    | Annotated[DataCommand, subcommand("data")]
    | Annotated[TrainCommand, subcommand("train")]
    | Annotated[CheckCommand, subcommand("check")]
    | Annotated[Bench, subcommand("bench")]
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command that the arguments name; errors that a user can mend exit with code 2, Ctrl-C with 130."""
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    if arguments == ["--version"]:
        print(f"ehar {package_version('ehar')}")
        return
    try:
        if arguments[:1] in (["benchmark"], ["check"]):
            arguments = fold_flags(arguments, options_of(Benchmark, CheckPlanner, CheckRecogniser))
        command = tyro.cli(
            cast(type[Callable[[], None]], Command),
            prog="ehar",
            description="Embodied human activity recognition: "
            "compare camera controllers on early activity recognition.",
            args=arguments,
            config=(OmitArgPrefixes, OmitSubcommandPrefixes),
        )
        command()
    except EharError as error:
        print(f"ehar: error: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt as interrupt:
        print(f"ehar: interrupted: {interrupt or 'nothing was written'}", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
