"""One command trains everything in order, keeps what is there, and names what does not fit."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from eval.running.train_all import TrainAllConfig, has_gain_field, has_recogniser, train_all

from ehar.errors import EharError, ModelError, UsageError
from planners.value.model import SHIPPED as GAIN_FIELDS
from recognition.storage import SHIPPED as RECOGNISERS

RECOGNISER, GAIN_FIELD = "causal-perfect-moving", "gain-field-perfect-moving"


def copy(folder: Path, stem: str, out: Path) -> None:
    out.mkdir(exist_ok=True)
    for ending in (".safetensors", ".json"):
        shutil.copy(folder / f"{stem}{ending}", out)


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Replace the trainings by notes of their names; the recogniser's leaves the shipped one behind."""
    heard: list[str] = []

    def recogniser(config, report):
        heard.append("recogniser")
        copy(RECOGNISERS / "duo", RECOGNISER, config.out)

    monkeypatch.setattr("recognition.training.trainer.train_recogniser", recogniser)
    monkeypatch.setattr("planners.value.training.train_gain_field", lambda config, report: heard.append("gain field"))
    monkeypatch.setattr("planners.agents.training.train_agents", lambda config, report, note: heard.append("agents"))
    return heard


def test_everything_is_trained_in_order(tmp_path: Path, calls: list[str]) -> None:
    train_all(TrainAllConfig(data="duo", out=tmp_path), lambda line: None)
    assert calls == ["recogniser", "gain field", "agents"]


def test_what_is_there_is_kept_and_said(tmp_path: Path, calls: list[str]) -> None:
    copy(RECOGNISERS / "duo", RECOGNISER, tmp_path)
    copy(GAIN_FIELDS / "duo", GAIN_FIELD, tmp_path)
    lines: list[str] = []
    train_all(TrainAllConfig(data="duo", out=tmp_path), lines.append)
    assert calls == ["agents"]
    assert "recogniser" in lines[0] and "kept" in lines[0]
    assert "gain field" in lines[1] and "kept" in lines[1]


def test_a_gain_field_for_another_recogniser_is_trained_anew(tmp_path: Path) -> None:
    copy(RECOGNISERS / "duo", RECOGNISER, tmp_path)
    copy(GAIN_FIELDS / "solo", GAIN_FIELD, tmp_path)
    assert not has_gain_field(TrainAllConfig(data="duo", out=tmp_path))


def test_a_recogniser_of_other_data_is_named_not_overwritten(tmp_path: Path, calls: list[str]) -> None:
    copy(RECOGNISERS / "solo", RECOGNISER, tmp_path)
    with pytest.raises(ModelError, match="class_names do not fit duo"):
        train_all(TrainAllConfig(data="duo", out=tmp_path), lambda line: None)
    assert calls == []


def test_a_small_recogniser_is_not_taken_for_the_published_one(tmp_path: Path, calls: list[str]) -> None:
    copy(RECOGNISERS / "duo", RECOGNISER, tmp_path)
    with pytest.raises(ModelError, match="got a recogniser of size small, expected published, as --setting paper"):
        train_all(TrainAllConfig(data="duo", out=tmp_path, setting="paper"), lambda line: None)
    assert calls == []


def test_a_recogniser_of_other_recordings_of_the_same_classes_is_named(tmp_path: Path, calls: list[str]) -> None:
    copy(RECOGNISERS / "duo", RECOGNISER, tmp_path)
    file = tmp_path / f"{RECOGNISER}.json"
    held = json.loads(file.read_text())
    held["training"]["run"]["data_sha256"] = "0123456789abcdef"
    file.write_text(json.dumps(held))
    with pytest.raises(
        ModelError, match=r"another data set: its sha256 was 0123456789ab\.\.\., that of duo is [0-9a-f]{12}"
    ):
        train_all(TrainAllConfig(data="duo", out=tmp_path), lambda line: None)
    assert calls == []


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seeds": 0}, "--seeds: got 0, expected at least 1"),
        ({"workers": 0}, "--workers: got 0, expected at least 1"),
        ({"length": 4}, "--length: got 4, expected at least 5"),
        ({"device": "tpu"}, "--device tpu: expected cpu or cuda"),
    ],
)
def test_what_makes_no_sense_is_refused_before_anything_is_trained(
    tmp_path: Path, calls: list[str], changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(UsageError) as caught:
        train_all(TrainAllConfig(data="duo", out=tmp_path, **changes), lambda line: None)
    assert str(caught.value) == message
    assert calls == []


def test_weights_without_their_description_are_no_recogniser(tmp_path: Path) -> None:
    copy(RECOGNISERS / "duo", RECOGNISER, tmp_path)
    (tmp_path / f"{RECOGNISER}.json").unlink()
    assert not has_recogniser(TrainAllConfig(data="duo", out=tmp_path))


def test_the_same_data_and_conditions_go_into_every_training(tmp_path: Path) -> None:
    config = TrainAllConfig(
        data="x.npz", out=tmp_path, sensor="estimator", views="paper", length=30, fps=30.0, seeds=3, setting="paper"
    )
    for part in (config.recogniser, config.gain_field, config.agents):
        assert (part.data, part.sensor, part.views, part.length, part.fps) == ("x.npz", "estimator", "paper", 30, 30.0)
    assert config.recogniser.size == "published"
    assert config.agents.seeds == 3 and config.agents.imitation("il").episodes == 10_000
    assert config.agents.directory == config.gain_field.models == config.recogniser.out == tmp_path


def test_the_benchmark_that_follows_runs_under_the_same_conditions(tmp_path: Path) -> None:
    config = TrainAllConfig(data="x.npz", out=Path("m"))
    assert config.benchmark_options == "--data x.npz --models m"
    short = TrainAllConfig(data="x.npz", out=Path("m"), sensor="estimator", length=30, fps=30.0)
    assert short.benchmark_options == "--data x.npz --models m --sensor estimator --length 30 --fps 30.0"


def test_missing_data_are_an_error_of_ours(tmp_path: Path) -> None:
    with pytest.raises(EharError, match=r"missing\.npz"):
        train_all(TrainAllConfig(data=str(tmp_path / "missing.npz"), out=tmp_path), lambda line: None)
