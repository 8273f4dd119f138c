"""Gain models on disk: what is saved is loaded, and every unfit file ends in one line that names it."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from ehar.conditions import Conditions
from ehar.errors import ModelError
from ehar.flight.vehicle import VEHICLES
from planners.value.belief.clips import BeliefModel
from planners.value.model import FULL, GainModel, gain_model_path, load_gain_model, save_gain_model
from tests.helpers.fakes import tiny_data
from tests.helpers.gain_models import PAIRS, random_field, random_situation

HASH = "0123456789abcdef" * 4
MODEL = GainModel(
    {
        FULL: random_field(np.random.default_rng(0)),
        "no-facing": random_field(np.random.default_rng(1), parts=("ratio", "belief")),
    },
    BeliefModel(noise_weights=(0.5, 0.1, 0.2, 0.0, -0.3), process_noise=0.01, correlation=0.4),
    PAIRS,
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = gain_model_path(tmp_path, Conditions())
    save_gain_model(path, MODEL, recogniser_sha256=HASH, history={"seed": 0})
    return path


def load(path: Path, **changes: Any) -> GainModel:
    recogniser_sha256 = changes.pop("recogniser_sha256", HASH)
    data = tiny_data()
    return load_gain_model(Conditions(data=data, models=path.parent, **changes), data, recogniser_sha256)


def refusal(path: Path, **changes: Any) -> str:
    """Return the one line that loading ends in."""
    with pytest.raises(ModelError) as caught:
        load(path, **changes)
    message = str(caught.value)
    assert "\n" not in message
    return message


def test_a_field_of_a_vehicle_is_refused_to_another_one_of_its_name(tmp_path: Path) -> None:
    mine = replace(VEHICLES["px4-auto"], name="mine")
    path = gain_model_path(tmp_path, Conditions(track=mine))
    save_gain_model(path, MODEL, recogniser_sha256=HASH, history={}, vehicle=mine)
    load(path, track=mine)
    load(path, track=replace(mine, body=None))
    assert refusal(path, track=replace(mine, jerk=2.5)) == (
        f"{path}: learned with another vehicle that is called 'mine': its jerk was {mine.jerk:g}, now it is 2.5; train "
        "again, or give the other vehicle file another name"
    )


def test_a_field_of_before_vehicles_were_recorded_is_loaded(tmp_path: Path) -> None:
    path = gain_model_path(tmp_path, Conditions(track="px4-auto"))
    save_gain_model(path, MODEL, recogniser_sha256=HASH, history={})
    told = json.loads(path.with_suffix(".json").read_text())
    del told["vehicle"]
    path.with_suffix(".json").write_text(json.dumps(told))
    load(path, track="px4-auto")


def test_what_is_saved_is_loaded(path: Path) -> None:
    model = load(path)
    assert model.belief == MODEL.belief
    np.testing.assert_array_equal(model.pairs, PAIRS)
    assert list(model.fields) == list(MODEL.fields)
    situation = random_situation(np.random.default_rng(2))
    for name, field in MODEL.fields.items():
        assert model.fields[name].parts == field.parts
        assert model.fields[name].spread == field.spread
        np.testing.assert_array_equal(model.fields[name].weights(situation), field.weights(situation))
    assert sorted(path.parent.iterdir()) == [path.with_suffix(".json"), path]  # no temporary file
    assert json.loads(path.with_suffix(".json").read_text())["training"] == {"seed": 0}


def test_the_hash_is_that_of_both_files(path: Path) -> None:
    first = load(path).sha256
    assert load(path).sha256 == first
    assert len(first) == 64
    description = path.with_suffix(".json")
    description.write_text(description.read_text().replace('"correlation": 0.4', '"correlation": 0.5'))
    second = load(path).sha256
    tensors = load_file(path)
    save_file(tensors | {f"{FULL}.absolute": tensors[f"{FULL}.absolute"] * 2}, path)
    assert len({first, second, load(path).sha256}) == 3


def test_another_recogniser_is_refused(path: Path) -> None:
    message = refusal(path, recogniser_sha256="f" * 64)
    assert message.startswith(f"{path}: trained for another recogniser: its sha256 was 0123456789ab...")
    assert "ffffffffffff..." in message


@pytest.mark.parametrize("suffix", [".safetensors", ".json"])
def test_a_missing_file_is_named_with_the_command_that_makes_it(path: Path, suffix: str) -> None:
    path.with_suffix(suffix).unlink()
    message = refusal(path)
    assert message.startswith(f"{path.with_suffix(suffix)}: no such file")
    assert f"`ehar train gain-field --data X.npz --sensor perfect --views moving --models {path.parent}`" in message


def test_a_sensor_without_a_model(path: Path) -> None:
    assert "gain-field-estimator-moving.safetensors: no such file" in refusal(path, sensor="estimator")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda content: "", "expected the JSON of a gain field, as `ehar train gain-field` writes it, got "),
        (lambda content: "{", "expected the JSON of a gain field, as `ehar train gain-field` writes it, got "),
        (lambda content: "[1, 2]", "expected the JSON object of a gain field, "),
        (lambda content: "null", "expected the JSON object of a gain field, "),
        (lambda content: content[: len(content) // 2], "expected the JSON of a gain field, "),
        (lambda content: content.replace("recogniser_sha256", "sha256"), "missing recogniser_sha256, unknown sha256; "),
        (lambda content: content.replace('"trunk"', '"tree"'), "missing trunk, unknown tree; expected "),
        (lambda content: content.replace('"spread": 0', '"spread": "much 0'), "expected the JSON of a gain field, "),
        (lambda content: content.replace('"parts"', '"part"'), "fields.full: missing parts, unknown part; expected "),
        (lambda content: content.replace('"correlation": 0.4', '"correlation": 1.4'), "belief: correlation: expected "),
        (
            lambda content: content.replace('"correlation": 0.4', '"correlation": NaN'),
            "belief.correlation: expected a finite number, got nan",
        ),
        (lambda content: content.replace('"process_noise"', '"noise"'), "belief: unknown noise; expected log_scale, "),
    ],
)
def test_a_malformed_description(path: Path, change: Callable[[str], str], message: str) -> None:
    description = path.with_suffix(".json")
    content = description.read_text()
    assert change(content) != content
    description.write_text(change(content))
    assert refusal(path).startswith(f"{description}: {message}")


@pytest.mark.parametrize(
    "trunk", [[], [[1, 6]], [[-1, 2]], [1], [[1, 2], [3]], "hips", [["a", "b"]], None, {"left": 1}, [[1, 10**30]]]
)
def test_a_trunk_that_is_not_made_of_pairs_of_joints(path: Path, trunk: Any) -> None:
    description = path.with_suffix(".json")
    description.write_text(json.dumps(json.loads(description.read_text()) | {"trunk": trunk}))
    assert refusal(path).startswith(f"{description}: trunk")


def test_a_description_that_is_not_text(path: Path) -> None:
    path.with_suffix(".json").write_bytes(b"\xff\xfe\x00{")
    assert refusal(path).startswith(f"{path.with_suffix('.json')}: expected the JSON of a gain field, ")


@pytest.mark.parametrize("kept", [0, 5, 100, 5000])
def test_truncated_weights(path: Path, kept: int) -> None:
    path.write_bytes(path.read_bytes()[:kept])
    assert refusal(path).startswith(f"{path}: expected the gain fields full, no-facing, got ")


@pytest.mark.parametrize("matrix", ["full.absolute", "full.relative", "no-facing.absolute"])
@pytest.mark.parametrize(
    "change",
    [
        lambda tensor: None,
        lambda tensor: tensor[:, :-1],
        lambda tensor: tensor[:-1],
        lambda tensor: tensor[0],
        lambda tensor: tensor[0, 0],
        lambda tensor: np.where(np.arange(21) == 3, np.nan, tensor),
        lambda tensor: np.where(np.arange(21) == 3, np.inf, tensor),
    ],
)
def test_tensors_that_are_no_field(path: Path, matrix: str, change: Callable[[np.ndarray], Any]) -> None:
    tensors = load_file(path)
    tensor = change(tensors.pop(matrix))
    if tensor is not None:
        tensors[matrix] = np.ascontiguousarray(tensor) if np.ndim(tensor) else np.array(tensor)
    save_file(tensors, path)
    assert refusal(path).startswith(f"{path}: expected the gain fields full, no-facing, got ")


def test_unknown_parts(path: Path) -> None:
    description = path.with_suffix(".json")
    content = json.loads(description.read_text())
    content["fields"][FULL]["parts"] = ["mood"]
    description.write_text(json.dumps(content))
    message = refusal(path)
    assert message.startswith(f"{path}: expected the gain fields")
    assert "expected parts among ratio, history, belief, embedding, facing, got mood" in message
    content["fields"][FULL]["parts"] = "ratio"
    description.write_text(json.dumps(content))
    assert refusal(path) == f"{description}: fields.full.parts: expected a list, got 'ratio'"


@pytest.mark.parametrize("spread", [-1.0, float("nan"), float("inf"), 10**400])
def test_a_spread_that_is_no_weight(path: Path, spread: float) -> None:
    description = path.with_suffix(".json")
    content = json.loads(description.read_text())
    content["fields"][FULL]["spread"] = spread
    description.write_text(json.dumps(content))
    assert refusal(path).startswith(str(path.with_suffix("")))


def test_a_model_without_the_full_field(path: Path) -> None:
    partial = GainModel({"no-facing": MODEL.fields["no-facing"]}, MODEL.belief, PAIRS)
    save_gain_model(path, partial, recogniser_sha256=HASH, history={})
    assert refusal(path) == f"{path}: expected a gain field 'full', got no-facing"
