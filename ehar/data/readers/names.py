"""The class of a file, by a pattern of its name."""

import re
from pathlib import Path

from ehar.errors import DataError, UsageError


def compiled(pattern: str) -> re.Pattern[str]:
    """Return the pattern of a file's name as a regular expression with the group `label`.

    Args:
        pattern: {label} is the class, other words in braces match anything.

    Raises:
        UsageError: {label} is not in it once.
    """
    pieces = re.split(r"\{(\w+)\}", pattern)
    if pieces[1::2].count("label") != 1:
        raise UsageError(f"pattern: got {pattern!r}, expected {{label}} in it once")
    fields = [r"(?P<label>.+)" if field == "label" else ".+?" for field in pieces[1::2]]
    literals = [re.escape(piece) for piece in pieces[0::2]]
    return re.compile("".join(literal + field for literal, field in zip(literals, [*fields, ""], strict=True)))


def label_of(file: Path, regex: re.Pattern[str], pattern: str) -> str:
    """Return the class of a file by its name.

    Raises:
        DataError: the name does not fit the pattern.
    """
    match = regex.fullmatch(file.name)
    if match is None:
        raise DataError(f"{file}: got a name that does not fit the pattern {pattern!r}")
    return match["label"]
