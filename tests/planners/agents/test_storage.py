"""Agents on disk: what is saved is loaded, and what does not fit is named."""

import hashlib
import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from ehar.conditions import Conditions
from ehar.data.motion_data import MotionData
from ehar.data.skeleton import Skeleton
from ehar.errors import ModelError
from ehar.flight.vehicle import VEHICLES
from planners.agents.agent import Agent
from planners.agents.storage import agent_name, agent_path, agent_seeds, load_agent, save_agent
from tests.helpers.agents import random_observation, save_untrained, untrained_agent
from tests.helpers.fakes import CLASS_NAMES, SKELETON, tiny_context, tiny_data

DATA = tiny_data()


def load(directory: Path, data: MotionData = DATA, name: str = "il", *, recogniser: str = "fake") -> Agent:
    return load_agent(Conditions(data=data, models=directory), data, name, recogniser_sha256=recogniser, seed=0)


@pytest.mark.parametrize("name", ["il", "il-ppo", "il-ppo-no-vision"])
def test_what_is_saved_is_loaded(tmp_path: Path, name: str) -> None:
    path = save_untrained(tmp_path, DATA, name)
    agent, saved = load(tmp_path, name=name), untrained_agent(f"{name}/0")
    assert agent.name == name
    assert agent.network.spec == saved.network.spec
    for key, weight in saved.network.state_dict().items():
        assert torch.equal(agent.network.get_parameter(key), weight)
    content = path.read_bytes() + path.with_suffix(".json").read_bytes()
    assert agent.sha256 == hashlib.sha256(content).hexdigest()
    targets = []
    for one in (agent, saved):
        one.reset(tiny_context(episodes=5))
        targets.append(one.act(random_observation(np.random.default_rng(0))))
    np.testing.assert_array_equal(*targets)


def test_what_is_loaded_can_be_trained_on(tmp_path: Path) -> None:
    save_untrained(tmp_path, DATA, "il")
    network = load(tmp_path).network.train()
    sizes = vars(network.spec.sizes)
    state = network.state({name: torch.randn(4, size) for name, size in sizes.items()})
    (network.logits(state).sum() + network.value(state).sum()).backward()
    assert all(weight.grad is not None and not weight.is_meta for weight in network.parameters())


def test_how_it_was_trained_is_kept_beside_it_and_counts_for_the_hash(tmp_path: Path) -> None:
    path = save_untrained(tmp_path, DATA, "il")
    hashes = []
    for frames in (100, 200):
        history = {"frames": frames}
        save_agent(path, untrained_agent().network, DATA, recogniser_sha256="fake", history=history)
        hashes.append(load(tmp_path).sha256)
        assert json.loads(path.with_suffix(".json").read_text())["training"] == history
    assert hashes[0] != hashes[1]


@pytest.mark.parametrize("missing", [".safetensors", ".json"])
def test_a_missing_file_is_named_with_what_makes_it(tmp_path: Path, missing: str) -> None:
    path = save_untrained(tmp_path, DATA, "il").with_suffix(missing)
    path.unlink()
    with pytest.raises(ModelError, match=rf"{path.name}: no such file: .*`ehar train agent --data X.npz ") as error:
        load(tmp_path)
    assert f"--sensor perfect --views moving --models {tmp_path}`" in str(error.value)


def test_an_agent_of_a_vehicle_is_refused_to_another_one_of_its_name(tmp_path: Path) -> None:
    mine = replace(VEHICLES["px4-auto"], name="mine")
    told = Conditions(data=DATA, models=tmp_path, track=mine)
    path = agent_path(tmp_path, "il", told, 0)
    save_agent(path, untrained_agent().network, DATA, recogniser_sha256="fake", history={}, vehicle=mine)
    load_agent(told, DATA, "il", recogniser_sha256="fake", seed=0)
    faster = replace(told, track=replace(mine, speed=2 * mine.speed))
    with pytest.raises(ModelError, match=f"{path.name}: learned with another vehicle that is called 'mine': its speed"):
        load_agent(faster, DATA, "il", recogniser_sha256="fake", seed=0)


OTHER_MOTION = replace(DATA, positions=DATA.positions + np.float32(0.001))
OTHER_BODY = replace(DATA, skeleton=Skeleton(("nose", *SKELETON.joint_names[1:]), SKELETON.bones))
OTHER_CLASSES = replace(DATA, class_names=("shake", *CLASS_NAMES[1:]))


@pytest.mark.parametrize(
    ("data", "recogniser", "message"),
    [
        (OTHER_MOTION, "fake", f"another data set: .* {DATA.sha256[:12]}..., this one's is {OTHER_MOTION.sha256[:12]}"),
        (OTHER_BODY, "fake", r"another skeleton: \('head', .*, tiny has \('nose', "),
        (OTHER_CLASSES, "fake", r"another set of classes: \('nod', .*, tiny has \('shake', "),
        (DATA, "beef" * 16, "another recogniser: its sha256 was fake..., this one's is beefbeefbeef..."),
    ],
    ids=["data", "skeleton", "classes", "recogniser"],
)
def test_what_an_agent_was_not_trained_for_is_named(
    tmp_path: Path, data: MotionData, recogniser: str, message: str
) -> None:
    path = save_untrained(tmp_path, DATA, "il")
    with pytest.raises(ModelError, match=f"{path.name}: trained for {message}") as error:
        load(tmp_path, data, recogniser=recogniser)
    assert "\n" not in str(error.value)


