"""Verification: does a run's folder hold together?"""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from eval.verification.checks import Check as Check
    from eval.verification.checks import Verification as Verification
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "Check": "eval.verification.checks",
            "Verification": "eval.verification.checks",
        },
    )
