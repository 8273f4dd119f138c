"""The console of a command's results: standard output, as wide as the terminal, or wide without a terminal."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from eval.render.tables import Table

PIPED_WIDTH = 160  # columns where standard output is no terminal


def output_console() -> "Console":
    """Return the console that writes to standard output."""
    from rich.console import Console  # imported here: too slow for `ehar --help`

    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=PIPED_WIDTH)


def print_tables(*tables: "Table") -> None:
    """Print tables one below the other."""
    from eval.render.tables import Rendered  # imported here: it brings rich

    output_console().print(Rendered(*tables))
