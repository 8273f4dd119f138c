"""Conformance kits for a user's own classes."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from eval.conformance.checks import Conformance as Conformance
    from eval.conformance.checks import ContractCheck as ContractCheck
    from eval.conformance.planner import check_planner as check_planner
    from eval.conformance.recogniser import check_recogniser as check_recogniser
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "Conformance": "eval.conformance.checks",
            "ContractCheck": "eval.conformance.checks",
            "check_planner": "eval.conformance.planner",
            "check_recogniser": "eval.conformance.recogniser",
        },
    )
