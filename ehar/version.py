"""The versions of installed packages and of ehar."""

from importlib.metadata import PackageNotFoundError, version

PACKAGES = ("ehar", "recognition", "planners", "eval")  # of this project


def package_version(name: str) -> str:
    """Return the version of a package, or that it is not installed, as in a plain source tree."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


__version__ = package_version("ehar")
