"""Training of agents, end to end: what is done is skipped, and what was stopped goes on as if it had not been."""

import importlib.util
import json
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from agent_worlds import weights
from fakes import tiny_data
from random_networks import randomised

from ehar.errors import DataError, EharError, ModelError, UsageError
from ehar.motion_file import save_motion
from planners import agent_stages, agent_training
from planners.agent_stages import StageRun
from planners.agent_storage import agent_path
from planners.agent_training import train_agents
from planners.agent_training_config import DAGGER, AgentTrainingConfig, ImitationSetting, PPOSetting, Stage
from planners.training_world import TrainingWorld
from recognition.calibration import Temperature
from recognition.networks import NetworkSpec
from recognition.storage import recogniser_path, save_recogniser

LENGTH = 8
PPO = PPOSetting(frames=7 * 7 * 8, num_envs=8, hold=2, copies=4)  # 7 rollouts, a checkpoint after the fifth
IMITATION = replace(DAGGER, episodes=96, epochs=2, batch=32)  # 2 rounds of 2 batches


@pytest.fixture(autouse=True)
def little_of_everything(monkeypatch: pytest.MonkeyPatch) -> None:
    def chosen(config: AgentTrainingConfig) -> PPOSetting:
        paper = config.setting == "paper"
        setting = replace(PPO, hindsight=False, hold=1, copies=1, critic_rollouts=1) if paper else PPO
        return setting if config.frames is None else replace(setting, frames=config.frames)

    def imitated(config: AgentTrainingConfig, stage: Stage) -> ImitationSetting:
        if stage == "dagger":
            return replace(DAGGER, episodes=96, epochs=2, batch=32)
        named = {"teacher": config.teacher, "labels": config.labels, "rounds": config.rounds}
        return replace(IMITATION, episodes=config.episodes or IMITATION.episodes, **named)

    monkeypatch.setattr(AgentTrainingConfig, "ppo", property(chosen))
    monkeypatch.setattr(AgentTrainingConfig, "imitation", imitated)


@pytest.fixture
def config(tmp_path: Path) -> AgentTrainingConfig:
    """Return the tiny data, with a recogniser that has learned nothing."""
    data = tiny_data(sequences=24)
    save_motion(tmp_path / "tiny.npz", data)
    spec = NetworkSpec.of(data, form="causal", size="small", length=LENGTH)
    network = spec.build()
    randomised(network)
    path = recogniser_path(tmp_path / "models", form="causal", sensor="perfect", views="moving")
    save_recogniser(path, network, spec, Temperature(), {})
    return AgentTrainingConfig(
        data=str(tmp_path / "tiny.npz"),
        models=tmp_path / "models",
        out=tmp_path / "out",
        length=LENGTH,
        stages="il,ppo,il-ppo",
        teacher=IMITATION.teacher,
        labels=IMITATION.labels,
        rounds=IMITATION.rounds,
        workers=1,
    )


def silent(*heard: object) -> None:
    """Hear nothing."""


def train(config: AgentTrainingConfig) -> dict[str, bytes]:
    """Train, and return the content of all that was written for each agent."""
    paths = train_agents(config, silent, silent)
    return {file.name: file.read_bytes() for path in paths for file in (path, path.with_suffix(".json"))}


def refusal(error: type[EharError], config: AgentTrainingConfig) -> str:
    """Return the one line that training ends in."""
    with pytest.raises(error) as caught:
        train_agents(config, silent, silent)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def agent_file(config: AgentTrainingConfig, name: str, seed: int = 0) -> Path:
    return agent_path(config.directory, name, sensor="perfect", views="moving", seed=seed)


class Stopped(Exception):
    """Ctrl-C."""


def stop_at(what: str, done: int) -> Callable[[str, int, int], None]:
    """Return what stops a training when it reports this."""

    def report(title: str, so_far: int, whole: int) -> None:
        if what in title and so_far == done:
            raise Stopped

    return report


def stop(config: AgentTrainingConfig, what: str, done: int) -> None:
    with pytest.raises(Stopped):
        train_agents(config, stop_at(what, done), silent)


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
        config.directory,
        world.data,
        "il",
        sensor="perfect",
        views="moving",
        recogniser_sha256=world.recogniser.sha256,
        seed=0,
    ).network.state_dict()
    assert all(torch.equal(start[name], values) for name, values in cloned.items())
    untrained = StageRun.of(config, world, "ppo", 0).start(world)
    assert weights(untrained) == weights(world.network(config, 0))
    assert not torch.equal(untrained.state_dict()["actor.weight"], start["actor.weight"])


