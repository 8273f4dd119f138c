"""Trainings of agents that take a second: on tiny data, with few steps of everything."""

import atexit
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from ehar.conditions import Conditions
from ehar.errors import EharError
from planners.agents.config import DAGGER, AgentTrainingConfig, ImitationSetting, PPOSetting, Stage
from planners.agents.storage import agent_path
from planners.agents.training import train_agents
from tests.helpers.random_networks import save_random_world
from tests.helpers.settings import changed, tiny_conditions

LENGTH = 8
PPO = PPOSetting(  # 7 rollouts
    frames=7 * 7 * 8, num_envs=8, hold=2, copies=4, evaluate_every=2 * 7 * 8, epochs=1, minibatches=2
)
IMITATION = replace(DAGGER, episodes=96, epochs=2, batch=32)  # 2 rounds of 2 batches


@dataclass(frozen=True, kw_only=True)
class TinyTraining(AgentTrainingConfig):
    """A training that takes a second, in whatever process it runs."""

    @property
    def ppo(self) -> PPOSetting:
        """Few rollouts of few environments; like the paper's in what that setting differs in."""
        paper = self.setting == "paper"
        setting = replace(PPO, hindsight=False, hold=1, copies=1, critic_rollouts=1) if paper else PPO
        return setting if self.frames is None else replace(setting, frames=self.frames)

    def imitation(self, stage: Stage) -> ImitationSetting:
        """Few demonstrations and steps."""
        if stage == "dagger":
            return replace(DAGGER, episodes=self.episodes or 96, epochs=2, batch=32)
        named = {"teacher": self.teacher, "labels": self.labels, "rounds": self.rounds}
        per_seed = self.setting == "paper"
        return replace(IMITATION, episodes=self.episodes or IMITATION.episodes, per_seed=per_seed, **named)


@cache
def world() -> Path:
    """Return a folder of tiny data, with a recogniser that has learned nothing; made once a process."""
    folder = TemporaryDirectory(prefix="tiny-world-")
    atexit.register(folder.cleanup)
    save_random_world(Path(folder.name), LENGTH)
    return Path(folder.name)


def tiny_training(out: Path) -> TinyTraining:
    """Return the training of all stages that tests begin with."""
    return TinyTraining(
        conditions=tiny_conditions(world(), length=LENGTH),
        out=out,
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


def refusal(error: type[EharError], config: AgentTrainingConfig, **changes: Any) -> str:
    """Return the one line that training with other options ends in."""
    with pytest.raises(error) as caught:
        train_agents(changed(config, **changes), silent, silent)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def agent_file(config: AgentTrainingConfig, name: str, seed: int = 0) -> Path:
    return agent_path(config.directory, name, Conditions(), seed)
