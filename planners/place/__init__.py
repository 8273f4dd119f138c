"""Goes to a place relative to people: near, level, at their front or side, or where validation says."""

from typing import TYPE_CHECKING

from ehar.lazy import lazy_exports

if TYPE_CHECKING:
    from planners.place.config import FixedBestConfig as FixedBestConfig
    from planners.place.go_to_place import GoToPlace as GoToPlace
    from planners.place.go_to_place import Place as Place
    from planners.place.people import PeopleTracker as PeopleTracker
    from planners.place.storage import FixedPlace as FixedPlace
else:
    __getattr__, __dir__, __all__ = lazy_exports(
        __name__,
        {
            "PeopleTracker": "planners.place.people",
            "Place": "planners.place.go_to_place",
            "GoToPlace": "planners.place.go_to_place",
            "FixedPlace": "planners.place.storage",
            "FixedBestConfig": "planners.place.config",
        },
    )