def broken(change: Callable[[dict[str, Any]], Any]) -> Callable[[str], str]:
    """Return what changes the JSON's text by changing what it says."""

    def mutate(text: str) -> str:
        held = json.loads(text)
        return json.dumps(change(held) or held)

    return mutate


def setting(*keys: str, to: Any) -> Callable[[str], str]:
    def change(held: dict[str, Any]) -> None:
        for key in keys[:-1]:
            held = held[key]
        held[keys[-1]] = to

    return broken(change)


def without(*keys: str) -> Callable[[str], str]:
    def change(held: dict[str, Any]) -> None:
        for key in keys[:-1]:
            held = held[key]
        del held[keys[-1]]

    return broken(change)


MUTATIONS = {
    "cut short": (
        lambda text: text[: len(text) // 2],
        "expected the JSON of an agent, as `ehar train agent` writes it, got ",
    ),
    "empty": (lambda text: "", "expected the JSON of an agent, as `ehar train agent` writes it, got "),
    "a list": (lambda text: "[]", r"expected the JSON object of an agent, .* got \[\]"),
    "a number": (lambda text: "3", "expected the JSON object of an agent, .* got 3"),
    "no spec": (without("spec"), "missing spec; expected spec, recogniser_sha256, "),
    "no sizes": (without("spec", "sizes"), "spec: missing sizes; expected sizes, without, hindsight"),
    "no hindsight": (without("spec", "hindsight"), "spec: missing hindsight; expected sizes, "),
    "no hash": (without("recogniser_sha256"), "missing recogniser_sha256; expected spec, "),
    "no classes": (without("classes"), "missing classes; expected spec, "),
    "no skeleton": (setting("skeleton", to=None), "skeleton: expected a list, got null"),
    "spec a text": (setting("spec", to="large"), "spec: expected an object, got 'large'"),
    "sizes a list": (setting("spec", "sizes", to=[1, 2, 3]), r"spec.sizes: expected an object, got \[1, 2, 3\]"),
    "a size too many": (
        setting("spec", "sizes", "sound", to=3),
        "spec.sizes: unknown sound; expected recognition, vision, position",
    ),
    "a size a word": (
        setting("spec", "sizes", "vision", to="wide"),
        "spec.sizes.vision: expected a whole number, got 'wide'",
    ),
    "a size infinite": (
        setting("spec", "sizes", "vision", to=math.inf),
        "spec.sizes.vision: expected a whole number, got inf",
    ),
    "a size of 0": (setting("spec", "sizes", "vision", to=0), "agent: expected sizes of at least 1, got "),
    "a size below 0": (setting("spec", "sizes", "vision", to=-22), "agent: expected sizes of at least 1, got "),
    "an unknown encoder": (setting("spec", "without", to=["sound"]), "agent: without: expected some of "),
    "encoders as text": (setting("spec", "without", to="vision"), "spec.without: expected a list, got 'vision'"),
    "encoders a list of lists": (
        setting("spec", "without", to=[["vision"]]),
        r"spec.without\[0\]: expected text, got \['vision'\]",
    ),
    "no encoder left": (
        setting("spec", "without", to=["recognition", "vision", "position"]),
        "agent: without: expected some of ",
    ),
    "hindsight below 0": (
        setting("spec", "hindsight", to=-500),
        "agent: expected sizes of at least 1, got .* hindsight -500",
    ),
}


@pytest.mark.parametrize("mutation", MUTATIONS)
def test_a_broken_description_is_named_in_one_line(tmp_path: Path, mutation: str) -> None:
    description = save_untrained(tmp_path, DATA, "il").with_suffix(".json")
    description.write_text(MUTATIONS[mutation][0](description.read_text()))
    with pytest.raises(ModelError, match=rf"{description.name}: {MUTATIONS[mutation][1]}") as error:
        load(tmp_path)
    assert "\n" not in str(error.value)


def test_a_description_that_is_no_text_is_named(tmp_path: Path) -> None:
    description = save_untrained(tmp_path, DATA, "il").with_suffix(".json")
    description.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ModelError, match="expected the JSON of an agent, as `ehar train agent` writes it, got "):
        load(tmp_path)


@pytest.mark.parametrize(
    "mutation",
    [
        setting("spec", "sizes", "vision", to=23),
        setting("spec", "sizes", "recognition", to=10**12),  # takes no memory
        setting("spec", "without", to=["vision"]),
        setting("spec", "hindsight", to=5),
    ],
    ids=["another size", "an absurd size", "without an encoder", "with hindsight"],
)
def test_a_description_of_another_network_does_not_fit_the_weights(
    tmp_path: Path, mutation: Callable[[str], str]
) -> None:
    path = save_untrained(tmp_path, DATA, "il")
    path.with_suffix(".json").write_text(mutation(path.with_suffix(".json").read_text()))
    with pytest.raises(ModelError, match=rf"{path.name}: \d+ tensors do not fit .*, first '\w+\.\S+'$"):
        load(tmp_path)


