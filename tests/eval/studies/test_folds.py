"""Runs of folds are one run, in which every sequence counts once, if the conditions are the same."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.data.any_source import load_recordings
from ehar.data.motion_file import save_motion
from ehar.errors import UsageError
from eval.cli.main import main
from eval.records.config import PlannerConfig
from eval.running.run import read_run
from eval.scores.metrics import mean_acc
from eval.studies.folds import Folds, take_together
from recognition.setting import ELSEWHERE
from tests.helpers.commands import fails_with
from tests.helpers.fakes import tiny_data
from tests.helpers.made_records import flown, make_records, write_finished

SKILLS = {"no-act": 0.0, "nbv": 1.0, "oracle": 3.0}
PLANNER = PlannerConfig("no-act", privileged=False, implementation="none")


def run(folder: Path, fold: int, *, skills: dict[str, float] = SKILLS, ideal: bool = True, **options: Any) -> Path:
    """Write the run of a fold: 12 episodes of 3 people, whom no other fold has."""
    records = {}
    for row, (name, skill) in enumerate(skills.items()):
        made = make_records(10 * fold + row + 100 * (not ideal), skill=skill, episodes=12, people=3)
        renamed = tuple(f"{name} of {fold}" for name in made.sequence)
        records[name] = replace(made, sequence=renamed, subjects=made.subjects + 10 * fold)
        if not ideal:
            records[name] = flown(records[name])
    planners = tuple(replace(PLANNER, name=name, privileged=name == "oracle") for name in skills)
    own = {"recogniser_sha256": f"r{fold}", "data_sha256": f"d{fold}", "data": f"mine-{fold}", "planners": planners}
    return write_finished(folder / f"{fold}{'' if ideal else '-flown'}", records, **{**own, **options})


def test_the_folds_are_one_run_that_other_commands_take(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runs, out = [run(tmp_path, fold) for fold in range(3)], tmp_path / "out"
    main(["study", "folds", *map(str, runs), "--out", str(out)])
    printed = capsys.readouterr().out
    assert "mine, 3 folds: sensor perfect" in printed and "36 episodes of 4 frames from 18 sequences" in printed
    assert "Intervals rest on 9 people and their 18 sequences." in printed
    assert "Mean accuracy fold by fold" in printed and "Mean accuracy fold by fold" in (out / "table.md").read_text()
    together, each = read_run(out), [read_run(folder) for folder in runs]
    for name in SKILLS:
        of_folds = np.concatenate([mean_acc(one.records[name].correct) for one in each])
        np.testing.assert_array_equal(mean_acc(together.records[name].correct), of_folds)
        assert together.summary.planner(name).acc_mean == pytest.approx(100 * of_folds.mean())
    assert [fold.run for fold in together.config.folds] == [str(folder) for folder in runs]
    assert together.config.data_sha256 not in {one.config.data_sha256 for one in each}
    main(["study", "overview", str(out), "--planner", "nbv"])
    main(["compare", str(out), str(out)])
    assert "mine, 3 folds" in capsys.readouterr().out


def test_folds_of_generated_motion_stay_marked(tmp_path: Path) -> None:
    runs = [run(tmp_path, fold, data=f"mine-{fold} (synthetic)") for fold in range(2)]
    assert take_together(runs).run.config.data == "mine (synthetic), 2 folds"  # type: ignore[union-attr]


def test_what_a_later_fold_warns_of_is_kept(tmp_path: Path) -> None:
    found = take_together([run(tmp_path, 0), run(tmp_path, 1, trained_elsewhere=True)])
    assert isinstance(found, Folds) and found.run.config.warnings == (ELSEWHERE,)
    assert any(ELSEWHERE in line for line in found.tables()[0].footnotes)


def test_the_table_has_the_accuracy_of_each_fold(tmp_path: Path) -> None:
    found = take_together([run(tmp_path, fold) for fold in range(2)])
    *_, table = found.tables()
    assert table.header == ("planner", "mine-0", "mine-1")
    for row, name in enumerate(SKILLS):
        assert [float(cell) for cell in table.rows[row][1:]] == [
            pytest.approx(each.summary.planner(name).acc_mean, abs=0.051) for each in found.each
        ]
    assert table.rows[-1] == ("tested on", "3 people", "3 people")
    assert table.rows[2][0].startswith("oracle") and not {(2, 1), (2, 2)} & table.bold
    assert "Folds(" in repr(found) and "fold by fold" in str(found)


def test_the_table_counts_only_trainings_that_all_folds_have(tmp_path: Path) -> None:
    other = {"il-ppo/0": 1.0, "il-ppo/1": 3.0}
    found = take_together(
        [
            run(tmp_path, 0, skills={"no-act": 0.0, **other}),
            run(tmp_path, 1, skills=dict.fromkeys(("no-act", "il-ppo/0"), 1.0)),
        ]
    )
    assert isinstance(found, Folds) and list(found.run.records) == ["no-act", "il-ppo/0"]
    row = found.tables()[-1].rows[1]
    expected = [f"{100 * each.records['il-ppo/0'].correct.mean():.1f}" for each in found.each]
    assert row == ("il-ppo", *expected)
    assert found.each[0].summary.planner("il-ppo").acc_mean != pytest.approx(float(expected[0]), abs=0.1)


def test_flights_are_compared_with_the_same_folds_on_the_ideal_track(tmp_path: Path) -> None:
    flights = [run(tmp_path, fold, ideal=False, track="px4-auto") for fold in range(2)]
    on_ideal = take_together([run(tmp_path, fold) for fold in range(2)], out=tmp_path / "ideal")
    found = take_together(flights, ideal=tmp_path / "ideal", out=tmp_path / "flown").run
    low, high = (on_ideal.run.summary.planner(name).acc_mean for name in ("no-act", "nbv"))
    kept = (found.summary.planner("nbv").acc_mean - low) / (high - low)
    assert found.summary.planner("nbv").accuracy_kept == pytest.approx(kept)
    other = take_together(
        [run(tmp_path, fold, recogniser_sha256=f"other {fold}") for fold in range(2)], out=tmp_path / "o"
    )
    with pytest.raises(UsageError, match="it differs in recogniser_sha256"):
        take_together(flights, ideal=other.run.directory or tmp_path / "o")
    assert read_run(tmp_path / "flown").config.ideal == str(tmp_path / "ideal")


def test_what_needs_data_and_weights_is_told_of_the_folds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runs, out = [run(tmp_path, fold) for fold in range(2)], tmp_path / "out"
    take_together(runs, out=out)
    assert f"this one is 2 folds: verify {runs[0]}, {runs[1]}" in fails_with(["verify", str(out)], capsys)
    with pytest.raises(SystemExit):
        main(["replay", str(out), "0"])
    assert "a run of 2 folds has the data and weights of" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"seed": 1}, r"expected runs under the same conditions; they differ in seed \(0, 1\)"),
        ({"track": "px4-max"}, r"they differ in track \(ideal, px4-max\)"),
        ({"onset": "known"}, r"they differ in onset \(unknown, known\)"),
        ({"recogniser_sha256": "r0"}, "expected a recogniser of each, got the same"),
        ({"part": "policy"}, "expected the test part of a fold, got the policy part"),
    ],
)
def test_runs_that_are_no_folds_of_one_set_are_refused(tmp_path: Path, options: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message) as refused:
        take_together([run(tmp_path, 0), run(tmp_path, 1, **options)])
    assert "\n" not in str(refused.value)


def test_another_planner_of_the_same_name_is_refused(tmp_path: Path) -> None:
    def of(file: str) -> tuple[PlannerConfig, ...]:
        return tuple(replace(PLANNER, name=name, source_sha256=file, weights_sha256=file) for name in SKILLS)

    runs = [run(tmp_path, 0, planners=of("1")), run(tmp_path, 1, planners=of("2"))]
    with pytest.raises(UsageError) as refused:
        take_together(runs)
    differs = "expected the same planners; the file of no-act differ: expected sha256 1, got sha256 2"
    assert str(refused.value) == f"{runs[0]} and {runs[1]}: {differs}"


def test_versions_that_differ_are_told(tmp_path: Path) -> None:
    *_, table = take_together([run(tmp_path, fold, versions={"numpy": f"2.{fold}"}) for fold in range(2)]).tables()
    assert table.footnotes[-1] == "Versions differ between the runs: numpy 2.0 and 2.1."


def test_what_would_count_twice_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = run(tmp_path, 0), run(tmp_path, 1)
    same = write_finished(tmp_path / "same", dict(read_run(a).records), recogniser_sha256="other")
    assert "expected each sequence in one of them" in fails_with(["study", "folds", str(a), str(same)], capsys)
    assert "at least 2 folders of runs, got 1" in fails_with(["study", "folds", str(a)], capsys)
    take_together([a, b], out=tmp_path / "ab")
    c = run(tmp_path, 2)
    assert "expected the run of one fold, this one is of 2" in fails_with(
        ["study", "folds", str(tmp_path / "ab"), str(c)], capsys
    )
    rest = run(tmp_path, 3, skills={"random": 0.0})
    assert "expected a planner that ran in all folds" in fails_with(["study", "folds", str(a), str(rest)], capsys)


def test_data_that_is_not_found_is_named_where_classes_differ(tmp_path: Path) -> None:
    save_motion(tmp_path / "tiny.npz", tiny_data(sequences=20))
    here = load_recordings(tmp_path / "tiny.npz")
    a = run(tmp_path, 0, source=str(tmp_path / "tiny.npz"), data_sha256=here.sha256)
    with pytest.raises(UsageError, match=r"expected the same classes, got others; classes are numbered, as .*missing"):
        take_together([a, run(tmp_path, 1, source=str(tmp_path / "missing.npz"))])
