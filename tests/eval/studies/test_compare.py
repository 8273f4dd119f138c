"""Runs made at different times are compared where they met the same episodes, and refused where they did not."""

import json
import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from ehar.errors import DataError, UsageError
from ehar.flight.vehicle import VEHICLES
from eval.cli.main import main
from eval.records.config import CONFIG, PlannerConfig
from eval.records.episodes import EpisodeRecords
from eval.render.tables import p_text
from eval.running.run import write_records
from eval.studies.compare import MAY_DIFFER, Comparison, compare
from eval.studies.compare_table import compare_table
from eval.studies.same_episodes import SAME_EPISODES
from tests.helpers.commands import fails_with
from tests.helpers.made_records import CONFIG_OF_RUN, config_of_run, make_records, summary_of


def records(**skills: float) -> dict[str, EpisodeRecords]:
    """Return 24 episodes of 12 sequences of planners by name (_ for -, __ for /) and skill."""
    return {
        name.replace("__", "/").replace("_", "-"): make_records(len(name), skill=skill, episodes=24)
        for name, skill in skills.items()
    }


def written(
    folder: Path, held: dict[str, EpisodeRecords], weights: dict[str, str] | None = None, **changes: Any
) -> Path:
    """Write a run of these records; the oracle is privileged."""
    planners = tuple(PlannerConfig(name, name == "oracle", "", (weights or {}).get(name)) for name in held)
    return write(folder, held, planners=planners, **changes)


def write(folder: Path, held: dict[str, EpisodeRecords], **changes: Any) -> Path:
    config = config_of_run(**changes)
    write_records(folder, config, held, summary_of(held, config))
    return folder


def two_runs(tmp_path: Path, **changes: Any) -> tuple[Path, Path]:
    a = records(no_act=0.0, nbv=1.0, oracle=3.0)
    b = {**records(random=0.2, oracle=2.0), "nbv": make_records(9, skill=0.3, episodes=24)}
    return written(tmp_path / "a", a), written(tmp_path / "b", b, **changes)


def width(ends: Any) -> float:
    return float(ends[1] - ends[0])


def test_each_planner_of_both_runs_is_compared_as_if_they_were_one_run(tmp_path: Path) -> None:
    a, b = two_runs(tmp_path)
    found = compare(a, b)
    differences = [row.difference for row in found.planners]
    assert [(one.planner, one.other) for one in differences] == [("nbv", "nbv"), ("oracle", "oracle")]
    assert (found.episodes, found.sequences, found.differing, found.no_intervals) == (24, 12, {}, None)
    # Both planners in one run; corrected together with the other row, a difference is less certain.
    together = {"nbv": records(nbv=1.0)["nbv"], "before": make_records(9, skill=0.3, episodes=24)}
    (expected,) = summary_of(together).differences
    nbv, oracle = found.planners
    corrected = ("ci95_corrected", "p_corrected", "smallest")
    assert nbv.difference == replace(
        expected, other="nbv", **{name: getattr(nbv.difference, name) for name in corrected}
    )
    assert width(nbv.difference.ci95_corrected) > 1.05 * width(expected.ci95_corrected)
    assert nbv.difference.p_corrected > expected.p_corrected
    assert nbv.acc == pytest.approx([100 * record.correct.mean() for record in together.values()])
    assert (nbv.privileged, oracle.privileged) == ((False, False), (True, True))


def test_the_runs_the_other_way_round_give_the_opposite(tmp_path: Path) -> None:
    a, b = two_runs(tmp_path)
    forward, backward = compare(a, b).planners[0].difference, compare(b, a, ("nbv", "nbv")).planners[0].difference
    assert backward.acc_mean == pytest.approx(-forward.acc_mean)
    assert forward.ci95 is not None and backward.ci95 == pytest.approx((-forward.ci95[1], -forward.ci95[0]))
    assert backward.improvement == pytest.approx(1 - forward.improvement)
    assert backward.p == pytest.approx(forward.p)


def test_a_run_does_not_differ_from_itself(tmp_path: Path) -> None:
    a, _ = two_runs(tmp_path)
    for difference in (row.difference for row in compare(a, a).planners):
        assert (difference.acc_mean, difference.ci95, difference.smallest) == (0, (0, 0), None)
        assert (difference.improvement, difference.p_corrected) == (0.5, 1)


def test_two_planners_are_compared_by_name(tmp_path: Path) -> None:
    a, b = two_runs(tmp_path)
    difference = compare(a, b, ("no-act", "random")).planners[0].difference
    assert difference.p_corrected == pytest.approx(difference.p, abs=0.05)  # the bootstrap's, and Student's
    (row,) = compare_table(compare(a, b, ("no-act", "oracle"), out=tmp_path / "out")).rows
    assert row[0] == "no-act - oracle*"
    assert r"| no-act - oracle\* |" in (tmp_path / "out" / "table.md").read_text()
    with pytest.raises(UsageError, match=r"b: no planner 'no-act'; expected one of: random, oracle, nbv"):
        compare(a, b, ("no-act", "no-act"))
    with pytest.raises(UsageError, match=r"^planners: expected one of A and one of B, got 1: nbv$"):
        compare(a, b, ["nbv"])