def test_a_critic_is_shown_what_the_setting_says_whatever_was_cloned_with_another(
    config: AgentTrainingConfig,
) -> None:
    """The policy is the same, and cloning does not train the critic."""
    train(replace(config, stages="il"))
    paper = replace(config, stages="il-ppo", setting="paper")
    train(paper)
    spec = json.loads(agent_file(config, "il-ppo").with_suffix(".json").read_text())["spec"]
    assert spec["hindsight"] == 0


def test_an_agent_without_an_encoder_has_a_name_of_its_own(config: AgentTrainingConfig) -> None:
    paths = train_agents(replace(config, without="vision"), silent, silent)
    assert paths == [agent_file(config, f"{stage}-no-vision") for stage in ("il", "ppo", "il-ppo")]
    assert json.loads(paths[-1].with_suffix(".json").read_text())["spec"]["without"] == ["vision"]


@pytest.mark.parametrize(
    ("what", "done"),
    [
        ("round0", 1),
        ("round1", 1),
        ("il", 1),
        ("ppo seed 0", 3),
        ("ppo seed 0", 5),
        ("ppo seed 0", 6),
        ("ppo seed 0", 7),
        ("il-ppo seed 0", 6),
    ],
)
def test_a_stopped_training_goes_on_where_it_was(
    config: AgentTrainingConfig, tmp_path: Path, what: str, done: int
) -> None:
    stopped = replace(config, out=tmp_path / "stopped")
    stop(stopped, what, done)
    assert train(stopped) == train(config)
    assert not list(stopped.directory.glob("*.checkpoint"))


def test_it_goes_on_from_the_checkpoint_and_not_from_the_start(config: AgentTrainingConfig) -> None:
    stop(config, "ppo seed 0", 6)
    reports: list[tuple[str, int, int]] = []
    train_agents(replace(config, stages="ppo"), lambda *report: reports.append(report), silent)
    assert reports == [("ppo seed 0", 6, 7), ("ppo seed 0", 7, 7)]


def test_a_demonstration_cut_short_is_run_again(config: AgentTrainingConfig, tmp_path: Path) -> None:
    chosen = replace(config, stages="il")
    expected = train(replace(chosen, out=tmp_path / "through"))
    stop(chosen, "round1", 1)
    (kept,) = chosen.directory.glob("demonstrations-perfect-moving-*-round0/1.safetensors")
    kept.write_bytes(kept.read_bytes()[:-100])
    assert train(chosen) == expected


@pytest.mark.parametrize("content", [b"", b"nonsense", None])
def test_a_damaged_checkpoint(config: AgentTrainingConfig, content: bytes | None) -> None:
    chosen = replace(config, stages="ppo")
    stop(chosen, "ppo", 6)
    checkpoint = agent_file(config, "ppo").with_suffix(".checkpoint")
    checkpoint.write_bytes(checkpoint.read_bytes()[:-200] if content is None else content)
    message = refusal(ModelError, chosen)
    assert message.startswith(f"{checkpoint}: expected a training checkpoint, got ")
    assert message.endswith(": remove it to start anew")
    checkpoint.unlink()
    train(chosen)


