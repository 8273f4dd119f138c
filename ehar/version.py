"""The versions of installed packages, and ehar's own."""

from importlib.metadata import PackageNotFoundError, version


def package_version(name: str) -> str:
    """Return the version of an installed package; a source tree that is not installed has none."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


__version__ = package_version("ehar")
