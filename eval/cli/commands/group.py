"""A group of commands: words that come before a command's own."""

from collections.abc import Mapping
from inspect import cleandoc
from typing import NamedTuple, Union

from eval.cli.command import Command


class CommandGroup(NamedTuple):
    """Commands that share their first words; its text has a first line and examples, as a command's has."""

    text: str
    commands: Mapping[str, Union["CommandGroup", Command]]

    @property
    def help(self) -> str:
        """The text above the list of its commands in its help."""
        return cleandoc(self.text)
