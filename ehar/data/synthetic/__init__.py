"""Two built-in motion sets, `duo` and `solo`: different actors perform similar figures."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from ehar.data.synthetic.sets import duo as duo
    from ehar.data.synthetic.sets import solo as solo
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "duo": "ehar.data.synthetic.sets",
            "solo": "ehar.data.synthetic.sets",
        },
    )
