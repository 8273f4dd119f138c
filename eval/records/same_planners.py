"""Planners of one name in two runs: are they the same?"""

from collections.abc import Sequence
from typing import Any

from eval.records.config import PlannerConfig


def other_planner(
    wanted: Sequence[PlannerConfig], got: Sequence[PlannerConfig], *, retrained: bool = False
) -> str | None:
    """Return what differs in the first planner of both runs that is another, with both values; None if there is none.

    Args:
        wanted: planners of a run.
        got: planners of the other run.
        retrained: whether each run has weights of its own. Then hashes of weights may differ. Where they do, so may
            arguments that are text, as one may name the file of the weights.
    """
    named = {planner.name: planner for planner in got}
    for planner in wanted:
        other = named.get(planner.name, planner)
        weights, others = f"sha256 {planner.weights_sha256}", f"sha256 {other.weights_sha256}"
        own_weights = retrained and weights != others
        given, now = planner.arguments, other.arguments
        if own_weights and _without_text(given, now) == _without_text(now, given):
            given = now
        for what, expected, found in (
            ("weights of", weights, weights if retrained else others),
            ("file of", f"sha256 {planner.source_sha256}", f"sha256 {other.source_sha256}"),
            ("arguments of", str(given), str(now)),
        ):
            if expected != found:
                return f"the {what} {planner.name} differ: expected {expected}, got {found}"
    return None


def _without_text(arguments: dict[str, Any], others: dict[str, Any]) -> dict[str, Any]:
    """Return arguments without those that are text in both runs."""
    text = {name for name, value in arguments.items() if isinstance(value, str) and isinstance(others.get(name), str)}
    return {name: value for name, value in arguments.items() if name not in text}
