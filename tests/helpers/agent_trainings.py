"""Trainings of agents that take a second: on tiny data, with few steps of everything."""

from dataclasses import replace
from pathlib import Path
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
PPO = PPOSetting(frames=7 * 7 * 8, num_envs=8, hold=2, copies=4)  # 7 rollouts, a checkpoint after the fifth
IMITATION = replace(DAGGER, episodes=96, epochs=2, batch=32)  # 2 rounds of 2 batches


def train_little(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let trainings in this process take a second."""

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


def tiny_config(tmp_path: Path) -> AgentTrainingConfig:
    """Return the tiny data, with a recogniser that has learned nothing."""
    save_random_world(tmp_path, LENGTH)
    return AgentTrainingConfig(
        conditions=tiny_conditions(tmp_path, length=LENGTH),
        out=tmp_path / "out",
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


def quick(config: AgentTrainingConfig, **changes: Any) -> AgentTrainingConfig:
    """Return what takes seconds with the settings as they are; other processes know of no others."""
    return replace(config, episodes=64, rounds=1, frames=7 * 7 * PPOSetting.num_envs, **changes)
