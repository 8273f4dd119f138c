"""The command line, `ehar`: it finds the command that the words name, and runs it."""

import errno
import operator
import os
import select
import signal
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Annotated, Any, NoReturn

import tyro
from tyro.conf import subcommand

from ehar.errors import EharError, UsageError
from eval.cli.command import Command
from eval.cli.commands.every import COMMANDS
from eval.cli.commands.group import CommandGroup
from eval.cli.own_flags import fold_flags


def parse(arguments: Sequence[str]) -> Callable[[], int | None]:
    """Return the command that the arguments name, ready to be called; it may return an exit code.

    tyro sees only that command, or the last group that the words name, so help and errors are about it alone.

    Raises:
        UsageError: there is no such command, or a flag of a class of your own has no value.
        SystemExit: help was printed (code 0), or tyro refused an option (2).
    """
    prog, words = "ehar", list(arguments)
    found: CommandGroup | Command = COMMANDS
    while isinstance(found, CommandGroup):
        if not words or words[0].startswith("-"):
            _end_at(found, prog, words)
        if words[0] not in found.commands:
            raise UsageError(f"unknown command '{prog} {words[0]}'; expected one of {', '.join(found.commands)}")
        prog, found = f"{prog} {words[0]}", found.commands[words.pop(0)]
    return found.parse(prog, fold_flags(words, found.options()))


@dataclass(frozen=True)
class _Listed:
    """Stands for each command of a group; the list of a group shows only a line for each."""


def _end_at(group: CommandGroup, prog: str, words: list[str]) -> NoReturn:
    """Print the help of a group and exit; without `--help`, print tyro's error and exit."""
    lines = {name: command.help.partition("\n")[0] for name, command in group.commands.items()}
    listed: Any = [Annotated[_Listed, subcommand(name, description=line)] for name, line in lines.items()]
    tyro.cli(reduce(operator.or_, listed), prog=prog, description=group.help, args=words)
    raise AssertionError(words)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command that the arguments name; errors that a user can mend exit with code 2, Ctrl-C with 130.

    SIGTERM counts as Ctrl-C: schedulers send it before they kill.
    """
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    if sys.stdout is None:  # it was closed, as by `>&-`
        sys.stdout = open(os.devnull, "w", encoding="utf-8")
    try:
        try:
            code = _run(arguments)
        finally:
            sys.stdout.flush()
        if code:
            sys.exit(code)
    except BrokenPipeError:
        _end_unread()
    except OSError as error:
        if error.errno != errno.ENOSPC:
            raise
        print(f"ehar: error: standard output, or a file: cannot be written: {error.strerror}", file=sys.stderr)
        _forget_output()
        sys.exit(2)
    except EharError as error:
        print(f"ehar: error: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt as interrupt:
        print(": ".join(("ehar: interrupted", *map(str, interrupt.args))), file=sys.stderr)
        sys.exit(130)


def _run(arguments: Sequence[str]) -> int | None:
    """Run the command that the arguments name, and return its exit code."""
    if arguments == ["--version"]:
        from ehar.version import __version__  # imported here: too slow for `ehar --help`

        print(f"ehar {__version__}")
        return None
    return parse(arguments)()


def _end_unread() -> NoReturn:
    """Exit as programs do whose output nobody reads on, as with `| head`; raise the error if another pipe broke."""
    watched = select.poll()
    watched.register(sys.stdout.fileno(), 0)
    if not watched.poll(0):
        raise
    _forget_output()
    sys.exit(128 + signal.SIGPIPE)


def _forget_output() -> None:
    """Let what is left of standard output be written nowhere at exit, where it can't be written."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    main()
