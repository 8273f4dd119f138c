"""Networks: CTR-GCN as published, and its causal form."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from recognition.networks.causal import CausalCTRGCN as CausalCTRGCN
    from recognition.networks.ctrgcn import CTRGCN as CTRGCN
    from recognition.networks.spec import NetworkSpec as NetworkSpec
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "NetworkSpec": "recognition.networks.spec",
            "CTRGCN": "recognition.networks.ctrgcn",
            "CausalCTRGCN": "recognition.networks.causal",
        },
    )
