"""Names that a folder shows at once and imports when they are asked for, as some bring what takes long to import."""

from collections.abc import Callable, Mapping
from importlib import import_module

Front = tuple[Callable[[str], object], Callable[[], list[str]], list[str]]


def lazy_exports(package: str, modules: Mapping[str, str]) -> Front:
    """Return `__getattr__`, `__dir__` and `__all__` of a package.

    The package imports the same names under `if TYPE_CHECKING:`, for mypy, editors and import-linter. No name may be
    that of a module in the package: once that module is imported, it would take the name.

    Args:
        package: its `__name__`.
        modules: of each name, the module that defines it.
    """

    def get(name: str) -> object:
        if name not in modules:
            raise AttributeError(f"{package} has no {name!r}; it has: {', '.join(sorted(modules))}")
        return getattr(import_module(modules[name]), name)

    return get, lambda: sorted(modules), sorted(modules)
