"""A user's own classes: named on the command line, loaded from a file or a module, and made."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from ehar.plugins.class_spec import ClassSpec as ClassSpec
    from ehar.plugins.class_spec import parse_spec as parse_spec
    from ehar.plugins.constructor import construct as construct
    from ehar.plugins.loading import load_class as load_class
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "ClassSpec": "ehar.plugins.class_spec",
            "parse_spec": "ehar.plugins.class_spec",
            "load_class": "ehar.plugins.loading",
            "construct": "ehar.plugins.constructor",
        },
    )
