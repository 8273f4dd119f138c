"""The place of fixed-best, for tests of everything that it runs in."""

from pathlib import Path

import numpy as np

from ehar.conditions import Conditions
from ehar.world import PAPER, World
from planners.place.go_to_place import Place
from planners.place.storage import FixedPlace, fixed_place_path, save_fixed_place

PLACE = Place(0.3, float(np.radians(45)), float(np.radians(90)))


def fixed_place() -> FixedPlace:
    """Return a place that nobody fitted."""
    return FixedPlace(PLACE, "0123")


def save_place(models: Path, *, recogniser_sha256: str = "fake", world: World = PAPER, **history: str) -> Path:
    """Write the place to a models folder, and return the file."""
    path = fixed_place_path(models, Conditions())
    save_fixed_place(path, PLACE, recogniser_sha256=recogniser_sha256, history=history, world=world)
    return path
