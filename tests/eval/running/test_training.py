"""One command trains everything in order, keeps what is there, and names what does not fit."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ehar.conditions import Conditions
from ehar.data.source import load_data
from ehar.errors import DataError, EharError, ModelError, UsageError
from ehar.files import write_text
from eval.running.sweep import SweepConfig, train_sets
from eval.running.training import (
    TrainAllConfig,
    has_fixed_best,
    has_gain_field,
    has_recogniser,
    train_agents,
    train_all,
    train_fixed_best,
    train_gain_field,
    train_recogniser,
)
from planners.agents.config import AgentTrainingConfig
from planners.place.config import FixedBestConfig
from planners.place.fit import FixedPlaceFit, TriedPlace
from planners.place.go_to_place import PLACES
from planners.shipped import SHIPPED as GAIN_FIELDS
from planners.value.config import GainTrainingConfig
from planners.value.fit import Scores
from planners.value.training import GainTraining
from recognition.calibration import Temperature
from recognition.networks.spec import NetworkSpec
from recognition.storage import SHIPPED as RECOGNISERS
from recognition.storage import load_recogniser, recogniser_path, save_recogniser
from recognition.training.config import TrainingConfig
from recognition.training.stopping import Evaluation, Outcome
from tests.helpers.fakes import tiny_data
from tests.helpers.fixed_places import save_place

DUO = Conditions(data="duo")
RECOGNISER, GAIN_FIELD, FIXED_BEST = (f"{name}-perfect-moving" for name in ("causal", "gain-field", "fixed-best"))


def copy(folder: Path, stem: str, out: Path) -> None:
    out.mkdir(exist_ok=True)
    for ending in (".safetensors", ".json"):
        shutil.copy(folder / f"{stem}{ending}", out)


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Replace the trainings by notes of their names; the recogniser's leaves the shipped one behind."""
    heard: list[str] = []

    def recogniser(config: TrainingConfig, report: object, planned: object) -> Outcome:
        heard.append("recogniser")
        copy(RECOGNISERS / "duo", RECOGNISER, config.out)
        best = Evaluation(step=3, clips=24_000, train_loss=0.5, nll=0.25, accuracy=0.8)
        return Outcome(best, gain=0.01, cut_short=True, reason="cut short at 24,000 clips")

    def gain_field(config: GainTrainingConfig, lead: object, report: object, note: object) -> GainTraining:
        heard.append("gain field")
        assert config.conditions.directory is not None
        found = {12: Scores(0.1, 0.01, 0.05), 24: Scores(0.1, 0.0105, 0.05)}
        path = config.conditions.directory / f"{GAIN_FIELD}.safetensors"
        rounds = (Scores(0.1, 0.02, 0.05), Scores(0.1, 0.03, 0.05))
        return GainTraining(path, {}, found, "validation", rounds, cut_short=False)

    def fixed_best(config: FixedBestConfig, report: object, note: object) -> FixedPlaceFit:
        heard.append("fixed-best")
        assert config.conditions.directory is not None
        tried = (TriedPlace(PLACES["front"], 0.75), TriedPlace(PLACES["side"], 0.5))
        return FixedPlaceFit(config.conditions.directory / f"{FIXED_BEST}.json", tried, "validation")

    def agents(config: AgentTrainingConfig, report: object, note: object) -> list[Path]:
        heard.append("agents")
        return [config.directory / f"{name}.safetensors" for name in ("il", "ppo")]

    monkeypatch.setattr("recognition.training.trainer.train_recogniser", recogniser)
    monkeypatch.setattr("planners.value.training.train_gain_field", gain_field)
    monkeypatch.setattr("planners.place.fit.fit_fixed_best", fixed_best)
    monkeypatch.setattr("planners.agents.training.train_agents", agents)
    return heard


