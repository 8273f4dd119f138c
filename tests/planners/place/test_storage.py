"""The place of fixed-best on disk: what is saved is loaded, and an unfit file ends in one line that names it."""

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest

from ehar.conditions import Conditions
from ehar.errors import ModelError
from ehar.world import INDOOR
from planners.place.storage import FixedPlace, fixed_place_path, load_fixed_place, save_fixed_place
from tests.helpers.fakes import tiny_data
from tests.helpers.fixed_places import PLACE, save_place


def load(path: Path, **told: Any) -> FixedPlace:
    data = tiny_data()
    return load_fixed_place(Conditions(data=data, models=path.parent, **told), data, "fake")


def refusal(path: Path, **told: Any) -> str:
    """Return the one line that loading ends in."""
    with pytest.raises(ModelError) as caught:
        load(path, **told)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_what_is_saved_is_loaded_with_its_hash(tmp_path: Path) -> None:
    path = save_place(tmp_path)
    fitted = load(path)
    assert fitted == FixedPlace(PLACE, hashlib.sha256(path.read_bytes()).hexdigest())
    planner = fitted.planner
    assert (planner.name, planner.place, planner.sha256) == ("fixed-best", PLACE, fitted.sha256)


def test_a_file_that_is_not_there_or_is_for_another_recogniser_sensor_or_view(tmp_path: Path) -> None:
    path = save_place(tmp_path, recogniser_sha256="another-recogniser")
    assert refusal(path) == (
        f"{path}: trained for another recogniser: its sha256 was another-reco..., this one's is fake...; fit it again"
    )
    for told, name in (({"sensor": "estimator"}, "estimator-moving"), ({"views": "paper"}, "perfect-paper")):
        line = refusal(path, **told)
        assert line.startswith(f"{tmp_path / f'fixed-best-{name}.json'}: no such file: expected a fixed place, ")
        assert "`ehar train fixed-best --data X.npz " in line


def test_a_place_of_another_world_is_refused_and_its_length_is_told(tmp_path: Path) -> None:
    path = fixed_place_path(tmp_path, Conditions())
    save_fixed_place(path, PLACE, recogniser_sha256="fake", history={"length": 40})
    assert load(path).planner.length == 40
    assert refusal(path, world="indoor").startswith(f"{path}: trained in the world paper (5 to 15 m")
    path.unlink()
    save_fixed_place(path, PLACE, recogniser_sha256="fake", history={}, world=INDOOR)
    assert load(path, world="indoor") == FixedPlace(PLACE, hashlib.sha256(path.read_bytes()).hexdigest(), None)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"distance": 1.5}, "place.distance: expected at most 1, got 1.5"),
        ({"distance": -0.1}, "place.distance: expected at least 0"),
        ({"polar": "level"}, "place.polar: expected a number"),
        ({"azimuth": "front"}, "place.azimuth: "),
        ({"absolute": 1}, "place.absolute: "),
        ({"height": 2}, "place: "),
    ],
)
def test_a_place_that_is_none(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    path = save_place(tmp_path)
    held = json.loads(path.read_text())
    held["place"] |= change
    path.write_text(json.dumps(held))
    assert refusal(path).startswith(f"{path}: {message}")


def test_half_a_file(tmp_path: Path) -> None:
    path = save_place(tmp_path)
    path.write_text(path.read_text()[:40])
    assert refusal(path).startswith(f"{path}: expected the JSON of a fixed place, as `ehar train fixed-best` writes it")
