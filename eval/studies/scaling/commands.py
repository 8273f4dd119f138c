"""Commands of ehar as `make -n` prints them, and which of them wait for which."""

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf
from pathlib import PurePath

from ehar.errors import UsageError

_CALL = re.compile(r"bin/ehar\s+(.*)", flags=re.DOTALL)
_LOOP = re.compile(r"for (\w+) in ([^;]*); do(.*?)\bdone\b", flags=re.DOTALL)
_ENDS = re.compile(r"&&|\|\||[;|\n]|\bdo\b")
_GROUPS = ("train", "study")  # whose second word is part of the command
_NUMBERS = {  # what options take whose numbers decide what a command costs
    **dict.fromkeys(("clips", "length", "starts"), "a whole number of at least 1"),
    "seeds": "whole numbers of at least 0",
    "fps": "a number above 0",
}


@dataclass(frozen=True)
class Asked:
    """A command.

    Args:
        kind: its words, such as `train gain-field`.
        places: what is named before the options: planners, or folders of runs.
        options: the words after each option, without its dashes.
    """

    kind: str
    places: tuple[str, ...]
    options: dict[str, tuple[str, ...]]

    def option(self, name: str, usual: str | None = None) -> str | None:
        """Return the first word after an option; `usual` if it is not there."""
        words = self.options.get(name)
        return words[0] if words else usual

    @cached_property
    def written(self) -> str | None:
        """The folder that it writes to; None if nobody waits for it."""
        folder = self.option("out", self.option("models") if self.kind.startswith("train") else None)
        return None if folder is None else str(PurePath(folder))

    @cached_property
    def named(self) -> frozenset[str]:
        """All words that may be folders which it reads."""
        return frozenset(str(PurePath(word)) for words in (self.places, *self.options.values()) for word in words)

    def waits_for(self, other: "Asked") -> bool:
        """Return whether it needs what a command before it writes. Planners are trained beside each other."""
        if other.written not in self.named:
            return False
        return not self.kind.startswith("train") or other.kind == "train recogniser"


def read_commands(text: str) -> list[Asked]:
    """Return the commands of ehar in a shell's text, in order; loops over words are run through.

    Raises:
        UsageError: a command has a quote that does not end; one around `;`, `|` or `&&` counts as such. Or what follows
            an option is not the number that it takes.
    """
    text = text.replace("\\\n", " ")
    text = _LOOP.sub(lambda loop: _unrolled(*loop.groups()), text)
    found = []
    for piece in _ENDS.split(text):
        call = _CALL.search(piece.strip())
        if call is not None:
            said = piece.strip()[:80]
            try:
                words = shlex.split(call[1], comments=True)
            except ValueError as error:  # a quote that does not end, as those around ; or | do here
                raise UsageError(f"got the command {said!r}, expected quotes that end") from error
            found.append(_asked(words))
            wrong = _wrong_number(found[-1])
            if wrong is not None:
                raise UsageError(f"got the command {said!r}, expected {wrong}")
    return found


def _wrong_number(asked: Asked) -> str | None:
    """Return what was expected of an option of a number, and what it got; None if each has its number."""
    for name, expected in _NUMBERS.items():
        for word in asked.options.get(name, ()):
            if not _fits(name, word):
                return f"--{name} and {expected}, got {word!r}"
    return None


def _fits(name: str, word: str) -> bool:
    """Return whether a word is a number that an option takes."""
    try:
        return 0 < float(word) < inf if name == "fps" else int(word) >= (name != "seeds")
    except ValueError:
        return False


def needs_of(commands: Sequence[Asked]) -> dict[int, tuple[int, ...]]:
    """Return which commands each command waits for, by their numbers."""
    return {
        number: tuple(before for before in range(number) if one.waits_for(commands[before]))
        for number, one in enumerate(commands)
    }


def _unrolled(name: str, words: str, body: str) -> str:
    said = (re.sub(rf"\$\{{?{name}\b\}}?", lambda _, word=word: word, body) for word in words.split())  # type: ignore[misc]
    return "\n".join(said)


def _asked(words: Sequence[str]) -> Asked:
    count = 2 if words and words[0] in _GROUPS else 1
    places, options, last = list[str](), dict[str, list[str]](), None
    for word in words[count:]:
        if word.startswith("--"):
            last = word[2:]
            options[last] = []
        elif last is None:
            places.append(word)
        else:
            options[last].append(word)
    return Asked(" ".join(words[:count]), tuple(places), {name: tuple(told) for name, told in options.items()})
