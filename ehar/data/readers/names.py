"""Which files of a folder a reader takes, and their class, by their names."""

import re
from collections.abc import Mapping
from pathlib import Path

from ehar.errors import DataError, UsageError

LABEL = {"label": ".+"}


def visible_files(source: str | Path, *endings: str) -> list[Path]:
    """Return the files below a folder whose names end so, in capitals or not, sorted by path.

    What begins with a dot is hidden, and is left out, file or folder: macOS writes a `._walk_1.c3d` beside each
    `walk_1.c3d` that it copies to other disks or packs, there in a folder `__MACOSX`.

    Args:
        source: the folder.
        *endings: small, with their dots.
    """
    root = Path(source)
    return sorted(
        file
        for file in root.rglob("*")
        if file.name.lower().endswith(endings)
        and not any(part.startswith(".") or part == "__MACOSX" for part in file.relative_to(root).parts)
        and file.is_file()
    )


def matching_files(source: str | Path, ending: str, expected: str) -> list[Path]:
    """Return the visible files below a folder whose names end so.

    Raises:
        DataError: there are none.
    """
    files = visible_files(source, ending)
    if not files:
        raise DataError(f"{source}: got no *{ending}, expected {expected}")
    return files


def compiled(pattern: str, known: Mapping[str, str] = LABEL) -> re.Pattern[str]:
    """Return the pattern of a file's name as a regular expression with groups, of which `label` is one.

    Args:
        pattern: {label} is the class, other words in braces that are not known match anything.
        known: regular expressions of the words that have a group; a label is as long as the rest allows.

    Raises:
        UsageError: {label} is not in it once, or another known word is in it twice.
    """
    pieces = re.split(r"\{(\w+)\}", pattern)
    for word in known:
        count = pieces[1::2].count(word)
        if count > 1 or (word == "label" and not count):
            raise UsageError(f"pattern: got {pattern!r}, expected {{{word}}} in it once")
    fields = [f"(?P<{field}>{known[field]})" if field in known else ".+?" for field in pieces[1::2]]
    literals = [re.escape(piece) for piece in pieces[0::2]]
    return re.compile("".join(literal + field for literal, field in zip(literals, [*fields, ""], strict=True)))


def label_of(file: Path, regex: re.Pattern[str], pattern: str) -> str:
    """Return the class of a file by its name, whose ending may be in capitals.

    Raises:
        DataError: the name does not fit the pattern.
    """
    match = regex.fullmatch(file.name) or regex.fullmatch(file.stem + file.suffix.lower())
    if match is None:
        raise DataError(f"{file}: got a name that does not fit the pattern {pattern!r}")
    return match["label"]
