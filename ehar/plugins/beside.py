"""Finds the modules beside a user's own file that it imports, because what they hold decides what it does."""

import ast
import sys
from collections.abc import Iterator, Sequence
from importlib.machinery import PathFinder
from pathlib import Path

from ehar.version import PACKAGES

INSTALLED = ("site-packages", "dist-packages")


def imported_from_beside(path: Path) -> list[Path]:
    """Return the files in the folder of a file, or below it, that it imports, directly or through one another.

    Import statements are read, wherever they stand, and nothing is run. So the answer depends on files alone, and not
    on what else a process has loaded. A module that is imported by a computed name is not found. What is installed, and
    what comes with Python or ehar, does not count.
    """
    own = _lying(path)
    found, left = set[Path](), [own]
    while left:
        for named in _imported(left.pop()):
            file = _lying(named)
            if file not in found and file != own and _counts(file, own.parent):
                found.add(file)
                left.append(file)
    return sorted(found)


def _lying(file: Path) -> Path:
    """Return a file by the folder in which it really lies; a link to a file lies where the link is."""
    return file.parent.resolve() / file.name


def _counts(file: Path, folder: Path) -> bool:
    return file.is_file() and file.is_relative_to(folder) and not set(INSTALLED) & set(file.parts)


def _imported(path: Path) -> Iterator[Path]:
    """Yield the files of the modules that a file imports, with those of their packages."""
    if path.suffix != ".py":
        return
    try:
        tree = ast.parse(path.read_bytes())
    except (SyntaxError, ValueError):
        return  # it cannot be imported
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield from _files(alias.name.split("."), None)
        elif isinstance(node, ast.ImportFrom):
            parts = node.module.split(".") if node.module else []
            within = None
            if node.level:
                package = path.parents[min(node.level, len(path.parents)) - 1]
                within = [str(package)]
                yield package / "__init__.py"
            for alias in node.names:
                yield from _files([*parts, alias.name], within)


def _files(parts: Sequence[str], within: Sequence[str] | None) -> Iterator[Path]:
    """Yield the files of a module and of the packages that it is in; the last part may be a name in the module.

    Args:
        parts: the parts of its name.
        within: folders of the package that the name begins in; None for a name that begins anywhere.
    """
    if within is None and (parts[0] in sys.stdlib_module_names or parts[0] in PACKAGES):
        return
    for part in parts:
        spec = PathFinder.find_spec(part, within)
        if spec is None:
            return
        if spec.origin is not None and spec.has_location:
            yield Path(spec.origin)
        if spec.submodule_search_locations is None:
            return
        within = list(spec.submodule_search_locations)
