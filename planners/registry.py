"""The planners by name, and a user's own from a file."""

import importlib.util
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ehar.errors import UsageError
from ehar.planner import Planner
from planners.heuristic import HRotate, NoAct, Random, Towards, VRotate
from planners.oracle import Oracle, OracleLookahead

FILE_FORM = "path/to/file.py:ClassName"


def planner_names() -> tuple[str, ...]:
    """Return the names of the planners that come with the project, in the order of display."""
    return tuple(_constructors())


def make_planner(spec: str) -> Planner:
    """Return a new planner.

    Args:
        spec: one of `planner_names()`, or `path/to/file.py:ClassName` for a class of one's own, which is made
            without arguments.

    Raises:
        UsageError: the name is unknown, or the file does not define such a planner.
    """
    constructor = _constructors().get(spec)
    if constructor is not None:
        return constructor()
    path, colon, class_name = spec.rpartition(":")
    if not colon or not path.endswith(".py"):
        known = ", ".join(planner_names())
        raise UsageError(f"unknown planner {spec!r}; expected one of: {known}, or {FILE_FORM}")
    return _load_planner(Path(path), class_name)


def _constructors() -> dict[str, Callable[[], Planner]]:
    return {planner.name: planner for planner in (NoAct, Random, Towards, HRotate, VRotate, Oracle, OracleLookahead)}


def _load_planner(path: Path, class_name: str) -> Planner:
    """Run a user's file and make the planner it defines."""
    if not path.is_file():
        raise UsageError(f"planner file {path}: no such file; expected {FILE_FORM}")
    module_spec = importlib.util.spec_from_file_location(path.stem, path)
    if module_spec is None or module_spec.loader is None:
        raise UsageError(f"planner file {path}: Python cannot load it; expected {FILE_FORM}")
    module = importlib.util.module_from_spec(module_spec)
    try:
        module_spec.loader.exec_module(module)
    except Exception as error:
        raise UsageError(f"planner file {path}: {type(error).__name__} while it was loaded: {error}") from error
    classes: dict[str, Any] = {name: value for name, value in vars(module).items() if inspect.isclass(value)}
    if class_name not in classes:
        own = [name for name, value in classes.items() if value.__module__ == path.stem]
        raise UsageError(
            f"planner file {path}: expected a class {class_name!r}, it defines: {', '.join(own) or 'no class'}"
        )
    try:
        planner: Planner = classes[class_name]()
    except Exception as error:
        raise UsageError(
            f"planner {class_name} of {path}: {type(error).__name__} when made without arguments: {error}"
        ) from error
    missing = [part for part in ("name", "privileged", "reset", "act") if not hasattr(planner, part)]
    if missing:
        raise UsageError(
            f"planner {class_name} of {path}: expected what ehar.planner.Planner has, missing: {', '.join(missing)}"
        )
    return planner
