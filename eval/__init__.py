"""How well it went: the benchmark, its metrics, statistics and figures, and the command line."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from eval.conformance_planner import check_planner as check_planner
    from eval.conformance_recogniser import check_recogniser as check_recogniser
    from eval.fixed_views import headroom as headroom
    from eval.run import benchmark as benchmark

_MODULES = {
    "benchmark": "eval.run",
    "check_planner": "eval.conformance_planner",
    "check_recogniser": "eval.conformance_recogniser",
    "headroom": "eval.fixed_views",
}


def __getattr__(name: str) -> object:
    """Import a function when it is asked for, as `ehar --help` imports this folder too and would wait for them all."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)
