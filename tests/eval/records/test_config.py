"""A run's configuration is read back as it was written, or refused with its schema."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ehar.errors import DataError, UsageError
from ehar.files import json_text
from ehar.flight.vehicle import VEHICLES
from eval.records.config import CONFIG, SCHEMA, PlannerConfig, RunConfig, joined_config, read_config
from eval.records.run_files import check_out
from tests.helpers.made_records import CONFIG_OF_RUN, config_of_run

OWN = PlannerConfig("mine(at=(1 2))", False, "mine.py:Mine", None, {"at": [1, 2], "on": None, "up": True}, "3")
FULL = config_of_run(
    track="px4-max",
    vehicle=VEHICLES["px4-max"],
    fps=30.0,
    planners=(PlannerConfig("no-act", False, "a.B"), PlannerConfig("il/0", False, "a.C", "2"), OWN),
    versions={"numpy": "2.0"},
    ideal="runs/ideal",
    recogniser="mine.py:Mine(gain=2)",
)


def with_told(config: RunConfig, **changes: Any) -> RunConfig:
    """Return a configuration under other conditions."""
    return replace(config, conditions=replace(config.conditions, **changes))


def write(directory: Path, content: Any) -> Path:
    (directory / CONFIG).write_text(json.dumps(content))
    return directory


def test_a_configuration_read_back_is_the_one_written(tmp_path: Path) -> None:
    for config in (CONFIG_OF_RUN, FULL):
        (tmp_path / CONFIG).write_text(json_text(config.to_json()))
        assert read_config(tmp_path) == config
    assert read_config(write(tmp_path, {**FULL.to_json(), "fps": 30})).conditions.fps == 30
    assert read_config(write(tmp_path, {**FULL.to_json(), "of tomorrow": 1})) == FULL


def test_a_run_from_before_schemas_is_refused_and_may_be_written_anew(tmp_path: Path) -> None:
    config = with_told(replace(FULL, ideal=None, planners=FULL.planners[:2]), recogniser=None)
    held = config.to_json()
    for name in ("schema", "ideal", "recogniser"):
        del held[name]
    for planner in held["planners"]:
        del planner["arguments"], planner["source_sha256"]
    write(tmp_path, held)
    check_out(tmp_path, config.to_json())
    with pytest.raises(UsageError, match=r"holds another run, which differs in seed, planners \("):
        check_out(tmp_path, with_told(replace(config, planners=FULL.planners), seed=1).to_json())
    del held["part"], held["readout"]
    message = (
        f"{tmp_path / CONFIG}: got no schema number and no readout, part, expected a run of ehar benchmark of "
        f"schema {SCHEMA}; run the benchmark again with this version"
    )
    with pytest.raises(UsageError) as refused:
        read_config(write(tmp_path, held))
    assert str(refused.value) == message


def test_another_schema_is_refused(tmp_path: Path) -> None:
    write(tmp_path, {**CONFIG_OF_RUN.to_json(), "schema": 1})
    with pytest.raises(UsageError, match=r"config\.json: got schema 1, expected a run of ehar benchmark of schema 2"):
        read_config(tmp_path)
    with pytest.raises(UsageError, match="holds a run of schema 1, expected 2; choose another --out"):
        check_out(tmp_path, CONFIG_OF_RUN.to_json())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seed": "none"}, "seed: expected a whole number, got 'none'"),
        ({"seed": True}, "seed: expected a whole number, got true"),
        ({"fps": "fast"}, "fps: expected a number, got 'fast'"),
        ({"models": 3}, "models: expected text, got 3"),
        ({"source": None}, "source: expected text, got null"),
        ({"versions": {"numpy": 2}}, r"versions\.numpy: expected text, got 2"),
        ({"planners": {}}, "planners: expected a list, got {}"),
        (
            {"planners": [{"name": "il"}]},
            r"planners\[0\]: missing privileged, implementation; expected name, privileged, implementation",
        ),
        ({"vehicle": {"name": "drone"}}, "vehicle: missing speed, .*; expected name, speed"),
        ({"vehicle": [1]}, r"vehicle: expected an object, got \[1\]"),
    ],
)
def test_a_field_of_another_type_is_named(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(DataError, match=message):
        read_config(write(tmp_path, {**FULL.to_json(), **changes}))


def test_what_is_no_configuration_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"config\.json: expected a run of ehar benchmark, got: No such file"):
        read_config(tmp_path)
    with pytest.raises(DataError, match=r"expected the JSON object of a run of ehar benchmark, got \[\]"):
        read_config(write(tmp_path, []))
    (tmp_path / CONFIG).write_bytes(b"\xff")
    with pytest.raises(DataError, match="expected the JSON of a run of ehar benchmark"):
        read_config(tmp_path)


@pytest.mark.parametrize("lengths", [(30, 60), (60, 30)])
def test_runs_that_are_made_one_warn_of_what_any_of_them_was_trained_at(lengths: tuple[int, int]) -> None:
    runs = [config_of_run(length=60, trained_lengths={"recogniser": frames}) for frames in lengths]
    joined = joined_config(runs)
    assert joined.trained_lengths == {"recogniser": 30}
    assert joined.length_note is not None and "30" in joined.length_note
