"""Names that a package offers at once but imports on first use, because some imports are slow."""

from collections.abc import Callable, Mapping
from importlib import import_module

Front = tuple[Callable[[str], object], Callable[[], list[str]], list[str]]


def lazy_exports(package: str, modules: Mapping[str, str]) -> Front:
    """Return `__getattr__`, `__dir__` and `__all__` of a package.

    The package imports the same names under `if TYPE_CHECKING:`, for mypy, editors and import-linter. No name may equal
    that of a module in the package: importing the module would replace the name.

    Args:
        package: the package's `__name__`.
        modules: the module that defines each name.
    """

    def get(name: str) -> object:
        if name not in modules:
            raise AttributeError(f"{package} has no {name!r}; it has: {', '.join(sorted(modules))}")
        return getattr(import_module(modules[name]), name)

    return get, lambda: sorted(modules), sorted(modules)