@pytest.mark.parametrize("size", [10**17, 10**30])
def test_sizes_beyond_any_memory_end_in_one_line(tmp_path: Path, size: int) -> None:
    path = save_untrained(tmp_path, DATA, "il")
    description = path.with_suffix(".json")
    description.write_text(setting("spec", "sizes", "vision", to=size)(description.read_text()))
    with pytest.raises(ModelError, match=f"{path.name}: expected the weights of an agent") as error:
        load(tmp_path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("kept", [0, 5, 100, 0.5, 0.999])
def test_weights_that_are_cut_short_are_named(tmp_path: Path, kept: float) -> None:
    path = save_untrained(tmp_path, DATA, "il")
    content = path.read_bytes()
    path.write_bytes(content[: kept if isinstance(kept, int) else int(kept * len(content))])
    with pytest.raises(ModelError, match=rf"{path.name}: expected the weights of an agent, got ") as error:
        load(tmp_path)
    assert "\n" not in str(error.value)


def changed_weights(path: Path, change: Callable[[dict[str, torch.Tensor]], Any]) -> None:
    state = load_file(path)
    change(state)
    save_file(state, path)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_weights_that_are_not_finite_are_named(tmp_path: Path, value: float) -> None:
    path = save_untrained(tmp_path, DATA, "il")
    changed_weights(path, lambda state: state["actor.weight"][3].fill_(value))
    with pytest.raises(ModelError, match=rf"{path.name}: tensor 'actor.weight' is not finite everywhere"):
        load(tmp_path)


@pytest.mark.parametrize(
    ("change", "first"),
    [
        (lambda state: state.pop("actor.bias"), "actor.bias"),
        (lambda state: state.update(actress=torch.zeros(3)), "actress"),
        (lambda state: state.update({"actor.bias": torch.zeros(8)}), "actor.bias"),
        (lambda state: state.update({"actor.bias": torch.zeros(7, dtype=torch.float64)}), "actor.bias"),
    ],
    ids=["missing", "too many", "shape", "type"],
)
def test_tensors_that_do_not_fit_are_named(tmp_path: Path, change: Any, first: str) -> None:
    path = save_untrained(tmp_path, DATA, "il")
    changed_weights(path, change)
    with pytest.raises(ModelError, match=rf"{path.name}: 1 tensors do not fit an agent as described, first '{first}'"):
        load(tmp_path)


def test_names_say_what_an_agent_goes_without() -> None:
    assert agent_name("il-ppo") == agent_name("il-ppo", "none") == "il-ppo"
    assert agent_name("il-ppo", "vision") == "il-ppo-no-vision"
    path = agent_path(Path("models"), "il-no-vision", Conditions(sensor="estimator", views="paper"), seed=12)
    assert path == Path("models/agent-il-no-vision-estimator-paper-seed12.safetensors")


def test_seeds_are_those_of_one_name_sensor_and_regime_in_order(tmp_path: Path) -> None:
    def seeds(name: str, sensor: str = "perfect", views: str = "moving") -> tuple[int, ...]:
        return agent_seeds(Conditions(models=tmp_path, sensor=sensor, views=views), DATA, name)

    assert seeds("il") == ()
    for name, seed in (("il", 10), ("il", 2), ("il-ppo", 0), ("ppo", 3), ("il-no-vision", 4), ("il-ppo-no-vision", 5)):
        save_untrained(tmp_path, DATA, name, seed=seed)
    for sensor, views, seed in (("estimator", "moving", 6), ("perfect", "paper", 7)):
        agent_path(tmp_path, "il", Conditions(sensor=sensor, views=views), seed=seed).touch()
    for stray in ("seed", "seed01", "seed-1", "seed2.old", "seed9 (copy)"):
        (tmp_path / f"agent-il-perfect-moving-{stray}.safetensors").touch()
    (tmp_path / "agent-il-perfect-moving-seed8.checkpoint").touch()
    (tmp_path / "gain-field-perfect-moving.safetensors").touch()
    expected: dict[str, tuple[int, ...]] = {
        "il": (2, 10),
        "ppo": (3,),
        "il-ppo": (0,),
        "il-no-vision": (4,),
        "il-ppo-no-vision": (5,),
        "il-no-position": (),
    }
    assert {name: seeds(name) for name in expected} == expected
    assert (seeds("il", "estimator"), seeds("il", "perfect", "paper"), seeds("il", "estimator", "paper")) == (
        (6,),
        (7,),
        (),
    )


def test_no_folder_has_no_seeds_and_none_means_those_shipped(tmp_path: Path) -> None:
    assert agent_seeds(Conditions(models=tmp_path / "none"), DATA, "il") == ()
    assert agent_seeds(Conditions(), DATA, "il") == ()  # none are shipped for "tiny"
    with pytest.raises(ModelError, match=r"weights/tiny/agent-il-.*: no such file: .*--models DIR`"):
        load_agent(Conditions(data=DATA), DATA, "il", recogniser_sha256="fake", seed=0)
