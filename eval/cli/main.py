"""The command line, `ehar`: one command for each thing to do."""

import operator
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from inspect import cleandoc, getdoc
from typing import Annotated, Any, NamedTuple, NoReturn, Union

import tyro
from tyro.conf import DisallowNone, subcommand

from ehar.errors import EharError, UsageError
from eval.cli.analyse_commands import AnalyseCommand, OverviewCommand
from eval.cli.check_commands import CheckPlanner, CheckRecogniser
from eval.cli.commands import Bench, Benchmark, HeadroomCommand, TrainAgent, TrainAll, TrainGainField, TrainRecogniser
from eval.cli.compare_command import CompareCommand
from eval.cli.data_commands import Describe, PrepareAistpp, PrepareBvh, PrepareExpi
from eval.cli.nbv_commands import AblationCommand, BeliefCommand, Explain
from eval.cli.own_flags import fold_flags, options_of
from eval.cli.replay_command import ReplayCommand
from eval.cli.report_command import ReportCommand
from eval.cli.verify_commands import VerifyCommand

Command = type[Callable[[], None]]  # a dataclass: its fields are the options, calling it runs the command


class Group(NamedTuple):
    """Commands that share their first words. Its text is, as a command's docstring, a line and then examples."""

    text: str
    commands: Mapping[str, Union["Group", Command]]


PREPARE = Group(
    """Read motion files, and write a prepared .npz.

    For example:
        ehar data prepare aistpp AIST++ aistpp.npz
    """,
    {"bvh": PrepareBvh, "expi": PrepareExpi, "aistpp": PrepareAistpp},
)
DATA = Group(
    """Prepare motion data of your own, and describe it.

    For example:
        ehar data prepare bvh recordings mine.npz
        ehar data describe mine.npz
    """,
    {"prepare": PREPARE, "describe": Describe},
)
TRAIN = Group(
    """Train what planners need on data of your own.

    For example:
        ehar train all --data mine.npz --out models/mine
    """,
    {"all": TrainAll, "recogniser": TrainRecogniser, "gain-field": TrainGainField, "agent": TrainAgent},
)
CHECK = Group(
    """Check a planner or a recogniser of your own.

    For example:
        ehar check planner ./spiral.py:Spiral
    """,
    {"planner": CheckPlanner, "recogniser": CheckRecogniser},
)
COMMANDS = Group(
    """Embodied human activity recognition: which planner of views recognises earliest?

    For example:
        ehar benchmark --data duo  # all planners, on a synthetic set that ships
        ehar benchmark --help      # its options and examples; so each command
    """,
    {  # what a newcomer needs first stands first
        "benchmark": Benchmark,
        "report": ReportCommand,
        "replay": ReplayCommand,
        "data": DATA,
        "train": TRAIN,
        "check": CHECK,
        "compare": CompareCommand,
        "overview": OverviewCommand,
        "verify": VerifyCommand,
        "analyse": AnalyseCommand,
        "explain": Explain,
        "headroom": HeadroomCommand,
        "ablation": AblationCommand,
        "belief": BeliefCommand,
        "bench": Bench,
    },
)
TAKES_OWN = (Benchmark, CheckPlanner, CheckRecogniser)  # flags that follow a class of one's own are its arguments


def parse(arguments: Sequence[str]) -> Callable[[], None]:
    """Return the command that the arguments name, ready to be called.

    tyro is shown only that command, or the group where the words end: help and errors speak of it alone.

    Raises:
        UsageError: there is no such command, or a flag of a class of one's own has no value.
        SystemExit: help was printed (code 0), or tyro refused an option (2).
    """
    prog, words = "ehar", list(arguments)
    found: Group | Command = COMMANDS
    while isinstance(found, Group):
        if not words or words[0].startswith("-"):
            _end_at(found, prog, words)
        if words[0] not in found.commands:
            raise UsageError(f"unknown command '{prog} {words[0]}'; expected one of {', '.join(found.commands)}")
        prog, found = f"{prog} {words[0]}", found.commands[words.pop(0)]
    if found in TAKES_OWN:
        words = fold_flags(words, options_of(found))
    return tyro.cli(found, prog=prog, args=words, config=(DisallowNone,))


@dataclass(frozen=True)
class _Listed:
    """Stands for each command of a group: none is parsed, as its line says all that a list shows."""


def _end_at(group: Group, prog: str, words: list[str]) -> NoReturn:
    """Print the help of a group, or tyro's error where the words are no `--help`, and exit."""
    lines = {
        name: cleandoc(command.text if isinstance(command, Group) else getdoc(command) or "").partition("\n")[0]
        for name, command in group.commands.items()
    }
    listed: Any = [Annotated[_Listed, subcommand(name, description=line)] for name, line in lines.items()]
    tyro.cli(reduce(operator.or_, listed), prog=prog, description=cleandoc(group.text), args=words)
    raise AssertionError(words)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command that the arguments name; errors that a user can mend exit with code 2, Ctrl-C with 130."""
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    try:
        if arguments == ["--version"]:
            from eval.records.run_files import package_version

            print(f"ehar {package_version('ehar')}")
        else:
            parse(arguments)()
    except EharError as error:
        print(f"ehar: error: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt as interrupt:
        print(f"ehar: interrupted: {interrupt or 'nothing was written'}", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
