"""Trainings and environments of the tiny data: what they are told, and how to tell them something else."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Protocol, TypeVar

from ehar.conditions import Conditions

TOLD = {field.name for field in fields(Conditions)}


class Told(Protocol):
    """The config of a training."""

    @property
    def conditions(self) -> Conditions: ...


Config = TypeVar("Config", bound=Told)


def tiny_conditions(folder: Path, **told: Any) -> Conditions:
    """Return the conditions of `save_random_world`."""
    return Conditions(**{"data": str(folder / "tiny.npz"), "models": str(folder / "models"), **told})


def changed(config: Config, **changes: Any) -> Config:
    """Return a training of which options are changed, its own and those of its conditions."""
    told = {name: changes.pop(name) for name in list(changes) if name in TOLD}
    return replace(config, conditions=replace(config.conditions, **told), **changes)  # type: ignore[type-var]
