"""Vehicles: the named ones, vehicle files, and what is wrong with one."""

import json
import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from ehar.errors import UsageError
from ehar.flight.multicopter import Multicopter
from ehar.flight.vehicle import LIMITS, VEHICLES, Vehicle, load_vehicle
from tests.helpers.vehicle_files import FILE_KEYS

CONTENT = {
    "speed": 10,
    "acceleration": 4.5,
    "jerk": 9.0,
    "climb_speed": 4.0,
    "descent_speed": 2.0,
    "yaw_rate_deg": 90,
}


def written(folder: Path, content: Any) -> Path:
    path = folder / "mine.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def test_the_named_vehicles() -> None:
    assert set(VEHICLES) == {"px4-auto", "px4-max", "tracking-drone", "ground-robot"}
    for name, vehicle in VEHICLES.items():
        assert load_vehicle(name) is vehicle
        assert vehicle.name == name
    assert VEHICLES["tracking-drone"].acceleration == pytest.approx(9.81 * math.tan(math.radians(35)), abs=0.05)


def test_a_vehicle_file(tmp_path: Path) -> None:
    vehicle = load_vehicle(written(tmp_path, CONTENT))
    assert vehicle == Vehicle(
        name="mine", speed=10, acceleration=4.5, jerk=9, climb_speed=4, descent_speed=2, yaw_rate=math.pi / 2
    )
    assert load_vehicle(str(tmp_path / "mine.json")) == vehicle


@pytest.mark.parametrize("limit", LIMITS)
@pytest.mark.parametrize("value", [0, -1.0, 1e-5, 1e9, math.inf, math.nan, True, None, "fast"])
def test_every_limit_is_what_a_vehicle_may_have(limit: str, value: Any) -> None:
    with pytest.raises(UsageError, match=rf"vehicle 'px4-auto': expected a {limit} from [\d.e-]+ to [\d.e+]+, got "):
        replace(VEHICLES["px4-auto"], **{limit: value})


@pytest.mark.parametrize("key", FILE_KEYS)
@pytest.mark.parametrize("value", [0, -1.0, 1e-5, 1e9, math.inf, math.nan, True, None, "fast", [1]])
def test_every_limit_in_a_file_is_what_a_vehicle_may_have(tmp_path: Path, key: str, value: Any) -> None:
    expected = r"(at least 0\.01|at most 100000|a finite number|a number)"
    with pytest.raises(UsageError, match=rf"mine\.json: {key}: expected {expected}, got "):
        load_vehicle(written(tmp_path, CONTENT | {key: value}))
    for least_or_most in (0.01, 1e5):
        load_vehicle(written(tmp_path, CONTENT | {key: least_or_most}))


@pytest.mark.parametrize("key", FILE_KEYS)
def test_a_missing_key(tmp_path: Path, key: str) -> None:
    content = {other: value for other, value in CONTENT.items() if other != key}
    with pytest.raises(UsageError, match=rf"mine\.json: missing {key}; expected speed, .*yaw_rate_deg"):
        load_vehicle(written(tmp_path, content))


def test_an_unknown_key(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"mine\.json: unknown colour, yaw_rate; expected speed, "):
        load_vehicle(written(tmp_path, CONTENT | {"yaw_rate": 1.0, "colour": "red"}))


def test_what_is_no_vehicle_file(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"unknown vehicle 'px5'; expected one of: px4-auto, px4-max, tracking-drone"):
        load_vehicle("px5")
    with pytest.raises(UsageError, match=r"absent\.json: expected a vehicle file, got: No such file"):
        load_vehicle(tmp_path / "absent.json")
    with pytest.raises(UsageError, match=r"mine\.json: expected the JSON of a vehicle file, got "):
        load_vehicle(written(tmp_path, "{"))
    with pytest.raises(UsageError, match=r"mine\.json: expected the JSON object of a vehicle file, got \[1, 2\]"):
        load_vehicle(written(tmp_path, [1, 2]))


def test_a_vehicle_file_can_t_take_the_name_of_a_vehicle_of_ehar(tmp_path: Path) -> None:
    path = tmp_path / "px4-auto.json"
    path.write_text(json.dumps(CONTENT))
    with pytest.raises(UsageError, match=r"px4-auto\.json: expected another name of a vehicle file, 'px4-auto' is a"):
        load_vehicle(path)


def test_a_vehicle_is_plain_data() -> None:
    assert set(asdict(VEHICLES["px4-max"])) == {"name", *LIMITS, "body"}


def test_a_vehicle_file_may_have_a_body(tmp_path: Path) -> None:
    body = {"mass": 2, "rotor_area": 0.2, "drag_area": 0.04, "standby_power": 8.0, "sound_power_level": 90}
    assert load_vehicle(written(tmp_path, CONTENT)).body is None
    assert load_vehicle(written(tmp_path, CONTENT | {"body": body})).body == Multicopter(**body)
    with pytest.raises(UsageError, match=r"mine\.json: body: missing mass; expected mass, rotor_area, "):
        load_vehicle(written(tmp_path, CONTENT | {"body": {key: body[key] for key in body if key != "mass"}}))
    with pytest.raises(UsageError, match=r"mine\.json: body\.drag_area: expected a number above 0, got -1"):
        load_vehicle(written(tmp_path, CONTENT | {"body": body | {"drag_area": -1}}))