def test_tiny_is_a_first_try_of_what_planners_need_most(tmp_path: Path, calls: list[str]) -> None:
    tiny = TrainAllConfig(conditions=DUO, out=tmp_path, setting="tiny")
    train_all(tiny)
    assert calls == ["recogniser", "gain field", "agents"]
    assert (tiny.recogniser.clips, tiny.recogniser.interval, tiny.recogniser.size) == (640, 320, "small")
    assert (tiny.gain_field.batches, tiny.agents.stage_names, tiny.agents.imitation("il").episodes) == (1, ("il",), 64)
    usual = TrainAllConfig(conditions=DUO, out=tmp_path)
    assert usual.recogniser.clips == TrainingConfig.clips and usual.gain_field.batches == GainTrainingConfig.batches
    assert usual.agents.stage_names == ("il", "ppo", "il-ppo", "dagger")


@pytest.mark.parametrize(("changes", "told"), [({"seed": 1}, "--seed 0, asked for 1"), ({"length": 30}, "--length 60")])
def test_a_recogniser_of_another_seed_or_length_is_not_taken_for_this_one(
    tmp_path: Path, changes: dict[str, int], told: str
) -> None:
    copy(RECOGNISERS / "duo", RECOGNISER, tmp_path)
    assert has_recogniser(TrainAllConfig(conditions=DUO, out=tmp_path))
    with pytest.raises(ModelError, match=f"trained with {told}.*: remove it to train again, or choose another --out"):
        has_recogniser(TrainAllConfig(conditions=replace(DUO, **changes), out=tmp_path))  # type: ignore[arg-type]


def test_a_recogniser_that_met_nothing_in_the_way_is_not_taken_for_one_that_did(tmp_path: Path) -> None:
    copy(RECOGNISERS / "duo", RECOGNISER, tmp_path)
    usual = TrainAllConfig(conditions=DUO, out=tmp_path)
    asked = replace(usual, in_the_way=True)
    assert asked.recogniser.in_the_way and not usual.recogniser.in_the_way
    with pytest.raises(ModelError, match="trained without --in-the-way, asked for a training with it: remove it"):
        has_recogniser(asked)
    description = tmp_path / f"{RECOGNISER}.json"
    held = json.loads(description.read_text())
    held["training"]["run"]["in_the_way"] = True
    description.write_text(json.dumps(held))
    assert has_recogniser(asked)
    with pytest.raises(ModelError, match="trained with --in-the-way, asked for a training without it: remove it"):
        has_recogniser(usual)


def test_a_first_try_is_not_taken_for_a_training_nor_a_training_for_a_first_try(
    tmp_path: Path, calls: list[str]
) -> None:
    copy(RECOGNISERS / "duo", RECOGNISER, tmp_path)
    description = tmp_path / f"{RECOGNISER}.json"
    with pytest.raises(ModelError, match="that is not of --setting tiny: remove it to train again, or choose another"):
        has_recogniser(TrainAllConfig(conditions=DUO, out=tmp_path, setting="tiny"))
    held = json.loads(description.read_text())
    held["training"]["run"]["interval"] = 320
    description.write_text(json.dumps(held))
    assert has_recogniser(TrainAllConfig(conditions=DUO, out=tmp_path, setting="tiny"))
    with pytest.raises(ModelError, match="got a recogniser of --setting tiny: remove it"):
        has_recogniser(TrainAllConfig(conditions=DUO, out=tmp_path))


def test_everything_is_trained_in_order(tmp_path: Path, calls: list[str]) -> None:
    trained = train_all(TrainAllConfig(conditions=DUO, out=tmp_path))
    assert calls == ["recogniser", "gain field", "fixed-best", "agents"]
    assert [path.stem for path in trained.paths] == [RECOGNISER, GAIN_FIELD, FIXED_BEST, "il", "ppo"]
    assert {path.parent for path in trained.paths} == {tmp_path}
    assert trained.lines == (f"next: ehar benchmark --data duo --models {tmp_path}",)


