"""Rendering: tables, figures and colours."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from eval.render.palette import Theme as Theme
    from eval.render.tables import Cell as Cell
    from eval.render.tables import Rendered as Rendered
    from eval.render.tables import Table as Table
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "Cell": "eval.render.tables",
            "Table": "eval.render.tables",
            "Rendered": "eval.render.tables",
            "Theme": "eval.render.palette",
        },
    )
