"""The place of `fixed-best` on disk: a small JSON file that names the recogniser which it was fitted for."""

import hashlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ehar.conditions import Conditions
from ehar.data.recordings import Recordings
from ehar.errors import ModelError
from ehar.files import json_text, read_json, write_text
from ehar.localisation import Localisation
from ehar.world import LATER, PAPER, World
from planners.place.go_to_place import GoToPlace, Place
from planners.shipped import weights_folder

FIXED_BEST = "fixed-best"


@dataclass(frozen=True)
class FixedPlace:
    """The place relative to people that is best on the validation part, for one recogniser and sensor.

    Args:
        place: the place.
        sha256: hash of the file, recorded beside results.
        length: number of frames of the episodes that it was chosen on; None in streams, or if it is not recorded.
        localisation: the localisation that it was chosen with; None in clips, which have none.
        data_sha256: hash of the data that it was chosen on; None if that is not recorded.
    """

    place: Place
    sha256: str
    length: int | None = None
    localisation: Localisation | None = None
    data_sha256: str | None = None

    @property
    def planner(self) -> GoToPlace:
        """A new planner that goes there."""
        return GoToPlace(
            name=FIXED_BEST,
            place=self.place,
            sha256=self.sha256,
            length=self.length,
            localisation=self.localisation,
        )


@dataclass(frozen=True)
class FixedPlaceDescription:
    """The content of the file.

    Args:
        recogniser_sha256: hash of the recogniser whose accuracy decided.
        place: the best place.
        training: how it was fitted, with the accuracy of each place; kept for people; only the length and the
            hash of the data are read back.
        world: the world that it was fitted in.
    """

    recogniser_sha256: str
    place: Place
    training: dict[str, Any]
    world: World


def fixed_place_path(directory: Path, conditions: Conditions) -> Path:
    """Return the path of the file in a models directory."""
    return directory / f"{FIXED_BEST}-{conditions.seen}.json"


def save_fixed_place(
    path: Path, place: Place, *, recogniser_sha256: str, history: dict[str, Any], world: World = PAPER
) -> None:
    """Save a place.

    Args:
        path: the JSON file.
        place: the best place.
        recogniser_sha256: hash of the recogniser whose accuracy decided.
        history: how it was fitted; kept for people; only the length is read back.
        world: the world that it was fitted in.
    """
    held = asdict(FixedPlaceDescription(recogniser_sha256, place, history, world))
    write_text(path, [json_text(held | {"world": world.to_json()})])


def load_fixed_place(conditions: Conditions, data: Recordings, recogniser_sha256: str) -> FixedPlace:
    """Load the place, and check that it belongs to the recogniser and the world.

    Args:
        conditions: conditions of the fit: folder, sensor, views and world.
        data: the data that it will be used on.
        recogniser_sha256: hash of the recogniser that it will work with.

    Raises:
        ModelError: the file is missing or malformed, or belongs to another recogniser or another world.
    """
    path = fixed_place_path(weights_folder(conditions, data), conditions)
    return open_fixed_place(path, conditions, recogniser_sha256)


def open_fixed_place(path: Path, conditions: Conditions, recogniser_sha256: str) -> FixedPlace:
    """Load the place without the data that it will be used on.

    Args:
        path: the JSON file.
        conditions: conditions of the fit: folder, sensor, views and world.
        recogniser_sha256: hash of the recogniser that it will work with.

    Raises:
        ModelError: as in `load_fixed_place`.
    """
    from recognition.weight_files import (  # imported here: it brings torch, which takes seconds
        check_trained_for,
        check_world,
    )

    if not path.is_file():
        command = f"`ehar train fixed-best {conditions.options} {conditions.models_option}`"
        raise ModelError(f"{path}: no such file: expected a fixed place, as made by {command}")
    what = "a fixed place, as `ehar train fixed-best` writes it"
    description = read_json(path, FixedPlaceDescription, what, optional=LATER, wrong=ModelError)
    check_world(path, description.world, conditions)
    check_trained_for(path, "recogniser", description.recogniser_sha256, recogniser_sha256, "fit it again")
    length, data_sha256 = (description.training.get(name) for name in ("length", "data_sha256"))
    known = isinstance(length, int) and not conditions.in_streams
    return FixedPlace(
        description.place,
        hashlib.sha256(path.read_bytes()).hexdigest(),
        length if known else None,
        description.world.localisation if conditions.in_streams else None,
        data_sha256 if isinstance(data_sha256, str) else None,
    )
