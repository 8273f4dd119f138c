"""Obstacles: what stands in a world, hides people from cameras, and is kept clear of."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from ehar.obstacles.free_space import FreeSpace as FreeSpace
    from ehar.obstacles.shapes import MARGIN as MARGIN
    from ehar.obstacles.shapes import Box as Box
    from ehar.obstacles.shapes import Cylinder as Cylinder
    from ehar.obstacles.shapes import Obstacles as Obstacles
    from ehar.obstacles.surroundings import Surroundings as Surroundings
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "MARGIN": "ehar.obstacles.shapes",
            "Box": "ehar.obstacles.shapes",
            "Cylinder": "ehar.obstacles.shapes",
            "Obstacles": "ehar.obstacles.shapes",
            "FreeSpace": "ehar.obstacles.free_space",
            "Surroundings": "ehar.obstacles.surroundings",
        },
    )
