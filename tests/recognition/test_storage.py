"""Recognisers on disk: what is saved is loaded, every unfit file ends in one line, and what is shipped works."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from ehar.conditions import Conditions, Form
from ehar.data.any_source import BUILT_IN_STREAMS, load_recordings
from ehar.data.motion_data import MotionData
from ehar.data.scenario import split_parts
from ehar.data.skeleton import Skeleton
from ehar.data.source import BUILT_IN
from ehar.errors import ModelError
from ehar.sensors.registry import SENSORS, make_sensor
from recognition.calibration import Temperature
from recognition.networks.features import channel_count
from recognition.networks.spec import NetworkSpec
from recognition.storage import SHIPPED, load_recogniser, load_weights, recogniser_path, save_recogniser
from recognition.streaming import PrefixRecogniser, StreamingRecogniser
from recognition.training.clips import ClipSource
from tests.helpers.fakes import tiny_data
from tests.helpers.random_networks import randomised

LENGTH = 10
TEMPERATURE = Temperature((0.1, 0.2, 0.3, 0.4, 0.5))


def saved(folder: Path, form: Form = "causal") -> tuple[Path, torch.nn.Module]:
    """Save a network of tiny data; return the path of its weights, and the network."""
    spec = NetworkSpec.of(tiny_data(), form=form, size="small", length=LENGTH)
    network = spec.build()
    randomised(network)
    path = recogniser_path(folder, Conditions(form=form))
    save_recogniser(path, network, spec, TEMPERATURE, {"note": "for people"})
    return path, network


def load(folder: Path, data: MotionData | None = None, **changes: Any) -> StreamingRecogniser | PrefixRecogniser:
    return load_recogniser(Conditions(models=folder, **changes), data or tiny_data())


def refusal(folder: Path, data: MotionData | None = None, **changes: Any) -> str:
    """Return the one line that loading ends in."""
    with pytest.raises(ModelError) as caught:
        load(folder, data, **changes)
    message = str(caught.value)
    assert "\n" not in message
    return message


@pytest.mark.parametrize("form", ["causal", "ctrgcn"])
def test_what_is_saved_is_loaded(tmp_path: Path, form: Form) -> None:
    path, network = saved(tmp_path, form)
    recogniser = load(tmp_path, form=form)
    assert isinstance(recogniser, StreamingRecogniser if form == "causal" else PrefixRecogniser)
    assert recogniser.spec == NetworkSpec.of(tiny_data(), form=form, size="small", length=LENGTH)
    assert recogniser.temperature == TEMPERATURE
    made = type(recogniser)(network=network, spec=recogniser.spec, temperature=TEMPERATURE, sha256="")
    assert recogniser.fingerprint() == made.fingerprint()
    assert sorted(tmp_path.iterdir()) == [path.with_suffix(".json"), path]  # no temporary file


def test_loaded_weights_give_the_same_outputs(tmp_path: Path) -> None:
    path, network = saved(tmp_path)
    loaded = NetworkSpec.of(tiny_data(), form="causal", size="small", length=LENGTH).build(seed=1).eval()
    load_weights(path, loaded)
    x = torch.randn(2, LENGTH, 1, 6, channel_count(1, view=True), generator=torch.Generator().manual_seed(0))
    with torch.inference_mode():
        assert torch.equal(loaded(x), network(x))


def test_the_hash_tells_weights_and_temperatures_apart(tmp_path: Path) -> None:
    path, network = saved(tmp_path)
    first = load(tmp_path)
    assert load(tmp_path).sha256 == first.sha256
    save_recogniser(path, network, first.spec, Temperature(), {})
    recalibrated = load(tmp_path).sha256
    with torch.no_grad():
        next(network.parameters()).add_(1e-3)
    save_recogniser(path, network, first.spec, Temperature(), {})
    assert len({first.sha256, recalibrated, load(tmp_path).sha256}) == 3


@pytest.mark.parametrize("suffix", [".safetensors", ".json"])
def test_a_missing_file(tmp_path: Path, suffix: str) -> None:
    path, _ = saved(tmp_path)
    path.with_suffix(suffix).unlink()
    message = refusal(tmp_path)
    assert f"causal-perfect-moving{suffix}: no such file" in message
    assert "--sensor perfect --views moving --out" in message


def test_data_without_shipped_weights_asks_for_models() -> None:
    for data in (tiny_data(), replace(tiny_data(), name="duo", synthetic=False)):
        with pytest.raises(ModelError, match=f"no weights are shipped for '{data.name}': expected --models DIR"):
            load_recogniser(Conditions(), data)


@pytest.mark.parametrize("kept", [0, 4, 100, -1])
def test_truncated_weights(tmp_path: Path, kept: int) -> None:
    path, _ = saved(tmp_path)
    path.write_bytes(path.read_bytes()[:kept])
    assert refusal(tmp_path).startswith(f"{path}: expected the weights of a recogniser, got ")


def test_weights_of_another_network(tmp_path: Path) -> None:
    path, _ = saved(tmp_path)
    state = load_file(path)
    save_file({**state, "classify.weight": state["classify.weight"][:-1].contiguous()}, path)
    assert refusal(tmp_path).startswith(f"{path}: 1 tensors do not fit")
    assert "'classify.weight'" in refusal(tmp_path)
    save_file({**state, "extra": torch.zeros(1)}, path)
    assert "first 'extra'" in refusal(tmp_path)
    del state["classify.bias"]
    save_file(state, path)
    assert "first 'classify.bias'" in refusal(tmp_path)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_weights_that_are_not_finite(tmp_path: Path, bad: float) -> None:
    path, _ = saved(tmp_path)
    state = load_file(path)
    state["classify.bias"][1] = bad
    save_file(state, path)
    message = refusal(tmp_path)
    assert str(path) in message
    assert "'classify.bias'" in message
    assert "finite" in message


@pytest.mark.parametrize("content", ["", "{", "[]", "{}", '"text"', "null", "\x00"])
def test_broken_json(tmp_path: Path, content: str) -> None:
    path, _ = saved(tmp_path)
    path.with_suffix(".json").write_text(content)
    message = refusal(tmp_path)
    assert message.startswith(f"{path.with_suffix('.json')}: ")
    if content == "{}":
        assert message.endswith(": missing spec, log_temperatures, training; expected spec, log_temperatures, training")
    else:
        assert "of a recogniser, as `ehar train recogniser` writes it, got " in message


def test_json_that_is_not_text(tmp_path: Path) -> None:
    path, _ = saved(tmp_path)
    path.with_suffix(".json").write_bytes(b"\xff\xfe\x00")
    assert refusal(tmp_path).startswith(f"{path.with_suffix('.json')}: expected the JSON of a recogniser, ")


MISSING = object()


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        *(
            (field, MISSING, f"spec: missing {field}; expected form, size, ")
            for field in ("form", "size", "class_names", "skeleton", "persons", "fps", "length")
        ),
        ("form", "transformer", "spec.form: expected 'causal' or 'ctrgcn', got 'transformer'"),
        ("size", "huge", "spec.size: expected 'small', 'half' or 'published', got 'huge'"),
        ("class_names", "nod", "spec.class_names: expected a list, got 'nod'"),
        ("persons", "many", "spec.persons: expected a whole number, got 'many'"),
        ("persons", float("inf"), "spec.persons: expected a whole number, got inf"),
        ("fps", None, "spec.fps: expected a number, got null"),
        ("length", 0, "spec.length: expected at least 1, got 0"),
        ("skeleton", {"joint_names": ["a"]}, "spec.skeleton: missing bones; expected joint_names, bones"),
        ("skeleton", {"joint_names": ["a"], "bones": [[0, 1, 2]]}, "spec.skeleton.bones[0]: expected at most 2 items"),
    ],
)
def test_a_description_with_a_bad_field(tmp_path: Path, field: str, value: Any, message: str) -> None:
    path, _ = saved(tmp_path)
    file = path.with_suffix(".json")
    description = json.loads(file.read_text())
    if value is MISSING:
        del description["spec"][field]
    else:
        description["spec"][field] = value
    file.write_text(json.dumps(description))
    assert refusal(tmp_path).startswith(f"{file}: {message}")


@pytest.mark.parametrize("value", [[], [0.0] * 4, [0.0] * 6, [0.0, 0.0, float("nan"), 0.0, 0.0], "warm", None])
def test_temperatures_that_cannot_be_interpolated(tmp_path: Path, value: Any) -> None:
    path, _ = saved(tmp_path)
    file = path.with_suffix(".json")
    description = json.loads(file.read_text())
    description["log_temperatures"] = value
    file.write_text(json.dumps(description))
    assert refusal(tmp_path).startswith(f"{file}: log_temperatures")


def renamed(joint_names: tuple[str, ...], bones: tuple[tuple[int, int], ...]) -> Callable[[MotionData], MotionData]:
    return lambda data: replace(data, skeleton=Skeleton(joint_names, bones))


@pytest.mark.parametrize(
    ("field", "change"),
    [
        ("class_names", lambda data: replace(data, class_names=("nod", "left", "wave"))),
        ("class_names", lambda data: replace(data, class_names=("left", "nod", "right"))),
        ("joint_names", renamed(tuple("abcdef"), tiny_data().skeleton.bones)),
        ("bones", renamed(tiny_data().skeleton.joint_names, tiny_data().skeleton.bones[:-1])),
        ("persons", lambda data: tiny_data(persons=2)),
        ("fps", lambda data: replace(data, fps=30.0)),
    ],
)
def test_data_that_the_weights_were_not_made_for(
    tmp_path: Path, field: str, change: Callable[[MotionData], MotionData]
) -> None:
    path, _ = saved(tmp_path)
    message = refusal(tmp_path, change(tiny_data()))
    assert message.startswith(f"{path}: {field} ")
    assert "tiny" in message
    if field == "fps":
        assert message.endswith("expected --fps 25")


@pytest.mark.parametrize("changes", [{"sensor": "estimator"}, {"views": "paper"}, {"form": "ctrgcn"}])
def test_another_regime_is_another_file(tmp_path: Path, changes: dict[str, Any]) -> None:
    saved(tmp_path)
    assert "no such file" in refusal(tmp_path, **changes)


@pytest.fixture(scope="module", params=sorted(BUILT_IN))
def built_in(request: pytest.FixtureRequest) -> MotionData:
    return BUILT_IN[request.param]()


@pytest.mark.slow
@pytest.mark.parametrize("sensor", SENSORS)
def test_shipped_weights(built_in: MotionData, sensor: str) -> None:
    conditions = Conditions(sensor=sensor)
    recogniser = load_recogniser(conditions, built_in)
    path = recogniser_path(SHIPPED / built_in.name, conditions)
    assert path.stat().st_size <= 1_000_000
    training = json.loads(path.with_suffix(".json").read_text())["training"]
    assert training["data"] == built_in.title
    run = training["run"]
    assert (run["sensor"], run["views"], run["data_sha256"]) == (sensor, "moving", built_in.sha256)
    clips = ClipSource(
        data=built_in,
        sequences=split_parts(built_in).test,
        length=recogniser.spec.length,
        sensor=make_sensor(sensor, built_in),
        views="moving",
        form="causal",
        augment=False,
    ).draw(np.random.default_rng(0), 64)
    network = recogniser.spec.build().eval()
    load_weights(path, network)
    with torch.inference_mode():
        predicted = network(clips.features).argmax(dim=-1)
    accuracy = (predicted == clips.labels[:, None]).float().mean()
    assert accuracy > 0.6


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(BUILT_IN_STREAMS))
def test_shipped_weights_of_streams(name: str) -> None:
    conditions, streams = Conditions(sensor="estimator"), load_recordings(name)
    recogniser = load_recogniser(conditions, streams)
    assert isinstance(recogniser, StreamingRecogniser) and recogniser.spec.fading
    path = recogniser_path(SHIPPED / streams.name, conditions)
    training = json.loads(path.with_suffix(".json").read_text())["training"]
    assert (training["data"], training["run"]["data_sha256"]) == (streams.title, streams.sha256)


@pytest.mark.parametrize(
    ("name", "sensors"),
    [
        *((name, tuple(SENSORS)) for name in sorted(BUILT_IN)),
        *((name, ("estimator",)) for name in sorted(BUILT_IN_STREAMS)),
    ],
)
def test_nothing_else_is_shipped(name: str, sensors: tuple[str, ...]) -> None:
    expected = {
        recogniser_path(SHIPPED / name, Conditions(sensor=sensor)).with_suffix(suffix)
        for sensor in sensors
        for suffix in (".safetensors", ".json")
    }
    assert set((SHIPPED / name).iterdir()) == expected
