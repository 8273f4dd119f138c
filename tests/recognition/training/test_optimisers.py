"""The published optimiser, against the configuration of CTR-GCN's public implementation."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from ehar.conditions import Conditions
from ehar.data.motion_file import save_motion
from recognition.storage import recogniser_path
from recognition.training import material, stopping
from recognition.training.config import TrainingConfig
from recognition.training.optimisers import make_optimiser, published_rate
from recognition.training.trainer import train_recogniser
from recognition.weight_files import recorded_run
from tests.helpers.fakes import tiny_data


@pytest.mark.parametrize(
    ("epoch", "rate"),
    [(0, 0.02), (1, 0.04), (4, 0.1), (5, 0.1), (34, 0.1), (35, 0.01), (54, 0.01), (55, 0.001), (64, 0.001)],
)
def test_the_published_rate_by_epoch(epoch: int, rate: float) -> None:
    assert published_rate(epoch / 65) == pytest.approx(rate)
    assert published_rate((epoch + 0.9) / 65) == pytest.approx(rate)


def test_the_published_optimiser() -> None:
    made = make_optimiser(torch.nn.Linear(2, 2), "published", learning_rate=3e-3, weight_decay=0.02)
    assert isinstance(made, torch.optim.SGD)
    settings = {key: made.param_groups[0][key] for key in ("lr", "momentum", "nesterov", "weight_decay")}
    assert settings == {"lr": 0.1, "momentum": 0.9, "nesterov": True, "weight_decay": 4e-4}
    ours = make_optimiser(torch.nn.Linear(2, 2), "adamw", learning_rate=3e-3, weight_decay=0.02)
    assert isinstance(ours, torch.optim.AdamW) and ours.param_groups[0]["lr"] == 3e-3


def test_a_training_says_what_optimised_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(material, "VALIDATION_CLIPS", 24)
    save_motion(tmp_path / "tiny.npz", tiny_data())
    told = Conditions(data=str(tmp_path / "tiny.npz"), length=8, form="ctrgcn", views="paper")
    config = TrainingConfig(conditions=told, out=tmp_path, clips=48, batch=8, optimiser="published", threads=1)
    train_recogniser(config)
    assert recorded_run(recogniser_path(tmp_path, told))["optimiser"] == "published"


def test_the_published_schedule_runs_to_its_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(material, "VALIDATION_CLIPS", 24)
    monkeypatch.setattr(stopping, "LEAST_CLIPS", 8)
    monkeypatch.setattr(stopping, "WORTH", 2.0)  # nothing gains so much: the other optimiser stops as early as it can
    save_motion(tmp_path / "tiny.npz", tiny_data())
    told = Conditions(data=str(tmp_path / "tiny.npz"), length=8)
    config = TrainingConfig(conditions=told, out=tmp_path / "a", clips=80, batch=8, interval=8, threads=1)
    assert train_recogniser(config).reason.startswith("it had learned: twice the clips, 8 to 16, gained")
    outcome = train_recogniser(replace(config, optimiser="published", out=tmp_path / "b"))
    assert (outcome.cut_short, outcome.reason) == (False, "the published schedule ended after 80 clips")
