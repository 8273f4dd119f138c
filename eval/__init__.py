"""How well it went: the benchmark, its metrics, statistics and figures, and the command line."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from eval.conformance.motion import check_motion as check_motion
    from eval.conformance.planner import check_planner as check_planner
    from eval.conformance.recogniser import check_recogniser as check_recogniser
    from eval.conformance.sensor import check_sensor as check_sensor
    from eval.running.benchmark import benchmark as benchmark
    from eval.studies.headroom import headroom as headroom

_MODULES = {
    "benchmark": "eval.running.benchmark",
    "check_motion": "eval.conformance.motion",
    "check_planner": "eval.conformance.planner",
    "check_recogniser": "eval.conformance.recogniser",
    "check_sensor": "eval.conformance.sensor",
    "headroom": "eval.studies.headroom",
}


def __getattr__(name: str) -> object:
    """Import a function when it is asked for, as `ehar --help` imports this folder too and would wait for them all."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)
