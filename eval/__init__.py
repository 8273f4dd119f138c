"""How well it went: the benchmark, its metrics, statistics and figures, and the command line."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from eval.conformance.data import check_data as check_data
    from eval.conformance.motion import check_motion as check_motion
    from eval.conformance.planner import check_planner as check_planner
    from eval.conformance.recogniser import check_recogniser as check_recogniser
    from eval.conformance.sensor import check_sensor as check_sensor
    from eval.live.watcher import Watcher as Watcher
    from eval.reports.page import make_report as make_report
    from eval.running.benchmark import benchmark as benchmark
    from eval.running.run import read_run as read_run
    from eval.studies.compare import compare as compare
    from eval.studies.headroom.study import headroom as headroom
    from eval.verification.verify import verify as verify
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "Watcher": "eval.live.watcher",
            "benchmark": "eval.running.benchmark",
            "check_data": "eval.conformance.data",
            "check_motion": "eval.conformance.motion",
            "check_planner": "eval.conformance.planner",
            "check_recogniser": "eval.conformance.recogniser",
            "check_sensor": "eval.conformance.sensor",
            "compare": "eval.studies.compare",
            "headroom": "eval.studies.headroom.study",
            "make_report": "eval.reports.page",
            "read_run": "eval.running.run",
            "verify": "eval.verification.verify",
        },
    )
