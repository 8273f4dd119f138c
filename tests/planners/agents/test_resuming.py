"""What is done is skipped, and what was stopped, killed or damaged goes on as if it had not been, or says why not."""

import pickle
import shutil
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
from safetensors.torch import save_file

from ehar.data.motion_file import save_motion
from ehar.errors import ModelError, UsageError
from planners.agents.config import AgentTrainingConfig
from planners.agents.training import train_agents
from recognition.training.checkpoints import Checkpoint, save_checkpoint
from tests.helpers.agent_trainings import PPO, agent_file, refusal, silent, tiny_training, train
from tests.helpers.fakes import tiny_data
from tests.helpers.places import ROOT


@pytest.fixture
def config(tmp_path: Path) -> AgentTrainingConfig:
    return tiny_training(tmp_path / "out")


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


@pytest.fixture(scope="module")
def through(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return what is written where nothing stops the training."""
    return train(tiny_training(tmp_path_factory.mktemp("through")))


@pytest.fixture(scope="module")
def sixth(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a PPO that was stopped after its sixth rollout; to be copied."""
    folder = tmp_path_factory.mktemp("sixth")
    stop(replace(tiny_training(folder), stages="ppo"), "ppo seed 0", 6)
    return folder


@pytest.fixture
def stopped(config: AgentTrainingConfig, sixth: Path) -> AgentTrainingConfig:
    """Return a training of PPO that was stopped after its sixth rollout."""
    shutil.copytree(sixth, config.directory)
    return replace(config, stages="ppo")


@pytest.mark.parametrize(
    ("stages", "what", "done"),
    [
        ("il", "round0", 1),
        ("il", "round1", 1),
        ("il", "il", 1),
        ("ppo", "ppo seed 0", 3),
        ("ppo", "ppo seed 0", 5),
        ("ppo", "ppo seed 0", 7),
        ("il,ppo,il-ppo", "il-ppo seed 0", 6),
    ],
)
def test_a_stopped_training_goes_on_where_it_was(
    config: AgentTrainingConfig, through: dict[str, bytes], stages: str, what: str, done: int
) -> None:
    chosen = replace(config, stages=stages)
    stop(chosen, what, done)
    written = train(chosen)
    assert len(written) == 2 * len(chosen.stage_names)
    assert written == {name: through[name] for name in written}
    assert not list(config.directory.glob("*.checkpoint"))


def test_it_goes_on_from_the_checkpoint_and_not_from_the_start(
    stopped: AgentTrainingConfig, through: dict[str, bytes]
) -> None:
    reports: list[tuple[str, int, int]] = []
    train_agents(stopped, lambda *report: reports.append(report), silent)
    assert reports == [("ppo seed 0", 6, 7), ("ppo seed 0", 7, 7)]
    assert all(through[name] == content for name, content in train(stopped).items())


def test_a_demonstration_cut_short_is_run_again(config: AgentTrainingConfig, through: dict[str, bytes]) -> None:
    chosen = replace(config, stages="il")
    stop(chosen, "round1", 1)
    (kept,) = chosen.directory.glob("demonstrations-perfect-moving-*-round0/1.safetensors")
    kept.write_bytes(kept.read_bytes()[:-100])
    assert all(through[name] == content for name, content in train(chosen).items())


@pytest.mark.parametrize("content", [b"", b"nonsense", None])
def test_a_damaged_checkpoint(stopped: AgentTrainingConfig, content: bytes | None) -> None:
    checkpoint = agent_file(stopped, "ppo").with_suffix(".checkpoint")
    checkpoint.write_bytes(checkpoint.read_bytes()[:-200] if content is None else content)
    message = refusal(ModelError, stopped)
    assert message.startswith(f"{checkpoint}: expected a training checkpoint, got ")
    assert message.endswith(": remove it to start anew")


def test_without_its_damaged_checkpoint_a_training_starts_anew(
    stopped: AgentTrainingConfig, through: dict[str, bytes]
) -> None:
    agent_file(stopped, "ppo").with_suffix(".checkpoint").unlink()
    assert all(through[name] == content for name, content in train(stopped).items())


def test_a_checkpoint_without_what_belongs_in_it(config: AgentTrainingConfig) -> None:
    checkpoint = agent_file(config, "ppo").with_suffix(".checkpoint")
    checkpoint.parent.mkdir()
    save_checkpoint(checkpoint, Checkpoint({}, None, {"run": [1]}))
    assert "expected a training checkpoint" in refusal(ModelError, config, stages="ppo")
    save_file({"network": torch.zeros(3)}, checkpoint)
    assert "expected a training checkpoint" in refusal(ModelError, config, stages="ppo")


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"frames": 1000}, "ppo.frames"),
        ({"variations": 1}, "variations"),
        ({"length": 7}, "length"),
        ({"data": "other"}, "data_sha256"),
    ],
)
def test_a_run_with_other_options_takes_over_nothing(
    stopped: AgentTrainingConfig, tmp_path: Path, changes: dict[str, Any], named: str
) -> None:
    """Neither a checkpoint nor a result, and neither is written over."""
    if "data" in changes:
        data = tiny_data(sequences=24)
        changes = {"data": str(tmp_path / "other.npz")}
        save_motion(tmp_path / "other.npz", replace(data, positions=data.positions * 1.01))
    checkpoint = agent_file(stopped, "ppo").with_suffix(".checkpoint")
    assert refusal(UsageError, stopped, **changes).startswith(
        f"{checkpoint}: a checkpoint of another training, which differs in {named}: "
    )
    expected = train(stopped)
    description = agent_file(stopped, "ppo").with_suffix(".json")
    message = refusal(UsageError, stopped, **changes)
    assert (
        message
        == f"{description}: holds another training, which differs in {named}: remove it, or choose another --out"
    )
    assert train(stopped) == expected


