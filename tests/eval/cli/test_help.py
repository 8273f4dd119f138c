"""Every command's help fits a screen and shows an example that parses."""

import io
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from math import ceil

import pytest

from eval.cli.command import Command
from eval.cli.commands.every import COMMANDS
from eval.cli.commands.group import CommandGroup
from eval.cli.main import main, parse

HEAVY = (
    "torch",
    "casadi",
    "matplotlib",
    "plotly",
    "ruckig",
    "scipy",
    "stable_baselines3",
    "rich",
    "pydantic",
    "pandas",
)
TOP = ("benchmark", "report", "replay", "live", "data", "train", "check", "compare", "verify", "study", "bench")
LINES = {100: 40, 80: 50}  # of a screen, by its columns
LINES_OF_ALL = 30  # for `ehar --help`


def helps(group: CommandGroup = COMMANDS, words: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield the words of each group and each command."""
    yield words
    for name, found in group.commands.items():
        yield from helps(found, (*words, name)) if isinstance(found, CommandGroup) else [(*words, name)]


EVERY = pytest.mark.parametrize("words", list(helps()), ids=lambda words: " ".join(("ehar", *words)))


def printed(words: tuple[str, ...], columns: int = 100) -> list[str]:
    """Return the help of a command as a terminal of so many columns shows it, as lines."""
    terminal = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")  # tyro draws boxes of other height where it is not
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(terminal):
        patch.setenv("COLUMNS", str(columns))
        with pytest.raises(SystemExit) as ended:
            main([*words, "--help"])
    assert ended.value.code == 0
    terminal.seek(0)
    return terminal.read().splitlines()


def examples(lines: list[str]) -> list[list[str]]:
    """Return the words of each example of a help."""
    found = [line.strip() for line in lines if line.strip().startswith("ehar ")]
    return [shlex.split(line, comments=True) for line in found]


def test_the_tree_is_walked_to_its_leaves() -> None:
    words = list(helps())
    assert {(), ("benchmark",), ("train", "agent"), ("data", "prepare"), ("data", "prepare", "bvh")} <= set(words)
    assert len(words) == len(set(words))


def test_what_a_newcomer_needs_first_stands_first() -> None:
    assert tuple(COMMANDS.commands) == TOP
    rows = [line.split("•")[1].split()[0] for line in printed(()) if "•" in line]
    assert tuple(rows) == TOP


@EVERY
def test_every_flag_is_explained(words: tuple[str, ...]) -> None:
    found: CommandGroup | Command = COMMANDS
    for word in words:
        assert isinstance(found, CommandGroup)
        found = found.commands[word]
    if isinstance(found, Command):
        assert [name for name, leaf in found.leaves().items() if not found.text_of(leaf)] == []


@EVERY
@pytest.mark.parametrize("columns", [100, 80])
def test_it_fits_a_screen(words: tuple[str, ...], columns: int) -> None:
    usage, *rest = printed(words, columns)
    assert max(map(len, rest)) <= columns  # a terminal would break them within words
    assert ceil(len(usage) / columns) + len(rest) <= (LINES[columns] if words else LINES_OF_ALL)


@EVERY
def test_it_shows_an_example_that_parses(words: tuple[str, ...]) -> None:
    shown = examples(printed(words))
    assert shown
    for example in shown:
        assert example[: len(words) + 1] == ["ehar", *words]
        if example[-1] == "--help":
            with pytest.raises(SystemExit) as ended:
                parse(example[1:])
            assert ended.value.code == 0
        else:
            assert callable(parse(example[1:]))


@pytest.mark.parametrize("words", [words for words in helps() if words and words[0] == "study"], ids=" ".join)
def test_a_study_that_watches_streams_says_how_long_their_episodes_are(words: tuple[str, ...]) -> None:
    lines = printed(words)
    text = " ".join(" ".join(line.strip("│ ") for line in lines).split())
    if any("-stream" in example for line in examples(lines) for example in line):
        assert "(default: 60)" not in text


def test_the_first_example_is_the_benchmark() -> None:
    assert examples(printed(()))[0] == shlex.split("ehar benchmark --data duo")


@pytest.mark.parametrize("words", [words for words in helps() if words], ids=" ".join)
def test_its_group_lists_it_in_one_line(words: tuple[str, ...]) -> None:
    found: CommandGroup | Command = COMMANDS
    for word in words:
        assert isinstance(found, CommandGroup)
        found = found.commands[word]
    text = found.help
    rows = [line.strip("│ ").split(maxsplit=2) for line in printed(words[:-1], 80) if "•" in line]
    assert ["•", words[-1], text.splitlines()[0]] in rows


def test_it_waits_for_nothing_that_only_running_needs() -> None:
    code = f"""if True:
        import sys
        from eval.cli.main import main
        for words in ([], ["benchmark"], ["train", "agent"]):
            try:
                main([*words, "--help"])
            except SystemExit as ended:
                assert ended.code == 0
        assert not sys.modules.keys() & set({HEAVY})
    """
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")
