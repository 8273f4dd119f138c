"""Searches for the best views, and for trajectories to them by optimal control."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from planners.search.next_best_view import NextBestView as NextBestView
    from planners.search.problem import TrajectoryProblem as TrajectoryProblem
    from planners.search.solver import TrajectorySolver as TrajectorySolver
    from planners.search.task import TrajectoryLimits as TrajectoryLimits
    from planners.search.task import TrajectoryTask as TrajectoryTask
    from planners.search.view_search import NextBestViewGreedy as NextBestViewGreedy
    from planners.search.view_search import NextBestViewSearch as NextBestViewSearch
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "NextBestView": "planners.search.next_best_view",
            "NextBestViewGreedy": "planners.search.view_search",
            "NextBestViewSearch": "planners.search.view_search",
            "TrajectoryProblem": "planners.search.problem",
            "TrajectorySolver": "planners.search.solver",
            "TrajectoryTask": "planners.search.task",
            "TrajectoryLimits": "planners.search.task",
        },
    )