def test_a_checkpoint_without_what_belongs_in_it(config: AgentTrainingConfig) -> None:
    checkpoint = agent_file(config, "ppo").with_suffix(".checkpoint")
    checkpoint.parent.mkdir()
    torch.save({"run": "[1]"}, checkpoint)
    assert "expected a training checkpoint" in refusal(ModelError, replace(config, stages="ppo"))
    torch.save([torch.zeros(3)], checkpoint)
    assert "expected a training checkpoint" in refusal(ModelError, replace(config, stages="ppo"))


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"frames": 1000}, "ppo.frames"),
        ({"setting": "paper"}, "ppo.copies, ppo.critic_rollouts, ppo.hindsight, ppo.hold, variations"),
        ({"variations": 1}, "variations"),
        ({"length": 7}, "length"),
        ({"data": "other"}, "data_sha256"),
    ],
)
def test_a_run_with_other_options_takes_over_nothing(
    config: AgentTrainingConfig, tmp_path: Path, changes: dict[str, Any], named: str
) -> None:
    """Neither a checkpoint nor a result, and neither is written over."""
    if "data" in changes:
        data = tiny_data(sequences=24)
        changes = {"data": str(tmp_path / "other.npz")}
        save_motion(tmp_path / "other.npz", replace(data, positions=data.positions * 1.01))
    chosen = replace(config, stages="ppo")
    stop(chosen, "ppo", 6)
    checkpoint = agent_file(config, "ppo").with_suffix(".checkpoint")
    assert refusal(UsageError, replace(chosen, **changes)).startswith(
        f"{checkpoint}: a checkpoint of another training, which differs in {named}: "
    )
    expected = train(chosen)
    description = agent_file(config, "ppo").with_suffix(".json")
    message = refusal(UsageError, replace(chosen, **changes))
    assert (
        message
        == f"{description}: holds another training, which differs in {named}: remove it, or choose another --out"
    )
    assert train(chosen) == expected


@pytest.mark.parametrize("changes", [{"teacher": "oracle"}, {"labels": "best"}, {"episodes": 64}, {"rounds": 1}])
def test_cloning_otherwise_is_another_training(config: AgentTrainingConfig, changes: dict[str, Any]) -> None:
    chosen = replace(config, stages="il")
    train(chosen)
    (name,) = changes
    assert f"differs in imitation.{name}: " in refusal(UsageError, replace(chosen, **changes))


def test_a_result_whose_description_is_no_longer_one(config: AgentTrainingConfig) -> None:
    chosen = replace(config, stages="il")
    train(chosen)
    description = agent_file(config, "il").with_suffix(".json")
    for content in ("{}", "[1, 2", '{"training": {"run": [1]}}', '{"training": 3}'):
        description.write_text(content)
        assert "holds another training, which differs in data_sha256, " in refusal(UsageError, chosen)
    description.unlink()
    train(chosen)
    assert description.is_file()


def test_a_fine_tuning_of_another_clone_is_another_training(config: AgentTrainingConfig) -> None:
    train(config)
    for suffix in (".safetensors", ".json"):
        agent_file(config, "il").with_suffix(suffix).unlink()
    message = refusal(UsageError, replace(config, labels="best"))
    assert "il-ppo" in message
    assert "start_sha256" in message


def test_fine_tuning_without_a_clone(config: AgentTrainingConfig) -> None:
    message = refusal(ModelError, replace(config, stages="il-ppo"))
    assert message.startswith(f"{agent_file(config, 'il')}: no such file: expected an agent, as made by `ehar train")


def test_seeds_differ_and_share_the_demonstrations(
    config: AgentTrainingConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = train(replace(config, stages="il,ppo", seeds=3))
    for stage in ("il", "ppo"):
        assert len({written[agent_file(config, stage, seed).name] for seed in range(3)}) == 3
    assert len(list(config.directory.glob("demonstrations-*"))) == IMITATION.rounds
    monkeypatch.setattr(agent_training, "collect", None)
    with pytest.raises(TypeError):
        train(replace(config, stages="il", seeds=4))  # the fourth needs them again, from their files


def test_dagger_has_a_setting_of_its_own(config: AgentTrainingConfig) -> None:
    chosen = replace(config, stages="dagger", teacher="oracle", labels="best", rounds=1)
    written = train(chosen)
    assert len(list(config.directory.glob("demonstrations-*"))) == DAGGER.rounds
    run = json.loads(written["agent-dagger-perfect-moving-seed0.json"])["training"]["run"]
    assert run["imitation"]["teacher"] == "oracle-lookahead" and run["imitation"]["labels"] == "soft"
    assert "ppo" not in run
    assert train(replace(chosen, labels="soft")) == written  # options of il are none of dagger's


def quick(config: AgentTrainingConfig, **changes: Any) -> AgentTrainingConfig:
    """Return what takes seconds with the settings as they are; other processes know of no others."""
    return replace(config, episodes=64, rounds=1, frames=7 * 7 * PPOSetting.num_envs, **changes)


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [1, 2])
def test_workers_decide_nothing(
    config: AgentTrainingConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seeds: int
) -> None:
    """One seed's environments run in two processes, two seeds in one each."""
    monkeypatch.undo()
    alone = quick(config, seeds=seeds, stages="il,ppo")
    together = replace(alone, workers=2, out=tmp_path / "together")
    reports: list[tuple[str, int, int]] = []
    notes: list[str] = []
    train_agents(together, lambda *report: reports.append(report), notes.append)
    assert train(together) == train(alone)
    for seed in range(seeds):
        heard = [report for report in reports if report[0] == f"ppo seed {seed}"]
        assert heard == [(f"ppo seed {seed}", done, 7) for done in range(1, 8)]
        assert sum(note.startswith(f"ppo seed {seed}, rollout 5 of 7") for note in notes) == 1