def test_a_training_alone_says_what_it_gave(tmp_path: Path, calls: list[str]) -> None:
    config = TrainAllConfig(conditions=DUO, out=tmp_path)
    assert train_recogniser(config.recogniser).lines == (
        f"best after 24,000 clips: validation accuracy 80.0 % (mean over frames), NLL 0.250; written to {tmp_path}",
        "warning: cut short at 24,000 clips",
    )
    assert train_gain_field(config.gain_field).lines == (
        "in cross-validation; on validation, where six cameras in ten follow nbv-search and the others stay, "
        f"2.00 % before the second round and 3.00 % after it; written to {tmp_path / GAIN_FIELD}.safetensors",
        "it had learned: 24 batches instead of 12 gained 0.05 points on validation",
    )
    assert train_fixed_best(config.fixed_best).lines == (
        f"the best of 2 places: {PLACES['front']}",
        "accuracy 75.0 % (mean over frames), 50.0 % at the worst, on the validation part; "
        f"written to {tmp_path / FIXED_BEST}.json",
    )
    assert train_agents(config.agents).lines == (f"2 agents are in {tmp_path}: il, ppo",)
    assert calls == ["recogniser", "gain field", "fixed-best", "agents"]


def test_what_is_there_is_kept_and_said(tmp_path: Path, calls: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    copy(RECOGNISERS / "duo", RECOGNISER, tmp_path)
    copy(GAIN_FIELDS / "duo", GAIN_FIELD, tmp_path)
    sha256 = load_recogniser(replace(DUO, models=tmp_path), load_data("duo")).sha256
    save_place(tmp_path, recogniser_sha256=sha256)
    train_all(TrainAllConfig(conditions=DUO, out=tmp_path))
    lines = capsys.readouterr().out.splitlines()
    assert calls == ["agents"]
    assert "recogniser" in lines[0] and "kept" in lines[0]
    assert "gain field" in lines[1] and "kept" in lines[1]
    assert lines[2] == f"3 of 4: the place of fixed-best in {tmp_path} is kept"
    assert lines[3] == "4 of 4: the agents il, ppo, il-ppo and dagger"


def test_a_gain_field_for_another_recogniser_is_trained_anew(tmp_path: Path) -> None:
    copy(RECOGNISERS / "duo", RECOGNISER, tmp_path)
    copy(GAIN_FIELDS / "solo", GAIN_FIELD, tmp_path)
    assert not has_gain_field(TrainAllConfig(conditions=DUO, out=tmp_path))


def test_a_place_for_another_recogniser_is_found_anew(tmp_path: Path) -> None:
    copy(RECOGNISERS / "duo", RECOGNISER, tmp_path)
    save_place(tmp_path, recogniser_sha256="another")
    assert not has_fixed_best(TrainAllConfig(conditions=DUO, out=tmp_path))


def test_a_recogniser_of_other_data_is_named_not_overwritten(tmp_path: Path, calls: list[str]) -> None:
    copy(RECOGNISERS / "solo", RECOGNISER, tmp_path)
    with pytest.raises(ModelError, match="class_names do not fit duo"):
        train_all(TrainAllConfig(conditions=DUO, out=tmp_path))
    assert calls == []


def test_a_small_recogniser_is_not_taken_for_the_published_one(tmp_path: Path, calls: list[str]) -> None:
    told = replace(DUO, views="paper")
    data = load_data("duo")
    spec = NetworkSpec.of(data, form="ctrgcn", size="small", length=DUO.frames)
    path = recogniser_path(tmp_path, replace(told, form="ctrgcn"))
    run = {"data_sha256": data.sha256, "size": "small"}
    save_recogniser(path, spec.build(), spec, Temperature(), {"run": run})
    with pytest.raises(ModelError, match="got a recogniser of size small, expected published, as --setting paper"):
        train_all(TrainAllConfig(conditions=told, out=tmp_path, setting="paper"))
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
        train_all(TrainAllConfig(conditions=DUO, out=tmp_path))
    assert calls == []


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seeds": ()}, "--seeds: got none, expected whole numbers of at least 0, each once"),
        ({"workers": 0}, "--workers: got 0, expected at least 1"),
        ({"length": 4}, "--length: got 4, expected at least 5"),
        ({"device": "tpu"}, "--device tpu: expected cpu or cuda"),
        (
            {"setting": "paper"},
            "--setting paper: expected the paper's recogniser, --views paper --form ctrgcn, "
            "got --views moving --form ctrgcn",
        ),
    ],
)
def test_what_makes_no_sense_is_refused_before_anything_is_trained(
    tmp_path: Path, calls: list[str], changes: dict[str, Any], message: str
) -> None:
    length = changes.pop("length", DUO.frames)
    with pytest.raises(UsageError) as caught:
        train_all(TrainAllConfig(conditions=replace(DUO, length=length), out=tmp_path, **changes))
    assert str(caught.value) == message
    assert calls == []


