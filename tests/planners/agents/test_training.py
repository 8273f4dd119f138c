"""Training of agents, end to end: every stage, seeds and workers, and what is refused."""

import importlib.util
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from ehar.conditions import Conditions
from ehar.data.scenario import split_parts, windows
from ehar.errors import DataError, ModelError, UsageError
from ehar.world import PAPER
from planners.agents import stages as agent_stages
from planners.agents import training as agent_training
from planners.agents import validation
from planners.agents.config import DAGGER, PAPER_STAGES, AgentTrainingConfig, Stage
from planners.agents.network import AgentNetwork
from planners.agents.stages import StageRun
from planners.agents.training import train_agents
from planners.agents.world import TrainingWorld
from recognition.setting import load_setting
from tests.helpers.agent_trainings import (
    IMITATION,
    TinyTraining,
    agent_file,
    refusal,
    silent,
    tiny_training,
    train,
)
from tests.helpers.agent_worlds import weights
from tests.helpers.settings import changed


@pytest.fixture
def config(tmp_path: Path) -> AgentTrainingConfig:
    return tiny_training(tmp_path / "out")


def test_all_stages_and_then_nothing_is_left_to_do(
    config: AgentTrainingConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    reports: list[tuple[str, int, int]] = []
    notes: list[str] = []
    paths = train_agents(config, lambda *report: reports.append(report), notes.append)
    assert paths == [agent_file(config, name) for name in ("il", "ppo", "il-ppo")]
    world = TrainingWorld.load(config)
    for path, stage in zip(paths, ("il", "ppo", "il-ppo"), strict=True):
        held = json.loads(path.with_suffix(".json").read_text())["training"]
        assert held["run"]["stage"] == stage
        assert len(held["history"]) == (2 if stage == "il" else 7)
        assert StageRun.of(config, world, stage, 0).finished()  # type: ignore[arg-type]
    for stage in ("ppo", "il-ppo"):
        assert [report for report in reports if report[0] == f"{stage} seed 0"] == [
            (f"{stage} seed 0", done, 7) for done in range(1, 8)
        ]
        assert any(note.startswith(f"{stage} seed 0, rollout 5 of 7: return ") for note in notes)
    assert not list(config.directory.glob("*.checkpoint"))
    assert not list(config.directory.glob("**/*.part"))
    before = {path: path.read_bytes() for path in config.directory.rglob("*.*") if path.is_file()}
    monkeypatch.setattr(agent_training, "collect", None)  # nothing of which is called again
    monkeypatch.setattr(agent_stages, "clone", None)
    notes.clear()
    assert train_agents(config, silent, notes.append) == paths
    assert notes == [f"{stage}: 1 of 1 seeds are done" for stage in ("il", "ppo", "il-ppo")]
    assert before == {path: path.read_bytes() for path in config.directory.rglob("*.*") if path.is_file()}


def test_a_fine_tuning_begins_with_what_was_cloned(config: AgentTrainingConfig) -> None:
    train(replace(config, stages="il"))
    world = TrainingWorld.load(config)
    start = StageRun.of(config, world, "il-ppo", 0).start(world).state_dict()
    cloned = agent_stages.load_agent(
        replace(config.conditions, models=config.directory),
        world.setting.data,
        "il",
        recogniser_sha256=world.setting.recogniser_sha256,
        seed=0,
    ).network.state_dict()
    assert all(torch.equal(start[name], values) for name, values in cloned.items())
    untrained = StageRun.of(config, world, "ppo", 0).start(world)
    assert weights(untrained) == weights(world.network(config, 0))
    assert not torch.equal(untrained.state_dict()["actor.weight"], start["actor.weight"])


def test_a_critic_is_shown_what_the_setting_says_whatever_was_cloned_with_another(
    config: AgentTrainingConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The policy is the same, and cloning does not train the critic."""
    train(replace(config, stages="il"))
    monkeypatch.setattr(TinyTraining, "ppo", replace(config.ppo, hindsight=False))
    train(replace(config, stages="il-ppo"))
    spec = json.loads(agent_file(config, "il-ppo").with_suffix(".json").read_text())["spec"]
    assert spec["hindsight"] == 0


def paper(config: AgentTrainingConfig, **changes: Any) -> AgentTrainingConfig:
    return changed(config, setting="paper", views="paper", form="ctrgcn", teacher="oracle", labels="best", **changes)


def test_the_paper_s_agents_work_with_the_published_network(
    config: AgentTrainingConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(validation, "EPISODES", 4)  # the network sees each prefix from its first frame on
    chosen, notes = paper(config, stages=None, rounds=1, seeds=(0, 1)), list[str]()
    paths = train_agents(chosen, silent, notes.append)
    names = [f"agent-{stage}-ctrgcn-perfect-paper-seed{seed}" for stage in PAPER_STAGES for seed in range(2)]
    assert [path.stem for path in paths] == names
    folders = sorted(path.name.split("-", 4)[4] for path in chosen.directory.glob("demonstrations-*"))
    assert folders == ["held-out", "round0", "seed1-round0"], "each seed has demonstrations of its own"
    assert notes[:2] == [
        "warning: not the paper's recogniser: size small in place of published",
        "warning: not the paper's recogniser: optimiser None in place of published",
    ]
    held = json.loads(paths[-1].with_suffix(".json").read_text())
    assert held["spec"]["hindsight"] == 0 and len(held["training"]["not_as_in_the_paper"]) == 2
    found = load_setting(replace(chosen.conditions, models=chosen.conditions.directory))
    agent = agent_stages.load_agent(
        replace(chosen.conditions, models=chosen.directory),
        found.data,
        "il-ppo",
        recogniser_sha256=found.recogniser_sha256,
        seed=1,
    )
    scenarios, rng = windows(found.data, split_parts(found.data).test, 8, 8), np.random.default_rng(0)
    batch = found.runner.batch(scenarios, np.arange(4), PAPER.sample_starts(rng, 4), rng)
    assert found.runner.roll(agent, batch, rng).log_probs.shape == (4, 8, len(found.data.class_names))


def test_the_paper_s_setting_is_what_the_paper_says() -> None:
    told = AgentTrainingConfig(conditions=Conditions(models="m", views="paper", form="ctrgcn"), setting="paper")
    told.check()
    cloned, ppo = told.imitation("il"), told.ppo
    assert (cloned.teacher, cloned.labels, cloned.rounds) == ("oracle", "best", 1)
    assert (cloned.episodes, cloned.per_seed, told.variations_of_each) == (10_000, True, 0)
    assert (ppo.hold, ppo.copies, ppo.hindsight) == (1, 1, False)


@pytest.mark.parametrize("changes", [{"views": "moving"}, {"form": "causal"}])
def test_the_paper_s_setting_takes_the_paper_s_recogniser(config: AgentTrainingConfig, changes: dict[str, Any]) -> None:
    message = refusal(UsageError, paper(config), **changes)
    assert message.startswith("--setting paper: expected the paper's recogniser, --views paper --form ctrgcn, got ")


def test_an_agent_without_an_encoder_has_a_name_of_its_own(config: AgentTrainingConfig) -> None:
    paths = train_agents(replace(config, without="vision"), silent, silent)
    assert paths == [agent_file(config, f"{stage}-no-vision") for stage in ("il", "ppo", "il-ppo")]
    assert json.loads(paths[-1].with_suffix(".json").read_text())["spec"]["without"] == ["vision"]


def test_a_fine_tuning_of_other_inputs_than_were_cloned_says_which(
    config: AgentTrainingConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    train(replace(config, stages="il"))
    network = TrainingWorld.network

    def flown(world: TrainingWorld, told: AgentTrainingConfig, seed: int) -> AgentNetwork:
        spec = network(world, told, seed).spec
        return AgentNetwork(replace(spec, sizes=replace(spec.sizes, position=7)), seed=seed)

    monkeypatch.setattr(TrainingWorld, "network", flown)
    message = refusal(ModelError, config, stages="il-ppo")
    expected = r"of il-ppo seed 0, (.*) position 7 without nothing, got \1 position 4 without nothing$"
    assert re.search(rf": expected the inputs and encoders {expected}", message)


def test_fine_tuning_without_a_clone(config: AgentTrainingConfig) -> None:
    message = refusal(ModelError, config, stages="il-ppo")
    assert message == f"{agent_file(config, 'il')}: no such file: expected the cloned policy, of --stages il,il-ppo"


def test_seeds_differ_and_share_the_demonstrations(
    config: AgentTrainingConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = train(replace(config, stages="il,ppo", seeds=(0, 7, 2)))
    for stage in ("il", "ppo"):
        assert len({written[agent_file(config, stage, seed).name] for seed in (0, 7, 2)}) == 3
    assert len(list(config.directory.glob("demonstrations-*-round*"))) == IMITATION.rounds
    monkeypatch.setattr(agent_training, "collect", None)
    with pytest.raises(TypeError):
        train(replace(config, stages="il", seeds=(0, 3)))  # the new one needs them again, from their files


def test_dagger_has_a_setting_of_its_own(config: AgentTrainingConfig) -> None:
    chosen = replace(config, stages="dagger", teacher="oracle", labels="best", rounds=1)
    written = train(chosen)
    assert len(list(config.directory.glob("demonstrations-*-round*"))) == DAGGER.rounds
    run = json.loads(written["agent-dagger-perfect-moving-seed0.json"])["training"]["run"]
    assert run["imitation"]["teacher"] == "oracle-lookahead" and run["imitation"]["labels"] == "soft"
    assert "ppo" not in run
    assert train(replace(chosen, labels="soft")) == written  # options of il are none of dagger's


@pytest.mark.slow
@pytest.mark.parametrize(("seeds", "stages"), [(1, "ppo"), (2, "il,ppo")])
def test_workers_decide_nothing(config: AgentTrainingConfig, tmp_path: Path, seeds: int, stages: str) -> None:
    """One seed's environments run in a process of their own, clones and PPO of two seeds in one each."""
    alone = replace(config, seeds=tuple(range(seeds)), stages=stages, episodes=32, rounds=1)
    together = replace(alone, workers=2, out=tmp_path / "together")
    reports: list[tuple[str, int, int]] = []
    notes: list[str] = []
    train_agents(together, lambda *report: reports.append(report), notes.append)
    assert train(together) == train(alone)
    for seed in range(seeds):
        heard = [report for report in reports if report[0] == f"ppo seed {seed}"]
        assert heard == [(f"ppo seed {seed}", done, 7) for done in range(1, 8)]
        assert sum(note.startswith(f"ppo seed {seed}, rollout 5 of 7") for note in notes) == 1


@pytest.mark.parametrize(
    ("stage", "step"),
    [("il", "imitation: the loss is -inf at step 0"), ("ppo", r"PPO: the loss is (nan|-inf) in update 1")],
)
def test_a_loss_that_is_not_finite_is_said_with_whose_it_is(
    config: AgentTrainingConfig, monkeypatch: pytest.MonkeyPatch, stage: Stage, step: str
) -> None:
    """And nothing is saved."""
    endless = replace(config.imitation("il"), labels="soft", rounds=1, entropy=math.inf)
    monkeypatch.setattr(TinyTraining, "imitation", lambda _, stage: endless)
    monkeypatch.setattr(TinyTraining, "ppo", replace(config.ppo, entropy=math.inf))
    message = refusal(ModelError, config, stages=stage)
    assert re.fullmatch(f"{stage} seed 0: {step}: expected a finite one", message)
    assert not agent_file(config, stage).is_file()


@pytest.mark.slow
def test_an_error_in_a_process_arrives(config: AgentTrainingConfig) -> None:
    chosen = replace(config, seeds=(0, 1), stages="ppo", workers=2)
    checkpoint = agent_file(config, "ppo", 1).with_suffix(".checkpoint")
    checkpoint.parent.mkdir()
    checkpoint.write_bytes(b"nonsense")
    told: list[str] = []
    with pytest.raises(ModelError) as refused:
        train_agents(chosen, lambda *_: None, told.append)
    assert str(checkpoint) in str(refused.value)
    assert f"{refused.value}; the other seeds go on" in told
    assert agent_file(config, "ppo", 0).is_file()  # what the other has done is not lost


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seeds": ()}, "--seeds: got none, expected whole numbers of at least 0, each once"),
        ({"seeds": (7, 8, 7)}, "--seeds: got 7 8 7, expected whole numbers of at least 0, each once"),
        ({"seeds": (-1,)}, "--seeds: got -1, expected whole numbers of at least 0, each once"),
        ({"seeds": 5}, "--seeds: got 5, expected whole numbers of at least 0, each once"),
        ({"workers": 0}, "--workers: got 0, expected at least 1"),
        ({"episodes": 0}, "--episodes: got 0, expected at least 1"),
        ({"rounds": 0}, "--rounds: got 0, expected at least 1"),
        ({"frames": 0}, "--frames: got 0, expected at least 1"),
        ({"variations": -1}, "--variations: got -1, expected at least 0"),
        ({"length": 4}, "--length: got 4, expected at least 5"),  # the teacher that looks ahead would not be asked
        ({"length": 2, "stages": "ppo"}, "--length: got 2, expected at least 3"),
        ({"stages": "il,sarsa"}, "--stages il,sarsa: expected some of il,ppo,il-ppo,dagger, got 'sarsa'"),
        ({"device": "abacus"}, "--device abacus: expected cpu or cuda"),
        ({"models": None, "out": None}, "train agent: expected --models DIR, or --out DIR"),
        ({"onset": "known"}, "onset: expected unknown in a training, got known"),
    ],
)
def test_options_that_make_no_sense(config: AgentTrainingConfig, changes: dict[str, Any], message: str) -> None:
    assert message in refusal(UsageError, config, data="absent.npz", **changes)  # before anything is loaded


def test_what_is_not_there(config: AgentTrainingConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert "--device cuda: expected a GPU" in refusal(UsageError, config, device="cuda")
    assert "expected a folder that can be written to" in refusal(UsageError, config, tensorboard=Path(__file__))
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert "expected TensorBoard to be installed" in refusal(UsageError, config, tensorboard=Path("logs"))
    assert "estimator-moving" in refusal(ModelError, config, sensor="estimator")
    assert refusal(UsageError, config, sensor="radar").startswith("unknown sensor 'radar'; expected one of")
    message = refusal(DataError, config, length=21)
    assert message == "tiny: expected policy sequences of at least 21 frames, got none"


@pytest.mark.parametrize("length", [3, 5])
def test_the_shortest_episodes(config: AgentTrainingConfig, length: int) -> None:
    teacher = "oracle" if length == 3 else "oracle-lookahead"
    paths = train_agents(changed(config, length=length, teacher=teacher), silent, silent)  # type: ignore[arg-type]
    assert all(path.is_file() for path in paths)
