"""The study of trials: what is done is kept, and the table says what each change is worth."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.data.motion_file import save_motion
from ehar.errors import UsageError
from eval.cli.main import main
from eval.scores.metrics import mean_acc
from eval.studies.trials import study
from eval.studies.trials.scores import Answered, _calibrated, score_set
from eval.studies.trials.study import trials
from recognition.trials import trial
from recognition.trials.changes import CHANGES, USUAL, Change
from tests.recognition.trials.test_folds import of_people


@pytest.fixture(autouse=True)
def few_held_clips(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "HELD_CLIPS", 24)


@pytest.fixture
def motion(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.npz"
    save_motion(path, of_people())
    return path


def test_folds_are_trained_one_after_another_and_kept(
    motion: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "trials"
    told = ["study", "trials", str(motion), "--sensor", "perfect", "--folds", "2", "--clips", "64", "--out", str(out)]
    main([*told, "--only", "1"])
    first = capsys.readouterr()
    assert first.err.count("tiny, fold 1, ") == len(CHANGES) - 1  # nothing to learn from first, with one set
    assert "1 of 2 folds" in first.out and "pre-trained" not in first.out
    main(told)
    second = capsys.readouterr()
    assert "fold 1" not in second.err and second.err.count("tiny, fold 0, ") == len(CHANGES) - 1
    held = json.loads((out / "summary.json").read_text())
    assert held["sets"][0]["folds"] == 2
    rows = {row["row"]: row for row in held["sets"][0]["rows"]}
    assert rows[USUAL]["gain"] == 0 and rows[USUAL]["ece_calibrated"] is not None
    assert "pre-trained" not in rows and "ensemble of three" in rows
    assert "2 of 2 folds" in (out / "table.md").read_text()
    with pytest.raises(UsageError, match="differs in clips"):
        trials([str(motion)], out=out, sensor="perfect", folds=2, clips=[96])


def test_sets_of_which_nothing_is_done_are_left_out_of_the_tables(
    motion: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    train = study._SetTrials.train

    def but_duo(self: study._SetTrials, number: int, changes: list[str]) -> None:
        if self._data.name != "duo":
            train(self, number, changes)

    monkeypatch.setattr(study._SetTrials, "train", but_duo)
    monkeypatch.setattr(study, "CHANGES", {USUAL: Change()})
    found = trials([str(motion), "duo"], out=tmp_path / "out", sensor="perfect", folds=2, only=[0], clips=[32])
    assert [held.data for held in found.sets] == ["tiny (synthetic)"]
    assert [row.row for row in found.sets[0].rows] == [USUAL, "last weights"]


def test_each_set_learns_as_many_clips_as_it_is_told(
    motion: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[int] = []
    learn = trial.learn

    def counts(learner: Any, lesson: trial.Lesson, *rest: Any) -> None:
        steps.append(lesson.clips)
        learn(learner, lesson, *rest)

    monkeypatch.setattr(trial, "learn", counts)
    monkeypatch.setattr(study, "CHANGES", {USUAL: Change()})
    found = trials([str(motion), "solo"], out=tmp_path / "out", sensor="perfect", folds=2, only=[0], clips=[64, 32])
    assert steps == [64, 32]
    assert "learned from so many clips: tiny 64, solo 32." in str(found)


def test_who_stops_it_has_the_table_of_what_is_done(
    motion: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = trial.run_trial

    def stops(*given: Any, **named: Any) -> Any:
        if given[3].smoothing:
            raise KeyboardInterrupt
        return run(*given, **named)

    monkeypatch.setattr(trial, "run_trial", stops)
    with pytest.raises(KeyboardInterrupt):
        trials([str(motion)], out=tmp_path / "out", sensor="perfect", folds=2, clips=[32])
    table = (tmp_path / "out" / "table.md").read_text()
    assert "| frames alike |" in table and "| varied motion |" in table
    assert "smoothed labels" not in table


def test_other_sets_that_are_of_no_use_leave_out_what_learns_from_them(
    motion: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # The joints of the tiny people are not those that all skeletons have, so solo has nothing to learn from first.
    monkeypatch.setattr(study, "CHANGES", {name: CHANGES[name] for name in (USUAL, "pre-trained")})
    found = trials(["solo", str(motion)], out=tmp_path / "out", sensor="perfect", folds=2, only=[0], clips=[32])
    assert "note: solo: pre-trained is left out: tiny: got no joint for" in capsys.readouterr().err
    rows = {held.data: {row.row for row in held.rows} for held in found.sets}
    assert "pre-trained" in rows["tiny (synthetic)"] and "pre-trained" not in rows["solo (synthetic)"]


def test_some_changes_are_tried_now_and_others_later(
    motion: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told = ["study", "trials", str(motion), "--sensor", "perfect", "--folds", "2", "--only", "0", "--clips", "32"]
    main([*told, "--changes", "turning told", "turned trunks", "--out", str(tmp_path)])
    first = capsys.readouterr()
    assert [name for name in CHANGES if f"fold 0, {name}:" in first.err] == [USUAL, "turning told", "turned trunks"]
    assert "last weights" in first.out and "varied motion" not in first.out
    main([*told, "--changes", "frames alike", "--out", str(tmp_path)])
    second = capsys.readouterr()
    assert [name for name in CHANGES if f"fold 0, {name}:" in second.err] == ["frames alike"]
    assert "turning told" in second.out and "frames alike" in second.out


def test_bad_options_are_refused(motion: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--clips: got 32, 0, expected at least 1"):
        trials([str(motion), "solo"], out=tmp_path, clips=[32, 0])
    with pytest.raises(UsageError, match="--clips: got 2 numbers, expected one for all sets, or one for each"):
        trials([str(motion)], out=tmp_path, clips=[32, 64])
    with pytest.raises(UsageError, match="--only: got 3, expected numbers from 0 to 2"):
        trials([str(motion)], out=tmp_path, only=[3])
    with pytest.raises(
        UsageError, match=r"--changes: got 'no view', expected names of: as it is, seed 1, .*turned trunks"
    ):
        trials([str(motion)], out=tmp_path, changes=["no view"])
    with pytest.raises(UsageError, match="expected different sets, got tiny more than once"):
        trials([str(motion), str(motion)], out=tmp_path)
    with pytest.raises(UsageError, match="expected different sets, got none"):
        trials([], out=tmp_path)
    out = tmp_path / "out"
    with pytest.raises(UsageError, match="unknown sensor 'radar'"):
        trials([str(motion)], out=out, sensor="radar")
    with pytest.raises(UsageError, match="--folds: got 9, expected 2 to 6"):
        trials([str(motion)], out=out, folds=9)
    with pytest.raises(UsageError, match="solo-stream: expected trimmed sequences, got streams"):
        trials(["solo-stream"], out=out)
    assert not out.exists()


def answered(rng: np.random.Generator, sharper: float = 1.0, first: int = 0) -> Answered:
    """Return 60 clips of 5 people, of which "varied motion" is right more often than the usual training.

    People are numbered from `first` on.
    """
    labels = rng.integers(3, size=60)
    true = np.eye(3)[labels][:, None] * np.ones((1, 8, 1))
    noise = rng.standard_normal((60, 8, 3))
    logits = {USUAL: sharper * (1.0 * true + noise), "varied motion": sharper * (2.0 * true + noise)}
    person = first + np.arange(60) % 5
    return Answered(logits, labels, np.array([f"sequence-{i % 15}" for i in range(60)]), person[:, None])


def test_rows_are_scored_against_the_usual_training() -> None:
    folds = [answered(np.random.default_rng(seed)) for seed in range(2)]
    scores = score_set("tiny", folds)
    rows = {row.row: row for row in scores.rows}
    assert set(rows) == {USUAL, "varied motion"}  # rows whose trainings were not made are left out
    labels = np.concatenate([fold.labels for fold in folds])
    right = {
        name: np.concatenate([fold.logits[name] for fold in folds]).argmax(axis=-1) == labels[:, None] for name in rows
    }
    for name, row in rows.items():
        assert row.accuracy == pytest.approx(100 * mean_acc(right[name]).mean())
        assert row.gain == pytest.approx(row.accuracy - rows[USUAL].accuracy)
    ends = rows["varied motion"].gain_ci95
    assert ends is not None and 0 < ends[0] < rows["varied motion"].gain < ends[1]


def test_temperatures_of_other_folds_calibrate_whoever_is_too_sure() -> None:
    folds = [answered(np.random.default_rng(seed), sharper=4.0, first=5 * seed) for seed in range(3)]
    row = score_set("tiny", folds).rows[0]
    assert row.ece_calibrated is not None and row.ece_calibrated < 0.5 * row.ece_late
    assert row.nll_calibrated is not None and row.nll_calibrated < row.nll
    alone = score_set("tiny", folds[:1]).rows[0]
    assert alone.ece_calibrated is None and alone.nll_calibrated is None


def test_nobody_s_temperatures_are_fitted_on_people_who_are_scored() -> None:
    """A couple of whom each is left out in another fold is in both."""
    folds = [answered(np.random.default_rng(seed), sharper=4.0, first=4 * seed) for seed in range(2)]  # 4 is in both
    shared, unmoved = score_set("tiny", folds).rows[0], folds[1].logits[USUAL].copy()
    logits = {name: said.copy() for name, said in folds[1].logits.items()}
    logits[USUAL][folds[1].subjects[:, 0] == 4] *= 100
    changed = [folds[0], replace(folds[1], logits=logits)]
    fitted = _calibrated([fold.logits[USUAL] for fold in changed], changed)
    before = _calibrated([folds[0].logits[USUAL], unmoved], folds)
    assert shared.ece_calibrated is not None and fitted is not None and before is not None
    np.testing.assert_array_equal(fitted[:60], before[:60])
    same = [answered(np.random.default_rng(seed)) for seed in range(2)]
    assert score_set("tiny", same).rows[0].ece_calibrated is None
