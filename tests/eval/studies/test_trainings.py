"""Runs of several trainings are one table, if they have the same episodes and conditions and other weights."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import t as student

from ehar.errors import DataError, UsageError
from eval.cli.main import main
from eval.records.config import PlannerConfig
from eval.records.episodes import EpisodeRecords, join_records
from eval.running.run import read_run
from eval.scores.deciding.curves import THRESHOLD, fit_rules
from eval.scores.deciding.fit import seen_in
from eval.scores.deciding.rules import decide as answer
from eval.studies.compare import compare
from eval.studies.deciding.decide import decide
from eval.studies.trainings import Trainings, trainings
from tests.helpers.commands import fails_with
from tests.helpers.made_records import make_records, write_finished

SKILLS = {"no-act": 0.0, "nbv": 1.0, "oracle": 3.0}


def run(folder: Path, training: int, people: int = 6, **options: Any) -> Path:
    records = {
        name: make_records(10 * training + row, skill=skill, episodes=60, people=people)
        for row, (name, skill) in enumerate(SKILLS.items())
    }
    planners = tuple(PlannerConfig(name, privileged=name == "oracle", implementation="none") for name in SKILLS)
    own = {"recogniser_sha256": str(training), "planners": planners}
    return write_finished(folder / str(training), records, **{**own, **options})


def test_the_command_prints_one_table_and_writes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runs = [str(run(tmp_path, seed)) for seed in (1, 2, 3)]
    main(["study", "trainings", *runs, "--out", str(tmp_path / "out")])
    printed = capsys.readouterr().out
    assert "tiny (synthetic), 3 trainings: sensor perfect" in printed and "nbv minus it [95 %]" in printed
    found = trainings(runs)
    assert isinstance(found, Trainings)
    table = (tmp_path / "out" / "table.md").read_text()
    (shown,) = found.tables()
    assert all(str(cell).replace("*", r"\*") in table for row in shown.rows for cell in row)
    assert not shown.notice and "Intervals rest on 6 people and their 30 sequences." in shown.footnotes
    assert repr(found).endswith("3 planners)")


def test_the_trainings_are_one_run_that_other_commands_take(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runs, out = [str(run(tmp_path, seed)) for seed in (1, 2, 3)], str(tmp_path / "out")
    found = trainings(runs, out=out)
    assert isinstance(found, Trainings)
    together, each = read_run(out), [read_run(folder) for folder in runs]
    assert together.config.trainings == tuple(runs)
    assert together.config.recogniser_sha256 not in {one.config.recogniser_sha256 for one in each}
    assert together.summary.to_json() == found.run.summary.to_json()
    (difference,), (of_run,) = found.differences, together.summary.differences
    assert difference == of_run
    for name, row in zip(SKILLS, found.tables()[0].rows, strict=True):
        alone = [one.summary.planner(name) for one in each]
        own, acc = together.summary.planner(name), [one.acc_mean for one in alone]
        assert own.training_seeds == (0, 1, 2)
        assert own.acc_mean == pytest.approx(np.mean(acc))
        low, high = (np.mean([one.summary.planner(end).acc_mean for one in each]) for end in ("no-act", "oracle"))
        assert own.gap_closed == pytest.approx((np.mean(acc) - low) / (high - low))
        assert row[1].startswith(f"{np.mean(acc):.1f} ± {np.std(acc, ddof=1):.1f} [")
        gaps = [100 * float(one.gap_closed or 0) for one in alone]
        assert row[2].startswith(f"{100 * float(own.gap_closed or 0):.1f} ± {np.std(gaps, ddof=1):.1f} [")
    to_no_act = [one.summary.planner("nbv").acc_mean - one.summary.planner("no-act").acc_mean for one in each]
    assert found.tables()[0].rows[0][3].startswith(f"{np.mean(to_no_act):+.1f} ± {np.std(to_no_act, ddof=1):.1f} [")
    main(["study", "overview", out, "--planner", "nbv"])
    assert f"{difference.acc_mean:+.1f}" in capsys.readouterr().out
    assert f"this one is 3 trainings: verify {runs[0]}" in fails_with(["verify", out], capsys)
    assert "expected the run of one training, this one is of 3 trainings" in fails_with(
        ["study", "trainings", out, runs[0]], capsys
    )


def alike(frames: int) -> EpisodeRecords:
    """Return records in which every episode is right in so many of its four frames."""
    base = make_records(0, episodes=60, people=6)
    return replace(base, predicted=np.tile(base.label[:, None], 4) + (np.arange(4) >= frames))


def of_alike(tmp_path: Path, *right: dict[str, int]) -> Trainings:
    each = [
        write_finished(
            tmp_path / str(training),
            {name: alike(frames) for name, frames in planners.items()},
            recogniser_sha256=str(training),
            planners=tuple(
                PlannerConfig(name, privileged=name == "oracle", implementation="none") for name in planners
            ),
        )
        for training, planners in enumerate(right)
    ]
    found = trainings(each)
    assert isinstance(found, Trainings)
    return found


def test_trainings_that_differ_widen_intervals_as_student_s_t_of_their_number_does(tmp_path: Path) -> None:
    # Every episode is alike, so only trainings vary: nbv gains 25, 50 and 75 points.
    found = of_alike(tmp_path, *({"no-act": 1, "nbv": 1 + gain} for gain in (1, 2, 3)))
    (difference,) = found.differences
    assert difference.acc_mean == pytest.approx(50) and found.tables()[0].rows[0][3].startswith("+50.0 ± 25.0 [")
    half = student.ppf(0.975, 2) * 25 / np.sqrt(3)
    assert difference.ci95_corrected is not None
    # Three trainings have seven different means, so a bootstrap of them is coarse, on the safe side.
    assert half <= difference.ci95_corrected[1] - 50 <= 1.3 * half
    assert not difference.is_clear


def test_planners_of_one_training_are_drawn_together(tmp_path: Path) -> None:
    # Trainings differ by far, but nbv is 25 points above no-act in each of them.
    found = of_alike(tmp_path, *({"no-act": frames, "nbv": frames + 1} for frames in (0, 1, 3)))
    assert found.differences[0].ci95_corrected == pytest.approx((25, 25))


def test_a_planner_s_own_trainings_have_a_row_each(tmp_path: Path) -> None:
    found = of_alike(tmp_path, {"nbv": 2, "il/0": 1, "il/1": 4}, {"nbv": 2, "il/0": 2, "il/1": 4})
    assert [row[0] for row in found.tables()[0].rows] == ["nbv", "il/0", "il/1"]
    assert found.tables()[0].rows[1][1].startswith("37.5 ± 17.7 [")


def test_a_planner_that_is_not_in_all_runs_is_named(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no planner 'nbv' without the truth in all 2 runs; expected one of: no-act$"):
        of_alike(tmp_path, {"no-act": 1, "nbv": 2}, {"no-act": 1})
    with pytest.raises(UsageError, match=r"no planner 'nbv' without the truth in all 2 runs; expected one of: $"):
        of_alike(tmp_path / "none", {"nbv": 2}, {"no-act": 1})


def test_no_gap_is_shown_where_a_training_has_none(tmp_path: Path) -> None:
    found = of_alike(tmp_path, {"no-act": 1, "nbv": 2, "oracle": 4}, {"no-act": 2, "nbv": 2, "oracle": 2})
    assert [row[2] for row in found.tables()[0].rows] == ["-"] * 3


def test_a_change_of_conditions_is_paired_by_training(tmp_path: Path) -> None:
    # Trainings differ by far, but each has a quarter less right if onsets are unknown.
    told = PlannerConfig("no-act", privileged=False, implementation="none")
    for onset, less in (("known", 0), ("unknown", 1)):
        each = [
            write_finished(
                tmp_path / f"{onset}-{training}",
                {"no-act": alike(frames - less)},
                recogniser_sha256=str(training),
                onset=onset,
                planners=(told,),
            )
            for training, frames in enumerate((1, 2, 4))
        ]
        trainings(each, planner="no-act", out=tmp_path / onset)
    (compared,) = compare(tmp_path / "known", tmp_path / "unknown").planners
    assert compared.trainings == (3, 3)
    assert compared.difference.acc_mean == pytest.approx(25) and compared.difference.ci95_corrected == pytest.approx(
        (25, 25)
    )


def test_when_to_answer_is_asked_of_all_trainings(tmp_path: Path) -> None:
    of_part = {}
    for part, people in (("test", 0), ("policy", 9)):
        each = []
        for training in (1, 2, 3):
            records = {
                name: make_records(10 * training + row + 100 * people, skill=skill, episodes=40, people=4)
                for row, (name, skill) in enumerate(SKILLS.items())
            }
            for name, held in records.items():
                sequence = tuple(f"{part} {one}" for one in held.sequence)
                records[name] = replace(held, sequence=sequence, subjects=held.subjects + people)
            planners = tuple(PlannerConfig(name, privileged=name == "oracle", implementation="none") for name in SKILLS)
            told = {"part": part, "fps": 10.0, "recogniser_sha256": str(training), "planners": planners}
            each.append(write_finished(tmp_path / f"{part}-{training}", records, **told))
        of_part[part] = tmp_path / part
        trainings(each, out=of_part[part])
    found = decide(of_part["test"], fitted_on=of_part["policy"], planners=["no-act", "nbv"])
    assert found.fitted_activities == 3 * 40 * 2
    fitted = read_run(of_part["policy"])
    rule = fit_rules(seen_in(join_records([fitted.episodes(name) for name in ("no-act", "nbv")]), 0.1))[THRESHOLD][3]
    each = [seen_in(read_run(tmp_path / f"test-{training}").records["nbv"], 0.1) for training in (1, 2, 3)]
    right = [answer(rule, seen.words).answer == seen.label for seen in each]
    (curve,) = [curve for curve in found.found.curves if (curve.planner, curve.rule) == ("nbv", THRESHOLD)]
    assert curve.points[3].accuracy == pytest.approx(100 * np.mean(right))


def test_few_trainings_and_few_people_are_told_aloud(tmp_path: Path) -> None:
    (table,) = trainings([run(tmp_path, seed, people=4) for seed in (1, 2)]).tables()
    assert "only 4 people" in table.notice and "Only 2 trainings: a claim takes at least 3." in table.notice


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"seed": 1}, r"expected runs of the same episodes; they differ in seed \(0, 1\)"),
        ({"sensor": "estimator"}, r"they differ in sensor \(perfect, estimator\)"),
        ({"views": "paper"}, r"they differ in views \(moving, paper\)"),
        ({"track": "px4-max"}, r"they differ in track \(ideal, px4-max\)"),
        ({"recogniser_sha256": "1"}, "expected other trainings of the recogniser, got the same"),
    ],
)
def test_runs_that_are_no_trainings_of_one_another_are_refused(
    tmp_path: Path, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(UsageError, match=message) as refused:
        trainings([run(tmp_path, 1), run(tmp_path, 2, **options)])
    assert "\n" not in str(refused.value)


OWN = replace(PlannerConfig("nbv", False, "mine.py:Mine"), arguments={"radius": 5, "file": "1"}, source_sha256="1")


@pytest.mark.parametrize(
    ("own", "changes", "message"),
    [
        (OWN, {"source_sha256": "2"}, "the file of nbv differ: expected sha256 1, got sha256 2"),
        (
            OWN,
            {"arguments": {"radius": 6, "file": "1"}},
            "the arguments of nbv differ: expected {'radius': 5, 'file': '1'}, got {'radius': 6, 'file': '1'}",
        ),
        (OWN, {"arguments": {"radius": 5, "file": "2"}}, "the arguments of nbv differ: "),
        (OWN, {"weights_sha256": "2"}, None),
        (OWN, {"arguments": {"radius": 5, "file": "2"}, "weights_sha256": "2"}, None),  # the file of its weights
        (OWN, {"arguments": {"radius": 6, "file": "2"}, "weights_sha256": "2"}, "the arguments of nbv differ: "),
        (OWN, {"name": "another"}, None),
    ],
)
def test_another_planner_of_the_same_name_is_refused(
    tmp_path: Path, own: PlannerConfig, changes: dict[str, Any], message: str | None
) -> None:
    no_act, runs = PlannerConfig("no-act", privileged=False, implementation="none"), []
    for training, planner in enumerate((own, replace(own, **changes))):
        records = {name: alike(2) for name in ("no-act", planner.name)}
        options: Any = {"recogniser_sha256": str(training), "planners": (no_act, planner)}
        runs.append(write_finished(tmp_path / str(training), records, **options))
    if message is None:
        assert trainings(runs, planner="no-act")
        return
    with pytest.raises(UsageError) as refused:
        trainings(runs, planner="no-act")
    assert str(refused.value).startswith(f"{runs[0]} and {runs[1]}: expected the same planners; {message}")
    assert "\n" not in str(refused.value)


def test_versions_that_differ_are_told(tmp_path: Path) -> None:
    runs = [run(tmp_path, seed, versions={"numpy": f"2.{seed}", "torch": "2.3"}) for seed in (1, 2)]
    (table,) = trainings(runs).tables()
    assert table.footnotes[-1] == "Versions differ between the runs: numpy 2.1 and 2.2."


def test_episodes_that_differ_are_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = run(tmp_path, 1), tmp_path / "b"
    other = {name: make_records(row, episodes=60, people=5) for row, name in enumerate(("no-act", "nbv"))}
    write_finished(b, other, recogniser_sha256="2")
    with pytest.raises(DataError, match="that differ in sequence, first frame, start, label or people"):
        trainings([a, b])
    moved = {name: replace(held, start=held.start + 1) for name, held in other.items()}
    write_finished(b, moved, recogniser_sha256="2")
    assert "expected the same episodes" in fails_with(["study", "trainings", str(a), str(b)], capsys)
    assert "at least 2 folders of runs, got 1" in fails_with(["study", "trainings", str(a)], capsys)
