"""The weights of planners: in a folder that the conditions name, or else those that ship."""

from pathlib import Path

from ehar.conditions import Conditions
from ehar.data.recordings import Recordings

SHIPPED = Path(__file__).parent / "weights"  # a folder for each built-in set


def weights_folder(conditions: Conditions, data: Recordings) -> Path:
    """Return the folder of the weights for some data; it need not exist."""
    return conditions.directory or SHIPPED / data.name
