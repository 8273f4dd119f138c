"""The README and the pages of docs: their code, their commands, and whether those have their flags."""

import contextlib
import functools
import io
import re
import shlex
from pathlib import Path

import pytest

from eval.cli.command import Command
from eval.cli.commands.every import COMMANDS
from eval.cli.commands.group import CommandGroup
from eval.cli.main import main
from eval.cli.own_flags import fold_flags
from tests.helpers.places import ROOT

DOCS = ROOT / "docs"
README = ROOT / "README.md"
PAGES = (README, *sorted(DOCS.rglob("*.md")))

_FENCE = re.compile(r"^```(\w*)\n(.*?)^```", flags=re.DOTALL | re.MULTILINE)


def page_name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def python_blocks(page: Path) -> list[str]:
    return [code for language, code in _FENCE.findall(page.read_text()) if language == "python"]


def commands(page: Path) -> list[list[str]]:
    """Return the words after `ehar` of every command in the page's blocks; comments are left out."""
    blocks = "".join(code for language, code in _FENCE.findall(page.read_text()) if language != "python")
    lines = re.findall(r"^(?:\.venv/bin/)?ehar (.*)$", blocks.replace("\\\n", " "), flags=re.MULTILINE)
    return [shlex.split(line, comments=True) for line in lines]


def mentioned_commands(page: Path) -> list[list[str]]:
    """Return the words after `ehar` of every command between the text's backticks."""
    text = _FENCE.sub("", page.read_text())
    return [found.split() for found in re.findall(r"`ehar ([^`]+)`", text)]


def unknown_flags(words: list[str]) -> list[str]:
    """Return the flags of a command, or of a part of one, that it does not have; a command that is none fails."""
    found: CommandGroup | Command = COMMANDS
    named: list[str] = []
    rest = list(words)
    while isinstance(found, CommandGroup) and rest and re.fullmatch("[a-z][a-z-]*", rest[0]):
        assert rest[0] in found.commands, f"ehar {' '.join([*named, rest[0]])}: no such command"
        named.append(rest.pop(0))
        found = found.commands[named[-1]]
    folded = rest if isinstance(found, CommandGroup) else fold_flags(rest, found.options())
    flags, known = [word.partition("=")[0] for word in folded if word.startswith("--")], known_flags(tuple(named))
    return [flag for flag in flags if flag not in known]


def known_flags(words: tuple[str, ...]) -> set[str]:
    """Return the flags in the help of the command that the words name."""
    return set(re.findall(r"--[a-z][a-z-]*", help_of(words)))


@functools.cache
def help_of(words: tuple[str, ...]) -> str:
    shown = io.StringIO()
    with contextlib.redirect_stdout(shown), pytest.raises(SystemExit) as exited:
        main([*words, "--help"])
    assert exited.value.code == 0
    return shown.getvalue()
