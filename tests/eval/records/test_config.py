"""A run's configuration is read back as it was written, or refused with its schema."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from ehar.errors import DataError, UsageError
from ehar.files import json_text
from ehar.flight.vehicle import VEHICLES
from eval.records.config import read_config
from eval.records.run_files import CONFIG, PlannerConfig, check_out
from tests.helpers.made_records import CONFIG_OF_RUN

OWN = PlannerConfig("mine(at=(1 2))", False, "mine.py:Mine", None, {"at": [1, 2], "on": None, "up": True}, "3")
FULL = replace(
    CONFIG_OF_RUN,
    track="px4-max",
    vehicle=VEHICLES["px4-max"],
    fps=30.0,
    planners=(PlannerConfig("no-act", False, "a.B"), PlannerConfig("il/0", False, "a.C", "2"), OWN),
    versions={"numpy": "2.0"},
    ideal="runs/ideal",
    recogniser="mine.py:Mine(gain=2)",
)


def write(directory: Path, content: Any) -> Path:
    (directory / CONFIG).write_text(json.dumps(content))
    return directory


def test_a_configuration_read_back_is_the_one_written(tmp_path: Path) -> None:
    for config in (CONFIG_OF_RUN, FULL):
        (tmp_path / CONFIG).write_text(json_text(asdict(config)))
        assert read_config(tmp_path) == config
    assert read_config(write(tmp_path, {**asdict(FULL), "fps": 30})).fps == 30
    assert read_config(write(tmp_path, {**asdict(FULL), "of tomorrow": 1})) == FULL


def test_a_run_from_before_schemas_is_read_where_it_has_all_fields(tmp_path: Path) -> None:
    config = replace(FULL, ideal=None, recogniser=None, planners=FULL.planners[:2])
    held = asdict(config)
    for name in ("schema", "ideal", "recogniser"):
        del held[name]
    for planner in held["planners"]:
        del planner["arguments"], planner["source_sha256"]
    assert read_config(write(tmp_path, held)) == config
    check_out(tmp_path, asdict(config))  # it may be written anew
    with pytest.raises(UsageError, match=r"holds another run, which differs in seed, planners \("):
        check_out(tmp_path, asdict(replace(config, seed=1, planners=FULL.planners)))
    del held["part"], held["readout"]
    message = (
        f"{tmp_path / CONFIG}: got no schema number and no readout, part, expected a run of ehar benchmark of "
        "schema 1; run the benchmark again with this version"
    )
    with pytest.raises(UsageError) as refused:
        read_config(write(tmp_path, held))
    assert str(refused.value) == message


def test_another_schema_is_refused(tmp_path: Path) -> None:
    write(tmp_path, {**asdict(CONFIG_OF_RUN), "schema": 2})
    with pytest.raises(UsageError, match=r"config\.json: got schema 2, expected a run of ehar benchmark of schema 1"):
        read_config(tmp_path)
    with pytest.raises(UsageError, match="holds a run of schema 2, expected 1; choose another --out"):
        check_out(tmp_path, asdict(CONFIG_OF_RUN))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seed": "none"}, "seed: expected int, got 'none'"),
        ({"seed": True}, "seed: expected int, got True"),
        ({"fps": "fast"}, "fps: expected float, got 'fast'"),
        ({"models": 3}, "models: expected str, got 3"),
        ({"source": None}, "source: expected str, got None"),
        ({"versions": {"numpy": 2}}, "versions: numpy: expected str, got 2"),
        ({"planners": {}}, "planners: expected tuple"),
        ({"planners": [{"name": "il"}]}, r"planners\[0\]: expected an object with name, privileged, implementation"),
        ({"vehicle": {"name": "drone"}}, "vehicle: expected an object with name, speed"),
        ({"vehicle": [1]}, "vehicle: expected an object with name, speed"),
    ],
)
def test_a_field_of_another_type_is_named(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(DataError, match=message):
        read_config(write(tmp_path, {**asdict(FULL), **changes}))


def test_what_is_no_configuration_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"config\.json: expected a run of ehar benchmark, got: No such file"):
        read_config(tmp_path)
    with pytest.raises(DataError, match="expected the JSON object of a run of ehar benchmark, got list"):
        read_config(write(tmp_path, []))
    (tmp_path / CONFIG).write_bytes(b"\xff")
    with pytest.raises(DataError, match="expected the JSON of a run of ehar benchmark"):
        read_config(tmp_path)
