import json
from pathlib import Path

import pytest
from eval.running.tracks import load_track, track_name

from ehar.errors import UsageError
from ehar.flight.vehicle import VEHICLES
from tests.helpers.vehicle_files import FILE_KEYS


def test_a_track_is_ideal_or_a_vehicle() -> None:
    assert load_track("ideal") is None
    assert track_name(None) == "ideal"
    for name, vehicle in VEHICLES.items():
        assert load_track(name) == vehicle
        assert track_name(vehicle) == name


def test_a_vehicle_file_is_a_track_by_its_name(tmp_path: Path) -> None:
    path = tmp_path / "slow.json"
    path.write_text(json.dumps(dict.fromkeys(FILE_KEYS, 2.0)))
    assert track_name(load_track(str(path))) == "slow"
    path.write_text(json.dumps({**dict.fromkeys(FILE_KEYS, 2.0), "jerk": 0}))
    with pytest.raises(UsageError, match=r"slow\.json: jerk: expected a number above 0, got 0"):
        load_track(str(path))


def test_a_vehicle_is_not_mistaken_for_the_grid(tmp_path: Path) -> None:
    path = tmp_path / "ideal.json"
    path.write_text(json.dumps(dict.fromkeys(FILE_KEYS, 2.0)))
    with pytest.raises(UsageError, match="expected another name of a vehicle file"):
        load_track(str(path))


@pytest.mark.parametrize("name", ["rail", "", "px4", "vehicle.yaml"])
def test_an_unknown_track_lists_the_known_ones(name: str) -> None:
    with pytest.raises(UsageError, match="expected ideal, px4-auto, px4-max, tracking-drone, or a vehicle file"):
        load_track(name)
