"""Calibration on people who are left out: who is asked, that nothing but temperatures changes, and that it resumes."""

import json
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray, IntArray
from ehar.conditions import Conditions
from ehar.data.any_source import load_recordings
from ehar.data.motion_file import save_motion
from ehar.data.scenario import split_parts
from ehar.data.streams.file import save_streams
from ehar.errors import DataError, UsageError
from recognition.calibration import Temperature, fit_temperature
from recognition.left_out import leave_people_out, leave_performers_out, of_known_classes
from recognition.storage import recogniser_path
from recognition.training import material
from recognition.training import trainer as training
from recognition.training.config import TrainingConfig
from recognition.training.material import gather
from recognition.training.planned_views import PlannedViews
from recognition.training.trainer import train_recogniser
from tests.helpers.fakes import tiny_data
from tests.helpers.streams import raising_streams

PEOPLE = 8


@pytest.fixture(autouse=True)
def few_validation_clips(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(material, "VALIDATION_CLIPS", 24)


@pytest.fixture
def config(tmp_path: Path) -> TrainingConfig:
    data = tiny_data(sequences=12 * PEOPLE)
    subjects = np.repeat(np.arange(PEOPLE), 12)[:, None]
    save_motion(tmp_path / "tiny.npz", replace(data, subjects=subjects))
    told = Conditions(data=str(tmp_path / "tiny.npz"), length=8)
    return TrainingConfig(conditions=told, out=tmp_path / "models", clips=48, batch=8, interval=16, threads=1)


def trained(config: TrainingConfig, out: Path, folds: int) -> tuple[bytes, dict[str, object]]:
    config = replace(config, out=out, folds=folds)
    train_recogniser(config)
    path = recogniser_path(config.out, config.conditions)
    assert sorted(file.suffix for file in out.iterdir()) == [".json", ".safetensors"]
    return path.read_bytes(), json.loads(path.with_suffix(".json").read_text())


def test_temperatures_are_fitted_on_more_people_and_weights_stay(
    config: TrainingConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[FloatArray, IntArray]] = []

    def fit(logits: FloatArray, labels: IntArray, weights: FloatArray | None) -> Temperature:
        asked.append((logits, labels))
        return fit_temperature(logits, labels, weights)

    monkeypatch.setattr(training, "fit_temperature", fit)
    weights, told = trained(config, tmp_path / "usual", 0)
    same, calibrated = trained(config, tmp_path / "calibrated", 2)
    assert weights == same
    (few, few_labels), (more, more_labels) = asked
    assert (len(few), len(more)) == (24, 3 * 24) == (len(few_labels), len(more_labels))
    np.testing.assert_array_equal(more[:24], few)
    assert not np.allclose(more[24:48], more[48:])
    assert calibrated["training"]["calibrated_on"] == "these, and people left out in 2 folds"  # type: ignore[index]
    assert "calibrated_on" not in told["training"] and "folds" not in told["training"]["run"]  # type: ignore[index,operator]
    assert calibrated["training"]["run"]["folds"] == 2  # type: ignore[index]


def test_folds_learn_for_as_long_as_the_weights_that_are_kept_had(
    config: TrainingConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = training._Run
    evaluate, answer, lengths = run._evaluate, run.answer_after, []

    def worse_and_worse(self: Any) -> None:
        evaluate(self)
        last = self.evaluations[-1]
        self.evaluations[-1] = replace(last, accuracy=1 / last.step)

    def answer_after(self: Any, steps: int, report: Any) -> FloatArray:
        lengths.append(steps)
        return answer(self, steps, report)

    monkeypatch.setattr(run, "_evaluate", worse_and_worse)
    monkeypatch.setattr(run, "answer_after", answer_after)
    trained(config, tmp_path / "out", 2)
    assert lengths == [2, 2]  # of 6 steps; the first evaluation, after 16 clips, was the best


def test_folds_follow_the_schedule_of_the_weights_that_are_kept(
    config: TrainingConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    learn, answer, planned = training.Learner.learn, training._Run.answer_after, []

    def of_steps(self: Any, *clips: Any, step: int, steps: int) -> float:
        planned.append(steps)
        return learn(self, *clips, step=step, steps=steps)

    def answer_earlier(self: Any, steps: int, report: Any) -> FloatArray:
        return answer(self, 2, report)  # as if the second of 6 steps had been the best

    monkeypatch.setattr(training.Learner, "learn", of_steps)
    monkeypatch.setattr(training._Run, "answer_after", answer_earlier)
    trained(replace(config, optimiser="published"), tmp_path / "out", 2)
    assert planned == [6] * (6 + 2 * 2)


def test_couples_whose_partners_change_are_not_called_people(tmp_path: Path) -> None:
    couples = np.array(list(combinations(range(5), 2)) * 24)
    save_motion(tmp_path / "mixed.npz", replace(tiny_data(sequences=240, persons=2), subjects=couples))
    told = Conditions(data=str(tmp_path / "mixed.npz"), length=8)
    config = TrainingConfig(conditions=told, out=tmp_path, clips=16, batch=8, interval=8, threads=1)
    _, told_by = trained(config, tmp_path / "out", 2)
    assert told_by["training"]["calibrated_on"] == "these, and couples left out in 2 folds"  # type: ignore[index]


@pytest.mark.parametrize("clips", [16, 32])
def test_a_run_that_is_stopped_in_a_fold_goes_on(config: TrainingConfig, tmp_path: Path, clips: int) -> None:
    class Stopped(Exception):
        pass

    begun = 0

    def stop(seen: int, expected: int, evaluations: object) -> None:
        nonlocal begun
        begun += seen == 8
        if begun == 3 and seen == clips:  # in the second fold
            raise Stopped

    through, told = trained(config, tmp_path / "through", 2)
    with pytest.raises(Stopped):
        train_recogniser(replace(config, out=tmp_path / "twice", folds=2), stop)
    again, calibrated = trained(config, tmp_path / "twice", 2)
    assert through == again and told["log_temperatures"] == calibrated["log_temperatures"]


def test_streams_are_asked_too(tmp_path: Path) -> None:
    streams = raising_streams(people=10)
    save_streams(tmp_path / "streams.npz", streams)
    told = Conditions(data=str(tmp_path / "streams.npz"))
    config = TrainingConfig(conditions=told, out=tmp_path, clips=16, batch=8, interval=8, threads=1)
    _, told_by = trained(config, tmp_path / "out", 2)
    assert "calibrated_on" in told_by["training"]  # type: ignore[operator]


def test_people_who_are_left_out_are_asked_and_not_learned_from(config: TrainingConfig) -> None:
    folds = [gather(replace(config, folds=3), fold=number) for number in range(3)]
    data = folds[0].data
    people = data.subjects[split_parts(data).recogniser]
    asked = []
    for fold in folds:
        learned = set(data.subjects[fold.source._sequences, 0])
        held = set(data.subjects[fold.validation.sequences, 0])
        assert held and not learned & held
        asked += held
    assert sorted(asked) == sorted(np.unique(people))
    assert len({training._Run(replace(config, folds=3), None, number).path for number in range(3)}) == 3


def test_what_nobody_else_shows_is_not_asked() -> None:
    data = tiny_data(sequences=12)
    subjects = np.repeat(np.arange(3), 4)[:, None]
    labels = data.labels.copy()
    labels[:] = np.arange(12) % 2
    labels[1] = 2
    data = replace(data, subjects=subjects, labels=labels)
    folds = leave_people_out(data, np.arange(12), 3)
    left = next(fold for fold in folds if 1 in fold.held)
    assert of_known_classes(data, left).tolist() == [0, 2, 3]


def test_where_everybody_performs_with_everybody_couples_are_left_out_whoever_acts_first() -> None:
    couples = np.array([(1, 2), (2, 3), (3, 1), (1, 3)] * 3)
    data = replace(tiny_data(sequences=12, persons=2), subjects=couples)
    folds = leave_performers_out(data, np.arange(12), 3)
    for fold in folds:
        left, known = ({frozenset(pair) for pair in couples[part].tolist()} for part in (fold.held, fold.learned))
        assert len(left) == 1 and not left & known
    assert sorted(np.concatenate([fold.held for fold in folds])) == list(range(12))


def test_what_cannot_be_left_out_is_refused(config: TrainingConfig, tmp_path: Path) -> None:
    for folds, expected in (
        (-1, "got -1, expected at least 0"),
        (1, "got 1, expected 2 to"),
        (99, "got 99, expected 2"),
    ):
        with pytest.raises(UsageError, match=f"--folds: {expected}"):
            train_recogniser(replace(config, folds=folds))
    with pytest.raises(UsageError, match="--folds: expected no --init: its weights may have learned"):
        train_recogniser(replace(config, folds=2, init=tmp_path / "other.safetensors"))
    save_motion(tmp_path / "unnamed.npz", tiny_data(sequences=24))
    unnamed = replace(config.conditions, data=str(tmp_path / "unnamed.npz"))
    with pytest.raises(DataError, match="expected the names of all people who are trained on"):
        train_recogniser(replace(config, conditions=unnamed, folds=2))
    assert not config.out.exists()


def test_planned_episodes_of_too_few_people_are_refused_before_the_training(config: TrainingConfig) -> None:
    data = load_recordings(str(config.conditions.data))
    left = leave_performers_out(data, split_parts(data).recogniser, 2)
    few = np.setdiff1d(left[0].learned, left[1].learned)[:1]  # of people whom the second fold leaves out
    planned = PlannedViews(few, np.zeros(1, np.int64), np.tile([6.0, 0.0, 1.0], (1, 8, 1)))
    with pytest.raises(
        UsageError, match=r"^--folds 2: got no planned episode of those whom fold 1 learns from; expected"
    ):
        train_recogniser(replace(config, folds=2), planned=planned)
    assert not config.out.exists()
