"""A run is decided once by rules that another part's run was asked about."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ehar.data.any_source import load_recordings
from ehar.data.motion_file import save_motion
from ehar.data.streams.data import NO_ACTIVITY
from ehar.errors import DataError, EharError, UsageError
from eval.cli.main import main
from eval.records.config import PlannerConfig
from eval.records.episodes import EpisodeRecords, join_records
from eval.running.run import read_run
from eval.scores.deciding.curves import fit_rules
from eval.scores.deciding.fit import seen_in
from eval.scores.deciding.rules import decide as rules_decide
from eval.studies.deciding.decide import decide
from eval.studies.folds import take_together
from tests.helpers.fakes import stopped, tiny_data
from tests.helpers.made_records import make_records, make_stream_records, write_finished

FPS = 10.0
SOON = {"no-act": 0.2, "nbv": 0.6}  # the chance that a frame of a stream is the first one that is right
SKILLS = {"no-act": 0.5, "random": 0.6, "nbv": 1.5, "oracle": 3.0}


def episodes(part: str, row: int, skill: float, *, second: bool = True) -> EpisodeRecords:
    held = make_records(row, skill=skill, episodes=40, people=4)
    told = replace(held, sequence=tuple(f"{part} {name}" for name in held.sequence))
    told = replace(told, subjects=held.subjects + (0 if part == "test" else 2))
    return told if second else replace(told, second_probability=None)


def run(folder: Path, part: str, *, second: bool = True, planners: tuple[str, ...] = tuple(SKILLS), **options) -> Path:
    records = {
        name: episodes(part, row + 10 * (part != "test"), SKILLS[name], second=second)
        for row, name in enumerate(planners)
    }
    return write_finished(folder / part, records, part=part, **{"fps": FPS, **options})


def test_the_command_prints_tables_and_draws_curves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scored, fitted = run(tmp_path, "test"), run(tmp_path, "policy", planners=("no-act", "nbv", "oracle"))
    main(["study", "decide", str(scored), "--fitted-on", str(fitted), "--out", str(tmp_path / "out")])
    assert "decides once" in capsys.readouterr().out
    assert (tmp_path / "out" / "table.md").is_file()
    assert (tmp_path / "out" / "deciding.png").is_file() and (tmp_path / "out" / "deciding.svg").is_file()
    found = decide(scored, fitted_on=fitted)
    assert tuple(found.planners) == ("no-act", "nbv", "oracle")
    assert found.fitted_with == ("no-act", "nbv")  # the oracle is told, so it says nothing about when to answer
    tables = found.tables()
    assert len(tables) == 7
    answers, rules = tables[2:4]
    assert answers.header == ("points/s", "fixed time", "threshold", "sprt", "induction")
    assert len(answers.rows) == len(rules.rows) == 12
    point = next(curve for curve in found.found.curves if (curve.planner, curve.rule) == ("nbv", "sprt")).points[0]
    assert str(answers.rows[0][3]).startswith(f"{point.accuracy:.1f} [")
    assert str(answers.rows[0][3]).endswith(f"in {point.seconds:.2f} s")
    assert any("80 episodes of no-act and nbv on the policy part" in note for note in answers.footnotes)
    assert any("2 of the 4 people performed there too" in note for note in answers.footnotes)
    assert tables[-1].title.startswith("What answers of nbv are worth more than those of no-act")
    assert repr(found).startswith("Deciding(tiny (synthetic)")
    assert "decides once" in str(found) and "<table" in found._repr_html_()


def streams(part: str, row: int, skill: float) -> EpisodeRecords:
    """Return records of streams: an activity of 4 to 12 frames after a pause, eight times; skill is how soon."""
    rng, order = np.random.default_rng(row), np.random.default_rng(len(part))
    labels = np.full((6, 160), NO_ACTIVITY)
    answers = labels.copy()
    for stream in range(6):
        for begin in range(4, 160, 20):
            end, late = begin + int(order.integers(4, 12)), int(rng.geometric(skill))
            labels[stream, begin:end] = order.integers(3)
            answers[stream, begin + late : end + late] = labels[stream, begin]
    sure = np.where(answers == labels, 0.6, 0.4) + 0.3 * rng.random(labels.shape)
    held = make_stream_records(labels, answers, top_probability=sure)
    return replace(
        held,
        sequence=tuple(f"{part} {name}" for name in held.sequence),
        second_probability=(1 - sure) / 2,
        subjects=held.subjects + (0 if part == "test" else 3),
    )


def run_of_streams(folder: Path, part: str, first_row: int, **options: str) -> Path:
    records = {name: streams(part, first_row + at, skill) for at, (name, skill) in enumerate(SOON.items())}
    return write_finished(folder / part, records, part=part, fps=FPS, length=160, **options)


def test_a_study_that_is_stopped_before_its_picture_has_no_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scored, fitted = run_of_streams(tmp_path, "test", 0), run_of_streams(tmp_path, "policy", 2)
    monkeypatch.setattr("eval.studies.deciding.figure.draw_deciding", stopped)
    with pytest.raises(KeyboardInterrupt):
        decide(scored, fitted_on=fitted, out=tmp_path / "out")
    assert not (tmp_path / "out" / "table.md").exists()


def test_activities_of_streams_are_decided_once(tmp_path: Path) -> None:
    scored, fitted = run_of_streams(tmp_path, "test", 0), run_of_streams(tmp_path, "policy", 2)
    found = decide(scored, fitted_on=fitted, out=tmp_path / "out")
    assert (tmp_path / "out" / "deciding.png").is_file()
    answers = found.tables()[0]
    assert found.fitted_activities == 96
    assert any(note.startswith("Rules were fitted on 96 activities of no-act and nbv") for note in answers.footnotes)
    assert any("The time is the mean over activities" in note for note in answers.footnotes)
    assert any("the recogniser is not told. While its word is no activity" in note for note in answers.footnotes)
    for row, (name, skill) in enumerate(SOON.items()):
        time, right = found.found.courses[name]
        seen = seen_in(streams("test", row, skill), 1 / FPS)
        assert time[-1] == pytest.approx((seen.words.last + 1).mean() / FPS)  # each at its end
        assert right[-1] == pytest.approx(seen.right[range(48), seen.words.last].mean())
    assert all(
        difference.points > 0
        for difference in found.found.planners["nbv"]
        if difference.one[1] == "threshold" and difference.price == 20
    )
    with pytest.raises(UsageError, match=r"they differ in onset \(unknown, known\)"):
        decide(scored, fitted_on=run_of_streams(tmp_path, "validation", 4, onset="known"))


def test_rules_of_folds_are_fitted_on_the_other_folds(tmp_path: Path) -> None:
    each = []
    for fold in range(3):  # people of one are harder than those of another, or all folds would have the same rules
        made = {
            name: streams("test", 10 * fold + row, skill / (1 + 2 * fold))
            for row, (name, skill) in enumerate(SOON.items())
        }
        records = {
            name: replace(held, sequence=tuple(f"{one} of {fold}" for one in held.sequence))
            for name, held in made.items()
        }
        planners = tuple(PlannerConfig(name, privileged=False, implementation="none") for name in records)
        told = {"fps": FPS, "length": 160, "recogniser_sha256": str(fold), "planners": planners}
        each.append(write_finished(tmp_path / str(fold), records, **told))
    take_together(each, out=tmp_path / "folds")
    found = decide(tmp_path / "folds")
    assert found.fitted_on is None and found.fitted_activities == 3 * 96
    assert "The rules of each fold were fitted on the others." in found.tables()[0].footnotes
    right: dict[tuple[str, int], list[float]] = {}
    for folder in each:
        others = [read_run(other).records for other in each if other != folder]
        rules = fit_rules(seen_in(join_records([held[name] for name in SOON for held in others]), 1 / FPS))
        seen = seen_in(read_run(folder).records["nbv"], 1 / FPS)
        for name, fitted in rules.items():
            for price, rule in enumerate(fitted):
                answers = rules_decide(rule, seen.words).answer
                right.setdefault((name, price), []).append(100 * (answers == seen.label).mean())
    for curve in found.found.curves:
        if curve.planner == "nbv":
            for price, point in enumerate(curve.points):
                assert point.accuracy == pytest.approx(np.mean(right[curve.rule, price]))
    with pytest.raises(UsageError, match="expected no run to fit on, as each fold of"):
        decide(tmp_path / "folds", fitted_on=each[0])
    with pytest.raises(UsageError, match="expected --fitted-on, a run on another part"):
        decide(each[0])


def test_folds_of_clips_take_the_frame_rate_of_their_data(tmp_path: Path) -> None:
    each = []
    for fold in range(2):
        data = tmp_path / f"{fold}.npz"
        save_motion(data, tiny_data(sequences=12 + fold, fps=FPS))
        made = {name: make_records(10 * fold + row, skill=row, episodes=40) for row, name in enumerate(SOON)}
        records = {
            name: replace(held, sequence=tuple(f"{one} of {fold}" for one in held.sequence))
            for name, held in made.items()
        }
        planners = tuple(PlannerConfig(name, privileged=False, implementation="none") for name in records)
        told = {"source": str(data), "data_sha256": load_recordings(data).sha256, "planners": planners}
        each.append(write_finished(tmp_path / str(fold), records, recogniser_sha256=str(fold), **told))
    take_together(each, out=tmp_path / "folds")
    found = decide(tmp_path / "folds")
    assert found.found.courses["nbv"][0][-1] == pytest.approx(4 / FPS)  # the last of 4 frames
    with pytest.raises(DataError, match=r"solo: expected the data of .*folds, got others"):
        decide(tmp_path / "folds", data="solo")


def test_planners_can_be_named(tmp_path: Path) -> None:
    scored, fitted = run(tmp_path, "test"), run(tmp_path, "policy")
    found = decide(scored, fitted_on=fitted, planners=("random",))
    assert tuple(found.planners) == ("random",) and len(found.tables()) == 2
    with pytest.raises(UsageError, match="no planner 'dagger'; expected one of: no-act"):
        decide(scored, fitted_on=fitted, planners=("dagger",))


def test_older_runs_are_decided_without_the_matrix_test(tmp_path: Path) -> None:
    found = decide(run(tmp_path, "test", second=False), fitted_on=run(tmp_path, "policy"))
    answers = found.tables()[0]
    assert answers.header == ("points/s", "fixed time", "threshold", "induction")
    assert any(note.startswith("Without sprt: a run is from before") for note in answers.footnotes)


def test_a_single_training_is_refused(tmp_path: Path) -> None:
    each = {name: make_records(row) for row, name in enumerate(("no-act", "il/0", "il/1"))}
    run = read_run(write_finished(tmp_path, each))
    run.check_planners(["no-act", "il"])
    with pytest.raises(UsageError, match=r"il/0 is one training; expected a planner with all its own: no-act, il$"):
        run.check_planners(["il/0"])


def test_what_cannot_be_decided_is_refused(tmp_path: Path) -> None:
    def refused(scored: Path, fitted: Path, kind: type[EharError], message: str) -> None:
        with pytest.raises(kind, match=message):
            decide(scored, fitted_on=fitted)

    test = run(tmp_path, "test")
    refused(
        test, test, UsageError, "expected rules to be fitted on another part than they are scored on, got test twice"
    )
    refused(test, run(tmp_path / "a", "policy", sensor="estimator"), UsageError, "they differ in sensor")
    refused(test, run(tmp_path / "b", "policy", recogniser_sha256="2"), UsageError, "they differ in recogniser")
    refused(test, run(tmp_path / "c", "policy", planners=("oracle",)), UsageError, "a planner without the truth to fit")
    same = run(tmp_path / "d", "policy")
    config = json.loads((test / "config.json").read_text())
    (test / "config.json").write_text(json.dumps({**config, "part": "validation"}))
    (same / "episodes.jsonl").write_text((test / "episodes.jsonl").read_text())
    refused(test, same, DataError, "expected parts that share no sequence")


def test_the_frame_rate_of_the_data_is_asked_for(tmp_path: Path) -> None:
    scored, fitted = (run(tmp_path, part, fps=None, source="solo") for part in ("test", "policy"))
    with pytest.raises(DataError, match=r"solo: expected the data of .*test, got others"):
        decide(scored, fitted_on=fitted)