@pytest.mark.parametrize("changes", [{"teacher": "oracle"}, {"labels": "best"}, {"episodes": 64}, {"rounds": 1}])
def test_cloning_otherwise_is_another_training(config: AgentTrainingConfig, changes: dict[str, Any]) -> None:
    chosen = replace(config, stages="il")
    train(chosen)
    (name,) = changes
    assert f"differs in imitation.{name}: " in refusal(UsageError, chosen, **changes)


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
    message = refusal(UsageError, config, labels="best")
    assert "il-ppo" in message
    assert "start_sha256" in message


RUN = """
import pickle, sys
from planners.agents.training import train_agents
from tests.helpers.agent_trainings import PPO, silent
if __name__ == "__main__":
    train_agents(pickle.loads(bytes.fromhex(sys.argv[1])), silent, silent)
"""


def start(config: AgentTrainingConfig) -> "subprocess.Popen[bytes]":
    """Start a training in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-c", RUN, pickle.dumps(config).hex()],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        cwd=ROOT,
    )


@pytest.mark.slow
def test_killed_at_any_moment_it_ends_as_if_it_had_not_been(config: AgentTrainingConfig, tmp_path: Path) -> None:
    killed = replace(config, stages="il,ppo", frames=15 * 7 * PPO.num_envs, out=tmp_path / "killed")
    rng = np.random.default_rng()  # any moment, and another one in each run of this test
    for pattern in ("demonstrations-*/*.safetensors", "*.checkpoint"):
        process = start(killed)
        deadline = time.monotonic() + 60
        while process.poll() is None and not list(killed.directory.glob(pattern)) and time.monotonic() < deadline:
            time.sleep(0.01)
        time.sleep(rng.uniform(0, 0.5))
        process.kill()
        _, complaint = process.communicate()
        assert process.returncode in (-9, 0), complaint.decode()
    assert train(killed) == train(replace(killed, out=config.out))
    assert not list(killed.directory.glob("*.checkpoint"))
