"""The HTML report of a run."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from eval.reports.data import ReportData as ReportData
    from eval.reports.page import make_report as make_report
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "make_report": "eval.reports.page",
            "ReportData": "eval.reports.data",
        },
    )
