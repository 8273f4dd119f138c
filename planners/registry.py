"""Makes planners by name: ours, and with `own_planner` a user's own."""

import re
from collections.abc import Callable
from typing import TYPE_CHECKING

from ehar.errors import UsageError
from ehar.planner import Planner
from ehar.plugins.class_spec import FORMS
from planners.agents.inputs import LEFT_OUT
from planners.heuristic import HRotate, NoAct, Random, Towards, VRotate
from planners.oracle import Oracle, OracleLookahead
from planners.own_planner import Origin, entry_point_names, make_own_planner, origin_of, own_spec
from planners.place.go_to_place import PLACES, GoToPlace
from planners.place.storage import FIXED_BEST

if TYPE_CHECKING:
    from planners.agents.agent import Agent
    from planners.place.storage import FixedPlace
    from planners.value.model import GainModel

HEURISTICS = (NoAct, Random, Towards, HRotate, VRotate)
VALUING = ("nbv-greedy", "nbv-search", "nbv")
LEARNED = ("il", "ppo", "il-ppo", "dagger")
ABLATED = tuple(f"{name}-no-{left}" for name in LEARNED for left in LEFT_OUT)  # Table 3
ORACLES = (Oracle, OracleLookahead)


def planner_names() -> tuple[str, ...]:
    """Return the names of the planners that come with the project, in the order of display."""
    heuristics, oracles = ([planner.name for planner in group] for group in (HEURISTICS, ORACLES))
    return (*heuristics, *PLACES, FIXED_BEST, *VALUING, *LEARNED, *oracles)


def is_rule(spec: str) -> bool:
    """Return whether a planner of ours is a rule: it values no view, is no trained agent and is not told the truth."""
    return spec in (*(planner.name for planner in HEURISTICS), *PLACES, FIXED_BEST)


def is_privileged(spec: str) -> bool:
    """Return whether a planner of ours is told the truth."""
    return spec in (planner.name for planner in ORACLES)


def needs_gain_model(spec: str) -> bool:
    """Return whether a planner values views, and so needs a trained gain model."""
    return spec in VALUING


def needs_fixed_place(spec: str) -> bool:
    """Return whether a planner goes to a place that has to be fitted first."""
    return spec == FIXED_BEST


def is_learned(spec: str) -> bool:
    """Return whether a planner is a trained agent: one of `LEARNED` or `ABLATED`, or one training of it, as il/0."""
    name, slash, seed = spec.partition("/")
    return name in (*LEARNED, *ABLATED) and (not slash or re.fullmatch("0|[1-9][0-9]*", seed) is not None)


def is_ours(spec: str) -> bool:
    """Return whether a planner comes with the project; a user's own planner cannot take its name."""
    return spec in planner_names() or is_learned(spec)


def check_spec(spec: str) -> None:
    """Raise a UsageError that lists the known planners, unless `resolve_planner` might make this one."""
    if not is_ours(spec) and own_spec(spec) is None:
        raise UsageError(_unknown(spec))


def resolve_planner(
    spec: str | Planner,
    load_model: Callable[[], "GainModel"] | None = None,
    load_agent: Callable[[str], "Agent"] | None = None,
    load_place: Callable[[], "FixedPlace"] | None = None,
) -> tuple[Planner, Origin | None]:
    """Return the planner of a spec, and its origin if it is not ours.

    Args:
        spec: a planner, which is taken as it is; the name of one of ours or of an entry point in the group
            `ehar.planners`; or `path/to/file.py:Class` or `package.module:Class`, with or without
            `(argument=value, ...)`.
        load_model: loads the gain model; called only for planners that value views, and for a user's own planners
            that ask for it.
        load_agent: loads an agent by its name; called only for learned planners.
        load_place: loads the place of `fixed-best`; called only for it.

    Raises:
        UsageError: the name is unknown, the planner cannot be made, or it needs one of the three and there is none.
        ModelError: one of the three raises it.
    """
    if not isinstance(spec, str):
        return spec, origin_of(spec)
    own = None if is_ours(spec) else own_spec(spec)
    if own is not None:
        return make_own_planner(own, load_model)
    return make_planner(spec, load_model, load_agent, load_place), None


def make_planner(
    spec: str,
    load_model: Callable[[], "GainModel"] | None = None,
    load_agent: Callable[[str], "Agent"] | None = None,
    load_place: Callable[[], "FixedPlace"] | None = None,
) -> Planner:
    """Make one of our planners.

    Args:
        spec: one of `planner_names()`, or a name for which `is_learned` is true.
        load_model: loads the gain model; called only for planners that value views.
        load_agent: loads an agent by its name; called only for learned planners.
        load_place: loads the place of `fixed-best`; called only for it.

    Raises:
        UsageError: the name is not one of ours, a planner that values views is made without `load_model`, a learned
            one without `load_agent`, or `fixed-best` without `load_place`.
        ModelError: one of the three raises it.
    """
    for planner in (*HEURISTICS, *ORACLES):
        if planner.name == spec:
            return planner()
    if spec in PLACES:
        return GoToPlace(name=spec, place=PLACES[spec])
    if needs_fixed_place(spec):
        if load_place is None:
            raise UsageError(f"planner {spec!r}: expected a fitted place, got none")
        return load_place().planner
    if spec in VALUING:
        if load_model is None:
            raise UsageError(f"planner {spec!r}: expected a gain model to value views with, got none")
        return _make_valuing(spec, load_model())
    if is_learned(spec):
        if load_agent is None:
            raise UsageError(f"planner {spec!r}: expected a trained agent, got none")
        return load_agent(spec)
    raise UsageError(_unknown(spec))


def _unknown(spec: str) -> str:
    known = ", ".join(dict.fromkeys((*planner_names(), *entry_point_names())))
    return f"unknown planner {spec!r}; expected one of: {known}, or {FORMS}"


def _make_valuing(name: str, model: "GainModel") -> Planner:
    # Imported here: they load scipy and CasADi, and a list of names does not wait for that.
    from planners.search.next_best_view import NextBestView
    from planners.search.view_search import NextBestViewGreedy, NextBestViewSearch

    if name == "nbv":
        return NextBestView(model=model)
    return NextBestViewGreedy(model=model) if name == "nbv-greedy" else NextBestViewSearch(model=model)
