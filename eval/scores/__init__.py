"""Scores: pure functions of records."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from eval.scores.planner_summary import PlannerSummary as PlannerSummary
    from eval.scores.summary import Summary as Summary
    from eval.scores.summary import read_summary as read_summary
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "Summary": "eval.scores.summary",
            "read_summary": "eval.scores.summary",
            "PlannerSummary": "eval.scores.planner_summary",
        },
    )
