"""How many examples a property is tried on; the profiles are in tests/conftest.py."""

from hypothesis import settings


def share_of_examples(share: float) -> settings:
    """Return the settings of a property that is slow to check: a share of the profile's examples."""
    return settings(max_examples=max(1, round(share * settings.default.max_examples)))
