"""Readers of original files: one file a format."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from ehar.data.readers.aistpp import prepare_aistpp as prepare_aistpp
    from ehar.data.readers.bvh import prepare_bvh as prepare_bvh
    from ehar.data.readers.expi import prepare_expi as prepare_expi
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "prepare_aistpp": "ehar.data.readers.aistpp",
            "prepare_bvh": "ehar.data.readers.bvh",
            "prepare_expi": "ehar.data.readers.expi",
        },
    )
