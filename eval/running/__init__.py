"""Running the benchmark: episodes, planners, jobs and processes."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from eval.running.episodes import Episodes as Episodes
    from eval.running.jobs import Workload as Workload
    from eval.running.recorder import Recorder as Recorder
    from eval.running.run import Run as Run
    from eval.running.run import read_run as read_run
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "Run": "eval.running.run",
            "read_run": "eval.running.run",
            "Episodes": "eval.running.episodes",
            "Workload": "eval.running.jobs",
            "Recorder": "eval.running.recorder",
        },
    )
