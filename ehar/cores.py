"""How many processes this machine runs side by side."""

import os


def cores() -> int:
    """Return in how many processes a command runs by default."""
    return os.cpu_count() or 1