def test_runs_without_a_planner_in_common_are_refused(tmp_path: Path) -> None:
    a, b = written(tmp_path / "a", records(il=1.0)), written(tmp_path / "b", records(ppo=1.0))
    with pytest.raises(UsageError, match=r"no planner ran both in .*a \(il\) and in .*b \(ppo\); expected --planners"):
        compare(a, b)


OTHER = {
    "data_sha256": "9",
    "part": "policy",
    "starts": 2,
    "seed": 7,
    "length": 5,
    "fps": 25.0,
    "sensor": "estimator",
    "sensor_sha256": "8",
    "world": "indoor",
}


@pytest.mark.parametrize("name", SAME_EPISODES)
def test_other_episodes_are_refused_with_both_values(tmp_path: Path, name: str) -> None:
    a, b = two_runs(tmp_path, **{name: OTHER[name]})
    before = "paper" if name == "world" else CONFIG_OF_RUN.to_json()[name]
    values = "tiny (synthetic) 0, tiny (synthetic) 9" if name == "data_sha256" else f"{before}, {OTHER[name]}"
    with pytest.raises(UsageError) as refused:
        compare(a, b)
    assert str(refused.value) == (
        f"{a} and {b}: expected runs of the same episodes; they differ in {name.removesuffix('_sha256')} ({values})"
    )


def test_all_that_differs_is_named_at_once(tmp_path: Path) -> None:
    a, b = two_runs(tmp_path, seed=1, starts=3)
    with pytest.raises(UsageError, match=r"they differ in starts \(1, 3\), seed \(0, 1\)$"):
        compare(a, b)


def test_records_that_are_not_what_the_config_says_are_refused(tmp_path: Path) -> None:
    a, b = two_runs(tmp_path)
    moved = {name: replace(record, start=record.start + 1) for name, record in records(nbv=1.0).items()}
    with pytest.raises(DataError, match=r"expected the same episodes, as their config\.json say, got 24 and 24"):
        compare(a, written(tmp_path / "moved", moved))
    held = json.loads((b / CONFIG).read_text())
    for planners, message in (
        (None, "planners: expected"),
        ([asdict(PlannerConfig("nbv", False, ""))], "'random' is not"),
    ):
        (b / CONFIG).write_text(json.dumps({**held, "planners": planners}))
        with pytest.raises(DataError, match=message):
            compare(a, b)


def test_what_else_differs_is_said_aloud(tmp_path: Path) -> None:
    changes = {
        "recogniser_sha256": "f" * 64,
        "views": "paper",
        "form": "ctrgcn",
        "readout": "belief",
        "track": "px4-max",
        "track_sha256": "9" * 64,
        "onset": "known",
        "versions": {"torch": "2", "numpy": "2"},
    }
    assert {*changes, "gain_model_sha256", "vehicle"} == {*MAY_DIFFER} <= {*CONFIG_OF_RUN.to_json(), "onset"}
    a = written(tmp_path / "a", records(nbv=1.0), versions={"torch": "1", "numpy": "2"})
    b = written(tmp_path / "b", records(nbv=1.0), gain_model_sha256="3", **changes)
    note = compare_table(compare(a, b)).footnotes[1]
    assert note == (
        "Not the same in A and B: recogniser 1, ffffffffffff; views moving, paper; form causal, ctrgcn; "
        "readout recogniser, belief; track ideal, px4-max; onset unknown, known; torch 1, 2."
    )
    own = [written(tmp_path / sha256, records(nbv=1.0), track="lag", track_sha256=sha256) for sha256 in "78"]
    assert compare(*own).differing == {"track": ("7", "8")}
    quick, slow = (replace(VEHICLES["px4-auto"], speed=speed) for speed in (5.0, 2.0))
    flown = [written(tmp_path / f"{one.speed}", records(nbv=1.0), track="mine", vehicle=one) for one in (quick, slow)]
    (differing,) = compare(*flown).differing.items()
    assert differing[0] == "vehicle" and [text.split(",")[0] for text in differing[1]] == ["speed 5", "speed 2"]
    c = written(tmp_path / "c", records(nbv=1.0), gain_model_sha256="4")
    assert compare(b, c).differing["gain model"] == ("3", "4")


def trained(tmp_path: Path, name: str, digits: str) -> Path:
    """Write a run of il-ppo with as many trainings as digits, their weights; answers depend on the seed only."""
    held = {f"il-ppo/{seed}": make_records(seed, skill=1.0 * seed, episodes=24) for seed in range(len(digits))}
    return written(tmp_path / name, held, dict(zip(held, digits, strict=True)))


def compared(a: Path, b: Path) -> Any:
    (row,) = compare(a, b).planners
    return row