@pytest.mark.slow
def test_an_error_in_a_process_arrives(config: AgentTrainingConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    chosen = quick(config, seeds=2, stages="ppo", workers=2)
    checkpoint = agent_file(config, "ppo", 1).with_suffix(".checkpoint")
    checkpoint.parent.mkdir()
    checkpoint.write_bytes(b"nonsense")
    assert str(checkpoint) in refusal(ModelError, chosen)
    assert agent_file(config, "ppo", 0).is_file()  # what the other has done is not lost


def command(config: AgentTrainingConfig) -> "subprocess.Popen[bytes]":
    """Start `ehar train agent` in a process of its own."""
    options = {
        "data": config.data,
        "models": config.models,
        "out": config.out,
        "length": config.length,
        "stages": config.stages,
        "teacher": config.teacher,
        "labels": config.labels,
        "episodes": config.episodes,
        "rounds": config.rounds,
        "frames": config.frames,
        "workers": config.workers,
    }
    given = [part for name, value in options.items() for part in (f"--{name}", str(value))]
    return subprocess.Popen(
        [sys.executable, "-m", "eval.cli", "train", "agent", *given],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        cwd=Path(__file__).parent.parent,
    )


@pytest.mark.slow
def test_killed_at_any_moment_it_ends_as_if_it_had_not_been(
    config: AgentTrainingConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.undo()
    killed = replace(quick(config, stages="il,ppo"), frames=15 * 7 * PPOSetting.num_envs, out=tmp_path / "killed")
    rng = np.random.default_rng()  # any moment, and another one in each run of this test
    for pattern in ("demonstrations-*/*.safetensors", "*.checkpoint"):
        process = command(killed)
        deadline = time.monotonic() + 60
        while process.poll() is None and not list(killed.directory.glob(pattern)) and time.monotonic() < deadline:
            time.sleep(0.01)
        time.sleep(rng.uniform(0, 0.5))
        process.kill()
        _, complaint = process.communicate()
        assert process.returncode in (-9, 0), complaint.decode()
    process = command(killed)
    _, complaint = process.communicate()
    assert process.returncode == 0, complaint.decode()
    through = replace(killed, out=config.out)
    assert train(killed) == train(through)
    assert not list(killed.directory.glob("*.checkpoint"))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seeds": 0}, "--seeds: got 0, expected at least 1"),
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
    ],
)
def test_options_that_make_no_sense(config: AgentTrainingConfig, changes: dict[str, Any], message: str) -> None:
    assert message in refusal(UsageError, replace(config, data="absent.npz", **changes))  # before anything is loaded


def test_what_is_not_there(config: AgentTrainingConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert "--device cuda: expected a GPU" in refusal(UsageError, replace(config, device="cuda"))
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert "expected TensorBoard to be installed" in refusal(UsageError, replace(config, tensorboard=Path("logs")))
    assert "estimator-moving" in refusal(ModelError, replace(config, sensor="estimator"))
    message = refusal(DataError, replace(config, length=21))
    assert message == "tiny: expected policy sequences of at least 21 frames, got none"


@pytest.mark.parametrize("length", [3, 5])
def test_the_shortest_episodes(config: AgentTrainingConfig, length: int) -> None:
    teacher = "oracle" if length == 3 else "oracle-lookahead"
    paths = train_agents(replace(config, length=length, teacher=teacher), silent, silent)  # type: ignore[arg-type]
    assert all(path.is_file() for path in paths)
