"""Conformance kits for a user's own classes."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from eval.conformance.checks import Conformance as Conformance
    from eval.conformance.checks import ContractCheck as ContractCheck
    from eval.conformance.data import check_data as check_data
    from eval.conformance.motion import check_motion as check_motion
    from eval.conformance.planner import check_planner as check_planner
    from eval.conformance.recogniser import check_recogniser as check_recogniser
    from eval.conformance.sensor import check_sensor as check_sensor
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "Conformance": "eval.conformance.checks",
            "ContractCheck": "eval.conformance.checks",
            "check_data": "eval.conformance.data",
            "check_motion": "eval.conformance.motion",
            "check_planner": "eval.conformance.planner",
            "check_recogniser": "eval.conformance.recogniser",
            "check_sensor": "eval.conformance.sensor",
        },
    )
