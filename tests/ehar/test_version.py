"""The versions that a run notes."""

import numpy as np

import ehar
from ehar.version import package_version


def test_versions_are_those_of_the_installed_packages() -> None:
    assert package_version("numpy") == np.__version__
    assert package_version("ehar") == ehar.__version__
    assert package_version("no-such-package") == "not installed"