def test_trainings_are_drawn_together_only_where_they_are_the_same(tmp_path: Path) -> None:
    a = trained(tmp_path, "a", "123")
    same = compared(a, trained(tmp_path, "same", "123"))
    assert (same.difference.ci95, same.retrained) == ((0, 0), False)
    other = compared(a, trained(tmp_path, "other", "456"))
    assert other.retrained and other.difference.acc_mean == 0
    assert other.difference.ci95[0] < -1 and other.difference.ci95[1] > 1
    fewer = compared(a, trained(tmp_path, "fewer", "12"))
    assert fewer.trainings == (3, 2) and not fewer.retrained
    assert compared(tmp_path / "fewer", a).trainings == (2, 3)
    # A - B is as sure as B - A.
    back = compared(tmp_path / "other", a)
    assert width(back.difference.ci95_corrected) == pytest.approx(width(other.difference.ci95_corrected), rel=0.05)
    unknown = written(tmp_path / "unknown", {f"il-ppo/{seed}": make_records(seed, episodes=24) for seed in (0, 1)})
    assert compared(unknown, unknown).difference.ci95[0] < 0  # weights that are not known may be others


def test_an_own_planner_with_another_file_or_argument_is_named(tmp_path: Path) -> None:
    before = replace(PlannerConfig("nbv", False, "mine.py:Mine"), arguments={"radius": 5}, source_sha256="1")

    def footnotes(now: PlannerConfig) -> tuple[str, ...]:
        for name, planner in (("before", before), ("now", now)):
            write(tmp_path / name, records(nbv=1.0), planners=(planner,))
        return compare_table(compare(tmp_path / "before", tmp_path / "now")).footnotes

    said = "Another file or other arguments in A and B: nbv."
    assert said not in footnotes(before)
    assert said in footnotes(replace(before, source_sha256="2"))
    assert said in footnotes(replace(before, arguments={"radius": 6}))


def test_the_table_says_what_its_numbers_are(tmp_path: Path) -> None:
    a, b = two_runs(tmp_path)
    found = compare(a, b)
    table = compare_table(found)
    difference = found.planners[0].difference
    low, high = difference.ci95_corrected or (math.nan, math.nan)
    worse, better = difference.improvement_ci95 or (math.nan, math.nan)
    assert table.rows[0][1:] == (
        f"{found.planners[0].acc[0]:.1f}",
        f"{found.planners[0].acc[1]:.1f}",
        f"{difference.acc_mean:+.1f} [{low:.1f}, {high:.1f}]",
        f"{difference.smallest:.1f}",
        f"{100 * difference.improvement:.1f} [{100 * worse:.1f}, {100 * better:.1f}]",
        p_text(difference.p_corrected),
    )
    assert table.rows[1][0] == "oracle*" and "* privileged: is handed the label and the future." in table.footnotes
    assert table.footnotes[0] == f"A: {a}. B: {b}."
    assert table.bold == {(row, 3) for row, one in enumerate(found.planners) if one.difference.is_clear}
    certain = replace(difference, p_corrected=1e-9)
    table = compare_table(replace(found, planners=(replace(found.planners[0], difference=certain),)))
    assert table.rows[0][-1] == "<0.001"
    assert f"Intervals rest on {found.basis.text}" in table.notice
    seeds = compare_table(compare(trained(tmp_path, "t", "123"), trained(tmp_path, "u", "45")))
    assert "Trained to other weights in A and B: il-ppo." in seeds.footnotes
    assert any("il-ppo 3 and 2" in note for note in seeds.footnotes)


def test_one_sequence_has_no_intervals(tmp_path: Path) -> None:
    held = {name: replace(record, sequence=("only",) * 24) for name, record in records(nbv=1.0, no_act=0.0).items()}
    found: Comparison = compare(written(tmp_path / "a", held), written(tmp_path / "b", held), ("nbv", "no-act"))
    table = compare_table(found)
    assert table.rows[0][3].endswith(" [-]") and table.rows[0][4] == "-" and table.rows[0][5].endswith(" [-]")
    assert f"[-] No intervals: {found.no_intervals}." in table.footnotes
    assert table.rows[0][-1] == "-"


def test_the_command_prints_a_table_or_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = two_runs(tmp_path, readout="belief")
    main(["compare", str(a), str(b)])
    printed = capsys.readouterr().out
    assert "A - B [95 %]" in printed and "readout recogniser, belief" in printed
    main(["compare", str(a), str(b), "--planners", "no-act", "random"])
    assert "no-act - random" in capsys.readouterr().out
    assert "expected a run of ehar benchmark" in fails_with(["compare", str(a), str(tmp_path / "absent")], capsys)
    other = str(written(tmp_path / "other", records(nbv=1.0), sensor="estimator"))
    assert "differ in sensor (perfect, estimator)" in fails_with(["compare", str(a), other], capsys)


def test_it_writes_over_no_run(tmp_path: Path) -> None:
    a, b = two_runs(tmp_path)
    with pytest.raises(UsageError, match="expected a folder without a run"):
        compare(a, b, out=b)
