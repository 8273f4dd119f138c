"""A run: its summary, its records, what it prints, and its folder."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ehar.errors import DataError, UsageError
from eval.records.config import CONFIG
from eval.records.episode_lines import episode_lines
from eval.records.episodes import EpisodeRecords
from eval.records.job_times import JOB_TIMES
from eval.records.run_files import EPISODES, SUMMARY, TABLE
from eval.render.tables import text
from eval.running.run import Run, class_names, read_run
from eval.scores.metrics import ACC_AT, mean_acc, right_at
from planners.heuristic import NoAct
from tests.helpers.fakes import CLASS_NAMES, stopped
from tests.helpers.made_records import (
    config_of_run,
    flown,
    make_records,
    make_stream_records,
    summary_of,
    three_planners,
    write_finished,
)
from tests.helpers.tiny_benchmarks import names, run

FILES = {CONFIG, EPISODES, SUMMARY, "table.md", "accuracy.png", "accuracy.svg"}


def made_run(records: dict[str, EpisodeRecords] | None = None) -> Run:
    """Return a run in memory."""
    records = three_planners() if records is None else records
    config = config_of_run()
    return Run(config, records, CLASS_NAMES, summary_of(records, config))


def same_records(one: Run, other: Run) -> bool:
    """Return whether runs have the same records, in the same order."""
    return list(episode_lines(one.records)) == list(episode_lines(other.records))


@pytest.mark.usefixtures("fake_weights")
def test_a_planner_alone_may_be_named_listed_or_made() -> None:
    one, listed, made = (run(planners, starts=1) for planners in ("no-act", ["no-act"], NoAct()))
    assert names(one.summary) == names(listed.summary) == names(made.summary) == ("no-act",)
    assert same_records(one, listed) and same_records(one, made)
    assert one.config == listed.config == made.config
    assert one.class_names == CLASS_NAMES


@pytest.mark.usefixtures("fake_weights")
def test_what_the_benchmark_returns_is_what_it_wrote(tmp_path: Path) -> None:
    ran = run(out=tmp_path / "run", sensor="estimator", seed=3)
    back = read_run(tmp_path / "run")
    assert (back.config, back.summary) == (ran.config, ran.summary)
    assert (back.conditions.sensor, back.conditions.seed, back.flown) == ("estimator", 3, False)
    assert same_records(ran, back)
    assert ran.folder == back.folder == tmp_path / "run"
    ran.save(tmp_path / "again")
    assert {path.name for path in (tmp_path / "run").iterdir()} == FILES | {JOB_TIMES}
    for name in FILES:
        assert (tmp_path / "run" / name).read_bytes() == (tmp_path / "again" / name).read_bytes(), name


def test_a_run_that_was_saved_is_read_by_text_and_by_path(tmp_path: Path) -> None:
    ran = made_run({"no-act": flown(make_records(1)), "il/0": flown(make_records(2)), "il/1": flown(make_records(3))})
    assert ran.save(str(tmp_path / "a")) == tmp_path / "a"
    assert {path.name for path in (tmp_path / "a").iterdir()} == FILES
    by_text, by_path = read_run(str(tmp_path / "a")), read_run(tmp_path / "a")
    for back in (by_text, by_path):
        assert (back.config, back.summary, back.directory) == (ran.config, ran.summary, tmp_path / "a")
        assert same_records(ran, back)
        assert str(back) == str(ran)
    by_path.save(tmp_path / "b")
    for name in (CONFIG, EPISODES, SUMMARY, "table.md"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name


def test_a_run_that_is_stopped_before_its_picture_has_no_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eval.render.figures.draw_accuracy", stopped)
    with pytest.raises(KeyboardInterrupt):
        made_run().save(tmp_path)
    assert (tmp_path / SUMMARY).is_file() and not (tmp_path / TABLE).exists()


def test_a_folder_that_holds_another_run_is_not_overwritten(tmp_path: Path) -> None:
    write_finished(tmp_path, three_planners(), seed=1)
    before = (tmp_path / EPISODES).read_bytes()
    with pytest.raises(UsageError, match="holds another run, which differs in seed"):
        made_run().save(tmp_path)
    assert (tmp_path / EPISODES).read_bytes() == before


def test_a_run_in_memory_has_no_folder() -> None:
    with pytest.raises(UsageError, match="expected a run in a folder, this one is in memory: save it"):
        _ = made_run().folder


def test_it_prints_as_a_line_and_as_its_table(tmp_path: Path) -> None:
    ran = made_run()
    title = "tiny (synthetic), perfect sensor, moving views, ideal track"
    assert repr(ran) == f"Run({title}: 3 planners, 9 episodes each)"
    assert repr(ran.summary) == f"Summary({title}: 3 planners, 9 episodes of 4 frames from 5 sequences)"
    assert str(ran.summary) == text(*ran.summary.tables())
    assert str(ran).startswith(str(ran.summary))
    for word in (ran.summary.title, "oracle*", "mean acc [95 %]"):
        assert word in str(ran)
    page = ran._repr_html_()
    assert page.startswith(ran.summary._repr_html_())
    assert page.count("<table") == len(ran.summary.tables()) and "<td data-value=" in page and "no-act" in page
    back = read_run(ran.save(tmp_path))
    assert (repr(back), repr(back.summary)) == (repr(ran), repr(ran.summary))
    alone = made_run({"no-act": make_records(1)})
    assert ": 1 planner, 9 episodes" in repr(alone) and ": 1 planner, 9 episodes" in repr(alone.summary)


def test_a_data_frame_has_one_row_an_episode_and_planner() -> None:
    records = three_planners()
    frame = made_run(records).to_dataframe()
    assert frame["planner"].tolist() == [name for name in records for _ in range(9)]
    for name, episodes in records.items():
        rows = frame[frame["planner"] == name]
        assert rows["sequence"].tolist() == list(episodes.sequence)
        assert rows["first_frame"].tolist() == episodes.first.tolist()
        assert rows["label"].tolist() == [CLASS_NAMES[label] for label in episodes.label]
        assert rows["predicted"].tolist() == [CLASS_NAMES[label] for label in episodes.predicted[:, -1]]
        np.testing.assert_allclose(rows["acc_mean"], 100 * mean_acc(episodes.correct))
        np.testing.assert_array_equal(rows["true_probability"], episodes.true_probability[:, -1])
        np.testing.assert_allclose(rows["start_azimuth_deg"], np.degrees(episodes.start[:, 1]))
        for percent in ACC_AT:
            np.testing.assert_array_equal(rows[f"right_at_{percent}"], right_at(episodes.correct, percent))
    assert frame.columns.is_unique and len(frame) == 27 and not frame.isna().any(axis=None)
    of_planners = frame.groupby("planner")["acc_mean"].mean()
    assert of_planners["mine"] == pytest.approx(summary_of(records).planner("mine").acc_mean)


def test_a_data_frame_of_flights_has_what_they_demanded_and_of_a_read_run_numbers(tmp_path: Path) -> None:
    ran = made_run({"no-act": flown(make_records(1))})
    assert ran.records["no-act"].flight is not None
    np.testing.assert_array_equal(ran.to_dataframe()["effort"], ran.records["no-act"].flight.effort)
    frame = read_run(ran.save(tmp_path)).to_dataframe()
    assert frame["label"].tolist() == make_records(1).label.tolist()


def test_without_pandas_a_data_frame_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(
        UsageError, match=r"a data frame needs pandas, which is not installed: pip install -e '\.\[notebook\]'"
    ):
        made_run().to_dataframe()


def test_a_planner_that_did_not_run_is_named_with_those_that_did() -> None:
    ran = made_run({"no-act": make_records(1), "il/0": make_records(2), "il/1": make_records(3)})
    message = "no planner 'nope'.*; expected one of: "
    with pytest.raises(UsageError, match=f"{message}no-act, il$"):
        ran.summary.planner("nope")
    with pytest.raises(UsageError, match=f"this run: {message}no-act, il, il/0, il/1$"):
        ran.episodes("nope")
    with pytest.raises(UsageError, match=message):
        ran.record_name("nope")
    assert ran.summary.planner("il").training_seeds == (0, 1)
    assert (len(ran.episodes("il")), len(ran.episodes("il/1")), ran.record_name("il")) == (18, 9, "il/0")


def test_a_run_that_is_not_finished_is_not_read(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"config\.json: expected a run of ehar benchmark, got: No such file"):
        read_run(tmp_path / "nowhere")
    records = three_planners()
    write_finished(tmp_path, {**records, "mine": make_records(2, episodes=9)})
    (tmp_path / SUMMARY).unlink()
    with pytest.raises(DataError, match=r"expected a finished run, this one is incomplete: no summary\.json"):
        read_run(tmp_path)
    lines = (tmp_path / EPISODES).read_text().splitlines(keepends=True)
    (tmp_path / EPISODES).write_text("".join(lines[:-1]))
    with pytest.raises(DataError, match="incomplete: oracle has 8 of 9 episodes"):
        read_run(tmp_path)
    last = {**json.loads(lines[-1]), "first": 77}
    (tmp_path / EPISODES).write_text("".join(lines[:-1]) + json.dumps(last) + "\n")
    (tmp_path / SUMMARY).write_text("{}")
    with pytest.raises(DataError, match="expected the same episodes for every planner, those of oracle are not no-act"):
        read_run(tmp_path)


def test_classes_are_numbered_aloud_where_the_data_is_gone(tmp_path: Path) -> None:
    notes: list[str] = []
    assert class_names(made_run(), notes.append) == CLASS_NAMES
    assert notes == []
    back = read_run(write_finished(tmp_path, three_planners(), source=str(tmp_path / "gone.npz")))
    assert class_names(back, notes.append) == ("class 0", "class 1", "class 2")
    assert len(notes) == 1 and "gone.npz" in notes[0]


def test_a_class_that_is_answered_and_never_shown_is_numbered_too(tmp_path: Path) -> None:
    held = make_records(2)
    records = {"no-act": make_records(1), "mine": replace(held, predicted=np.where(held.predicted == 2, 4, 1))}
    back = read_run(write_finished(tmp_path, records, source=str(tmp_path / "gone.npz")))
    assert class_names(back, lambda _: None) == tuple(f"class {label}" for label in range(5))


def test_streams_are_counted_once_for_all_trainings() -> None:
    labels = np.repeat([[0, 1, -1, 2]], 5, axis=1).repeat(4, axis=0)
    records = {f"il/{seed}": make_stream_records(labels, labels) for seed in range(3)}
    config = config_of_run(fps=2.0, length=20)
    ran = Run(config, records, CLASS_NAMES, summary_of(records, config))
    assert any(table.title == "In streams: 4 episodes of 10 s" for table in ran.tables())