def test_weights_without_their_description_are_no_recogniser(tmp_path: Path) -> None:
    copy(RECOGNISERS / "duo", RECOGNISER, tmp_path)
    (tmp_path / f"{RECOGNISER}.json").unlink()
    assert not has_recogniser(TrainAllConfig(conditions=DUO, out=tmp_path))


def test_the_same_data_and_conditions_go_into_every_training(tmp_path: Path) -> None:
    told = Conditions(data="x.npz", sensor="estimator", views="paper", length=30, fps=30.0)
    config = TrainAllConfig(conditions=told, out=tmp_path, seeds=(7, 8, 9), setting="paper")
    for part in (config.recogniser, config.agents):
        assert replace(part.conditions, models=None) == replace(told, form="ctrgcn")
    quick = replace(config, setting="quick")
    for part in (quick.recogniser, quick.gain_field, quick.fixed_best, quick.agents):
        assert replace(part.conditions, models=None) == told
    assert (config.recogniser.size, config.recogniser.optimiser, config.recogniser.batch) == (
        "published",
        "published",
        64,
    )
    assert config.agents.seeds == (7, 8, 9) and config.agents.imitation("il").episodes == 10_000
    assert config.agents.directory == config.gain_field.conditions.models == config.recogniser.out == tmp_path


def test_the_benchmark_that_follows_runs_under_the_same_conditions(tmp_path: Path) -> None:
    config = TrainAllConfig(conditions=Conditions(data="x.npz"), out=Path("m"))
    assert config.benchmark_options == "--data x.npz --models m"
    told = Conditions(data="x.npz", sensor="estimator", length=30, fps=30.0)
    short = TrainAllConfig(conditions=told, out=Path("m"))
    assert short.benchmark_options == "--data x.npz --models m --sensor estimator --length 30 --fps 30.0"


def test_missing_data_are_an_error_of_ours(tmp_path: Path) -> None:
    with pytest.raises(EharError, match=r"missing\.npz"):
        train_all(TrainAllConfig(conditions=Conditions(data=tmp_path / "missing.npz"), out=tmp_path))


def test_what_will_be_missing_is_told_before_anything_begins(
    tmp_path: Path, calls: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    tiny = tiny_data(sequences=60)
    with pytest.raises(DataError, match=r"expected 1 training sequence of at least 60 frames, got 0; --length 20"):
        train_all(TrainAllConfig(conditions=Conditions(data=tiny), out=tmp_path))
    assert calls == []
    unseen = replace(tiny, class_names=(*tiny.class_names, "never"))
    with pytest.raises(EharError):  # the recogniser that the fake training leaves behind is one of duo
        train_all(TrainAllConfig(conditions=Conditions(data=unseen, length=20), out=tmp_path))
    line, *_ = capsys.readouterr().out.splitlines()
    assert line == "warning: no training sequence of at least 20 frames of never: the recogniser will never name it"
    assert calls == ["recogniser"]


def test_a_folder_that_cannot_be_written_to_is_told_before_anything_begins(tmp_path: Path) -> None:
    write_text(tmp_path / "file", [])
    out = tmp_path / "file" / "models"
    everything = TrainAllConfig(conditions=DUO, out=out)
    for train, told in (
        (train_recogniser, everything.recogniser),
        (train_gain_field, everything.gain_field),
        (train_fixed_best, everything.fixed_best),
        (train_agents, everything.agents),
        (train_all, everything),
        (train_sets, SweepConfig(conditions=Conditions(), data=("duo", "solo"), out=out, workers=1)),
    ):
        with pytest.raises(
            UsageError, match=r"file/models.*: expected a folder that can be written to, /.*file is not"
        ):
            train(told)
