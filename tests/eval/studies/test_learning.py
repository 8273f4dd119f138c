"""Runs whose recognisers learned longer or shorter are one table and one picture."""

from dataclasses import asdict, replace
from pathlib import Path

import pytest

from ehar.errors import DataError, EharError, ModelError, UsageError
from eval.cli.main import main
from eval.studies.learning import LearningCurve, learning
from recognition.calibration import Temperature
from recognition.networks.spec import NetworkSpec
from recognition.storage import recogniser_path, recogniser_sha256, save_recogniser
from recognition.training.stopping import Evaluation
from tests.helpers.fakes import stopped, tiny_data
from tests.helpers.made_records import CONFIG_OF_RUN, make_records, write_finished

SKILLS = {"no-act": 0.0, "h-rotate": 0.1, "front": 0.5, "nbv": 1.0, "oracle": 3.0}


def run(
    folder: Path, clips: int, *, seed: int = 0, trained: bool = True, init: str | None = None, **skills: float
) -> Path:
    """Write a recogniser that was best after some clips, and a run with it."""
    models = folder / f"models-{clips}"
    spec = NetworkSpec.of(tiny_data(), form="causal", size="small", length=4)
    accuracies = {clips // 2: 0.5, clips: 0.625, 2 * clips: 0.6}
    history = [asdict(Evaluation(1, seen, 1.0, 1.0, accuracy)) for seen, accuracy in accuracies.items()]
    path = recogniser_path(models, replace(CONFIG_OF_RUN.conditions, models=models))
    told = {"evaluations": history if trained else [], "run": {"init_sha256": init}}
    save_recogniser(path, spec.build(clips), spec, Temperature(), told)
    records = {
        name: make_records(clips + row, skill=skill, episodes=60, people=6)
        for row, (name, skill) in enumerate({**SKILLS, **skills}.items())
    }
    sha256 = recogniser_sha256(path, Temperature())
    return write_finished(folder / f"run-{clips}", records, models=str(models), recogniser_sha256=sha256, seed=seed)


def test_the_command_prints_a_row_for_each_training_and_draws_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = [run(tmp_path, clips) for clips in (4000, 1000)]
    main(["study", "learning", *map(str, runs), "--out", str(tmp_path / "out")])
    assert "best rule" in capsys.readouterr().out
    found = learning(runs)
    (table,) = found.tables()
    assert [row[:2] for row in table.rows] == [("1,000", "62.5"), ("4,000", "62.5")]
    for row, learned in zip(table.rows, found.runs, strict=True):
        accuracy = {planner.name: planner.acc_mean for planner in learned.run.summary.planners}
        assert row[2:7] == (
            f"{accuracy['no-act']:.1f}",
            f"{accuracy['front']:.1f} (front)",
            f"{accuracy['nbv']:.1f}",
            f"{accuracy['oracle']:.1f}",
            f"{accuracy['oracle'] - accuracy['no-act']:.1f}",
        )
        assert row[7].startswith(f"{accuracy['nbv'] - accuracy['no-act']:+.1f} [")
    assert (tmp_path / "out" / "table.md").is_file() and (tmp_path / "out" / "learning.png").is_file()
    assert repr(found) == "LearningCurve(nbv: 1,000, 4,000 clips)"


def test_a_study_that_is_stopped_before_its_picture_has_no_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = [run(tmp_path, clips) for clips in (4000, 1000)]
    monkeypatch.setattr(LearningCurve, "draw", stopped)
    with pytest.raises(KeyboardInterrupt):
        learning(runs, out=tmp_path / "out")
    assert not (tmp_path / "out" / "table.md").exists()


def test_what_is_no_curve_is_refused(tmp_path: Path) -> None:
    def refused(runs: list[Path], kind: type[EharError], message: str, **options: str) -> None:
        with pytest.raises(kind, match=message):
            learning(runs, **options)

    runs = [run(tmp_path / "a", clips) for clips in (1000, 4000)]
    refused(runs[:1], UsageError, "expected at least 2 folders of runs, got 1")
    refused(runs, UsageError, "expected a run with dagger, got no-act", planner="dagger")
    refused([runs[0], run(tmp_path / "b", 2000, seed=1)], UsageError, "they differ in seed")
    refused([runs[0], run(tmp_path / "c", 2000, trained=False)], DataError, "the evaluations of the training, got none")
    refused([runs[0], run(tmp_path / "f", 2000, init="0" * 64)], UsageError, "went on from other weights")
    again = run(tmp_path / "d", 2000)
    run(tmp_path / "e", 3000)
    models = tmp_path / "d" / "models-2000"
    for file in (tmp_path / "e" / "models-3000").iterdir():
        (models / file.name).write_bytes(file.read_bytes())
    refused([runs[0], again], DataError, "got another one: it was trained since")
    for file in models.iterdir():
        file.unlink()
    refused([runs[0], again], ModelError, "no such file: expected the recogniser of")
