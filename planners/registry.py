"""The planners by name, and a user's own from a file."""

import importlib.util
import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ehar.errors import UsageError
from ehar.planner import Planner
from planners.agent_inputs import ENCODED
from planners.heuristic import HRotate, NoAct, Random, Towards, VRotate
from planners.oracle import Oracle, OracleLookahead

if TYPE_CHECKING:
    from planners.agent import Agent
    from planners.gain_model import GainModel

HEURISTICS = (NoAct, Random, Towards, HRotate, VRotate)
VALUING = ("nbv-greedy", "nbv-search", "nbv")
LEARNED = ("il", "ppo", "il-ppo", "dagger")
ABLATED = tuple(f"{name}-no-{encoder}" for name in LEARNED for encoder in ENCODED)  # Table 3
ORACLES = (Oracle, OracleLookahead)
FILE_FORM = "path/to/file.py:ClassName"


def planner_names() -> tuple[str, ...]:
    """Return the names of the planners that come with the project, in the order of display."""
    return (*(planner.name for planner in HEURISTICS), *VALUING, *LEARNED, *(planner.name for planner in ORACLES))


def needs_gain_model(spec: str) -> bool:
    """Return whether a planner values views, for which something has to be trained."""
    return spec in VALUING


def is_learned(spec: str) -> bool:
    """Return whether a planner is a trained agent: one of `LEARNED` or `ABLATED`, or a single training of it, il/0."""
    name, slash, seed = spec.partition("/")
    return name in (*LEARNED, *ABLATED) and (not slash or re.fullmatch("0|[1-9][0-9]*", seed) is not None)


def check_spec(spec: str) -> None:
    """Raise a UsageError that lists what is known unless `make_planner` might make a planner of this."""
    path, colon, _ = spec.rpartition(":")
    if spec not in planner_names() and not is_learned(spec) and not (colon and path.endswith(".py")):
        known = ", ".join(planner_names())
        raise UsageError(f"unknown planner {spec!r}; expected one of: {known}, or {FILE_FORM}")


def make_planner(
    spec: str,
    load_model: Callable[[], "GainModel"] | None = None,
    load_agent: Callable[[str], "Agent"] | None = None,
) -> Planner:
    """Return a new planner.

    Args:
        spec: one of `planner_names()`, or `path/to/file.py:ClassName` for a class of one's own, which is made
            without arguments.
        load_model: called for planners that value views only.
        load_agent: called for learned planners only, with their name.

    Raises:
        UsageError: the name is unknown, the file does not define such a planner, or a planner that values views
            is made without `load_model`, or a learned one without `load_agent`.
        ModelError: from `load_model` or `load_agent`.
    """
    check_spec(spec)
    for planner in (*HEURISTICS, *ORACLES):
        if planner.name == spec:
            return planner()
    if spec in VALUING:
        if load_model is None:
            raise UsageError(f"planner {spec!r}: expected a gain model to value views with, got none")
        return _make_valuing(spec, load_model())
    if is_learned(spec):
        if load_agent is None:
            raise UsageError(f"planner {spec!r}: expected a trained agent, got none")
        return load_agent(spec)
    path, _, class_name = spec.rpartition(":")
    return _load_planner(Path(path), class_name)


def _make_valuing(name: str, model: "GainModel") -> Planner:
    # Here, as they bring scipy and CasADi, which a list of names does not wait for.
    from planners.next_best_view import NextBestView
    from planners.view_search import NextBestViewGreedy, NextBestViewSearch

    if name == "nbv":
        return NextBestView(model=model)
    return NextBestViewGreedy(model=model) if name == "nbv-greedy" else NextBestViewSearch(model=model)


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
