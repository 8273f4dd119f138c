import io
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from agents import untrained_agent
from rich.console import Console

from ehar.errors import DataError, UsageError
from ehar.rollout import Record
from eval.flight_records import FlightRecords
from eval.records import DIGITS, EpisodeRecords, episode_lines, join_records, read_episodes, record_episodes
from eval.results import (
    CONFIG,
    EPISODES,
    SUMMARY,
    PlannerConfig,
    RunConfig,
    check_out,
    planner_config,
    write_run,
    write_text,
)
from eval.solves import Solves
from eval.summary import Conditions, Summary, summarise
from eval.tables import benchmark_table, markdown_summary, paper_table, render_summary
from planners.heuristic import NoAct
from planners.oracle import Oracle

CONDITIONS = Conditions(
    data="tiny (synthetic)", sensor="perfect", views="moving", track="ideal", form="causal", readout="recogniser"
)
CONFIG_OF_RUN = RunConfig(
    source="tiny",
    data="tiny (synthetic)",
    data_sha256="0",
    models=None,
    recogniser_sha256="1",
    sensor="perfect",
    views="moving",
    form="causal",
    track="ideal",
    vehicle=None,
    readout="recogniser",
    part="test",
    gain_model_sha256=None,
    starts=1,
    seed=0,
    length=4,
    fps=None,
    planners=(),
    versions={},
)


def make_records(seed: int, *, skill: float = 0.0, episodes: int = 9, length: int = 4) -> EpisodeRecords:
    rng = np.random.default_rng(seed)
    fixed = np.random.default_rng(0)
    label = fixed.integers(0, 3, episodes)
    logits = rng.normal(size=(episodes, length, 3)) + skill * np.eye(3)[label][:, None]
    log_probs = logits - np.log(np.exp(logits).sum(axis=-1, keepdims=True))
    record = Record(fixed.uniform([5, 0, 0], [15, 6, 1.5], (episodes, length, 3)), log_probs.astype(np.float32), 0.1)
    return record_episodes(
        record,
        sequence=[f"séquence {index // 2}" for index in range(episodes)],
        first=np.arange(episodes),
        start=record.viewpoints[:, 0],
        label=label,
    )


def three_planners() -> dict[str, EpisodeRecords]:
    return {"no-act": make_records(1), "mine": make_records(2, skill=1.0), "oracle": make_records(3, skill=2.0)}


def summary_of(records: dict[str, EpisodeRecords], **options: Any) -> Summary:
    return summarise(
        records,
        CONDITIONS,
        privileged={name: name == "oracle" for name in records},
        step_ms=dict.fromkeys(records, 0.25),
        **options,
    )


def write_finished(directory: Path, records: dict[str, EpisodeRecords], **options: Any) -> Path:
    """Write a run with a summary, under the conditions of `CONFIG_OF_RUN` but for the options."""
    write_run(directory, replace(CONFIG_OF_RUN, **options), records, summary_of(records))
    return directory


def flown(records: EpisodeRecords, seed: int = 0) -> EpisodeRecords:
    numbers = np.random.default_rng(seed).random((5, len(records))).round(DIGITS)
    return replace(records, flight=FlightRecords(*numbers))


def test_records_keep_what_metrics_need() -> None:
    log_probs = np.log(np.array([[[0.7, 0.2, 0.1], [0.2, 0.5, 0.3]]], dtype=np.float32))
    record = Record(np.full((1, 2, 3), 1.23456789), log_probs, 0.0)
    kept = record_episodes(record, sequence=["a"], first=np.array([3]), start=np.zeros((1, 3)), label=np.array([1]))
    assert kept.predicted.tolist() == [[0, 1]]
    assert kept.correct.tolist() == [[False, True]]
    assert kept.true_probability.tolist() == [[0.2, 0.5]]
    assert kept.top_probability.tolist() == [[0.7, 0.5]]
    assert kept.viewpoint[0, 0, 0] == round(1.23456789, DIGITS)


def test_records_read_back_are_the_records_written(tmp_path: Path) -> None:
    records = three_planners()
    write_text(tmp_path / EPISODES, episode_lines(records))
    back = read_episodes(tmp_path / EPISODES)
    assert list(back) == list(records)
    for name, episodes in records.items():
        assert back[name].sequence == episodes.sequence
        for field in ("first", "start", "label", "viewpoint", "predicted", "true_probability", "top_probability"):
            np.testing.assert_array_equal(getattr(back[name], field), getattr(episodes, field))


def test_batches_join_in_order() -> None:
    whole = join_records([make_records(1), make_records(2)])
    assert len(whole) == 18
    np.testing.assert_array_equal(whole.predicted[9:], make_records(2).predicted)


def test_every_number_of_the_summary_can_be_recomputed_from_the_file(tmp_path: Path) -> None:
    records = three_planners()
    summary = summary_of(records)
    write_run(tmp_path, CONFIG_OF_RUN, records, summary)
    written = json.loads((tmp_path / SUMMARY).read_text())
    assert summary_of(read_episodes(tmp_path / EPISODES)).to_json() == summary.to_json()
    # And by hand, from the lines alone.
    rows = [json.loads(line) for line in (tmp_path / EPISODES).read_text().splitlines()]
    acc = {
        name: 100 * np.mean([np.equal(row["predicted"], row["label"]) for row in rows if row["planner"] == name])
        for name in records
    }
    mine = written["planners"][1]
    assert mine["acc_mean"] == pytest.approx(acc["mine"])
    assert mine["gap_closed"] == pytest.approx((acc["mine"] - acc["no-act"]) / (acc["oracle"] - acc["no-act"]))
    true = [probability for row in rows if row["planner"] == "mine" for probability in row["true_probability"]]
    assert mine["nll"] == pytest.approx(-np.mean(np.log(true)))
    assert mine["acc_mean_ci95"][0] < mine["acc_mean"] < mine["acc_mean_ci95"][1]


def test_summary_json_has_the_fields_of_the_schema(tmp_path: Path) -> None:
    written = summary_of(three_planners()).to_json()
    conditions = ["data", "sensor", "views", "track", "readout", "episodes", "no_intervals"]
    assert list(written) == [*conditions, "planners", "differences"]
    assert list(written["planners"][0]) == [
        "name",
        "privileged",
        "training_seeds",
        "acc",
        "acc_mean",
        "acc_mean_ci95",
        "acc_mean_seed_sd",
        "acc_iqm",
        "acc_iqm_ci95",
        "gap_closed",
        "gap_closed_ci95",
        "nll",
        "ece",
        "path_length_m",
        "step_ms",
        "accuracy_kept",
        "accuracy_kept_ci95",
        "peak_speed",
        "peak_acceleration",
        "peak_jerk",
        "effort",
        "limit_share",
        "solves",
        "fallback_share",
    ]
    assert all(written["planners"][0][name] is None for name in list(written["planners"][0])[15:])
    assert list(written["planners"][0]["acc"]) == ["10", "30", "50", "70", "90", "100"]
    assert written["episodes"] == 9
    assert [planner["privileged"] for planner in written["planners"]] == [False, False, True]


def test_both_ends_of_the_gap_are_certain() -> None:
    summary = summary_of(three_planners())
    assert (summary.planner("no-act").gap_closed, summary.planner("no-act").gap_closed_ci95) == (0, (0, 0))
    assert (summary.planner("oracle").gap_closed, summary.planner("oracle").gap_closed_ci95) == (1, (1, 1))


def test_without_an_oracle_no_gap_is_closed_and_the_table_says_why() -> None:
    records = three_planners()
    del records["oracle"]
    summary = summary_of(records)
    assert summary.planner("mine").gap_closed is None
    table = benchmark_table(summary)
    assert table.rows[1][8] == "-"
    assert table.footnotes == ("Gap closed needs both no-act and oracle among the planners.",)


def test_planners_that_ran_other_episodes_are_not_compared() -> None:
    records = three_planners()
    records["mine"] = replace(records["mine"], first=records["mine"].first + 1)
    with pytest.raises(DataError, match="'mine': expected the same 9 episodes"):
        summary_of(records)


def test_a_malformed_line_is_named(tmp_path: Path) -> None:
    lines = list(episode_lines({"mine": make_records(0)}))
    (tmp_path / EPISODES).write_text(lines[0] + '{"planner": "mine"}\n')
    with pytest.raises(DataError, match="line 2"):
        read_episodes(tmp_path / EPISODES)
    with pytest.raises(DataError, match="No such file"):
        read_episodes(tmp_path / "absent.jsonl")


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("label", -1, "label: expected whole numbers from 0, L = 4"),
        ("label", "1", "label: expected whole numbers"),
        ("label", 2**70, "label: expected whole numbers"),
        ("start", [1, 2], r"start: expected finite numbers, shape \(3\)"),
        ("predicted", [0, 1, 2], r"predicted: expected whole numbers from 0, shape \(L\), L = 4"),
        ("predicted", [0, 1, 2, 0.5], "predicted: expected whole numbers"),
        ("predicted", [], "predicted: expected a list of at least one frame"),
        ("viewpoint", [[1, 2, 3], [1, 2]], r"viewpoint: expected finite numbers, shape \(L, 3\)"),
        ("true_probability", [0, 0, 0, 1.5], r"true_probability: expected finite numbers from 0 to 1, shape \(L\)"),
        ("top_probability", [0, 0, 0, float("nan")], "top_probability: expected finite numbers from 0 to 1"),
        ("top_probability", None, "top_probability: expected finite numbers from 0 to 1"),
        ("sequence", 3, "sequence: expected a name, got 3"),
        ("planner", [], r"planner: expected a name, got \[\]"),
    ],
)
def test_a_field_that_is_off_is_named_with_its_line(tmp_path: Path, field: str, value: Any, message: str) -> None:
    lines = list(episode_lines({"mine": make_records(0)}))
    lines[2] = json.dumps({**json.loads(lines[2]), field: value}) + "\n"
    (tmp_path / EPISODES).write_text("".join(lines))
    with pytest.raises(DataError, match=rf"episodes\.jsonl, line 3: {message}"):
        read_episodes(tmp_path / EPISODES)


def test_a_file_that_is_cut_off_or_no_text_is_named(tmp_path: Path) -> None:
    lines = list(episode_lines({"mine": make_records(0)}))
    (tmp_path / EPISODES).write_text(lines[0] + lines[1][:100])
    with pytest.raises(DataError, match="line 2: expected one JSON object a line"):
        read_episodes(tmp_path / EPISODES)
    (tmp_path / EPISODES).write_bytes(b"\xff")
    with pytest.raises(DataError, match="expected text in UTF-8"):
        read_episodes(tmp_path / EPISODES)


def test_the_table_marks_who_is_privileged_and_prints_percent() -> None:
    table = benchmark_table(summary_of(three_planners()))
    assert "tiny (synthetic)" in table.title
    assert "9 episodes of 4 frames from 5 sequences" in table.title
    assert [row[0] for row in table.rows] == ["no-act", "mine", "oracle*"]
    assert table.rows[2][8] == "100.0 [100.0, 100.0]"
    assert "| oracle\\* |" in markdown_summary(summary_of(three_planners()))


def test_the_papers_rows_stand_beside_its_data_only() -> None:
    summary = summary_of(three_planners())
    assert paper_table(summary) is None
    table = paper_table(replace(summary, data="expi"))
    assert table is not None
    gaps = {row[0]: row[-1] for row in table.rows}
    # The paper's agent closes 46.4 % on ExPI, its best heuristic 7.0 %.
    assert (gaps["il-ppo"], gaps["v-rotate"], gaps["oracle*"]) == ("46.4", "7.0", "100.0")


def test_what_flights_demanded_is_written_and_summarised_on_flight_tracks_only(tmp_path: Path) -> None:
    records = {"no-act": flown(make_records(1)), "mine": flown(make_records(2), seed=5)}
    summary = summary_of(records)
    write_run(tmp_path, CONFIG_OF_RUN, records, summary)
    back = read_episodes(tmp_path / EPISODES)
    assert summary_of(back).to_json() == summary.to_json()
    rows = [json.loads(line) for line in (tmp_path / EPISODES).read_text().splitlines()]
    mine = summary.to_json()["planners"][1]
    of = {
        key: [row[key] for row in rows if row["planner"] == "mine"] for key in ("peak_speed", "effort", "limit_share")
    }
    assert mine["peak_speed"] == max(of["peak_speed"])
    assert (mine["effort"], mine["limit_share"]) == pytest.approx((np.mean(of["effort"]), np.mean(of["limit_share"])))
    assert "peak [m/s]" in benchmark_table(summary).header
    on_grid = summary_of(three_planners())
    assert not {"peak [m/s]", "kept % [95 %]"} & set(benchmark_table(on_grid).header)
    assert "peak_speed" not in next(iter(episode_lines(three_planners())))


def test_batches_of_flights_join_in_order() -> None:
    whole = join_records([flown(make_records(1)), flown(make_records(2), seed=5)])
    assert whole.flight is not None
    np.testing.assert_array_equal(whole.flight.effort[9:], np.random.default_rng(5).random((5, 9)).round(DIGITS)[3])


def test_half_of_a_flight_is_no_flight(tmp_path: Path) -> None:
    lines = list(episode_lines({"mine": flown(make_records(0))}))
    (tmp_path / EPISODES).write_text(lines[0].replace('"effort"', '"exertion"'))
    with pytest.raises(DataError, match="line 1: expected all of the fields"):
        read_episodes(tmp_path / EPISODES)
    (tmp_path / EPISODES).write_text(lines[0] + next(iter(episode_lines({"mine": make_records(0)}))))
    with pytest.raises(DataError, match="some episodes were flown, and others were not"):
        read_episodes(tmp_path / EPISODES)


def test_the_gap_of_a_flight_reaches_up_to_the_oracle_of_the_ideal_track() -> None:
    on_ideal = {"no-act": make_records(1), "oracle": make_records(2, skill=3.0)}
    records = {"no-act": on_ideal["no-act"], "mine": make_records(3, skill=1.0), "oracle": make_records(4, skill=0.5)}
    low, mine, high = (r.correct.mean() for r in (records["no-act"], records["mine"], on_ideal["oracle"]))
    closed = summary_of(records, on_ideal=on_ideal).planner("mine").gap_closed
    assert closed == pytest.approx((mine - low) / (high - low))
    alone = summary_of(records).planner("mine").gap_closed
    assert alone != pytest.approx(closed)


def test_accuracy_kept_is_the_gain_in_flight_over_that_on_the_ideal_track() -> None:
    on_ideal = {"no-act": make_records(1), "mine": make_records(2, skill=2.0)}
    records = {"no-act": on_ideal["no-act"], "mine": make_records(2, skill=1.0), "other": make_records(3)}
    summary = summary_of(records, on_ideal=on_ideal)
    no_act, flying, ideal = (
        100 * episodes.correct.mean() for episodes in (on_ideal["no-act"], records["mine"], on_ideal["mine"])
    )
    assert no_act < flying < ideal
    mine = summary.planner("mine")
    assert mine.accuracy_kept == pytest.approx((flying - no_act) / (ideal - no_act))
    assert mine.accuracy_kept_ci95 is not None
    assert mine.accuracy_kept_ci95[0] < mine.accuracy_kept < mine.accuracy_kept_ci95[1]
    # No-act gains nothing to keep, and the third was not run on the ideal track.
    assert summary.planner("no-act").accuracy_kept is None
    assert summary.planner("other").accuracy_kept is None
    assert "kept % [95 %]" in benchmark_table(summary).header
    # A planner that does as well in flight keeps all, in every resample.
    whole = summary_of({**records, "mine": on_ideal["mine"]}, on_ideal=on_ideal).planner("mine")
    assert (whole.accuracy_kept, whole.accuracy_kept_ci95) == (1, (1, 1))


def test_flights_are_compared_with_the_same_episodes_only() -> None:
    records = three_planners()
    other = {name: replace(episodes, start=episodes.start + 1) for name, episodes in records.items()}
    with pytest.raises(DataError, match="'no-act on the ideal track': expected the same 9 episodes"):
        summary_of(records, on_ideal=other)


def test_nbv_is_compared_in_pairs_with_every_planner_that_is_not_privileged() -> None:
    records = three_planners()
    assert summary_of(records).differences == ()
    records["nbv"] = make_records(4, skill=2.0)
    records["twin"] = records["nbv"]
    summary = summary_of(records)
    assert [(of.planner, of.other) for of in summary.differences] == [
        ("nbv", name) for name in ("no-act", "mine", "twin")
    ]
    to_no_act, _, to_twin = summary.differences
    assert to_no_act.acc_mean == pytest.approx(summary.planner("nbv").acc_mean - summary.planner("no-act").acc_mean)
    assert to_no_act.ci95[0] < to_no_act.acc_mean < to_no_act.ci95[1]
    assert (to_twin.acc_mean, to_twin.ci95) == (0, (0, 0)), "a pair shares its resamples"
    assert "| twin | +0.0 [0.0, 0.0] |" in markdown_summary(summary)
    assert summary.to_json()["differences"][0]["other"] == "no-act"


def test_fallbacks_are_stated_below_the_table() -> None:
    counted = Solves({"infeasible": 2, "ipopt-fallback": 1, "optimal": 7}, 3)
    summary = summary_of(three_planners(), solves={"no-act": None, "mine": counted, "oracle": None})
    note = "mine: 3 of 10 plans fell back (infeasible 2, ipopt-fallback 1, optimal 7)."
    assert benchmark_table(summary).footnotes[-1] == note
    written = summary.to_json()["planners"]
    assert (written[1]["solves"], written[1]["fallback_share"]) == (counted.counts, 0.3)
    assert (written[0]["solves"], written[0]["fallback_share"]) == (None, None)
    clean = Solves({"optimal": 10}, 0)
    without = summary_of(three_planners(), solves={"no-act": None, "mine": clean, "oracle": None})
    assert not [line for line in benchmark_table(without).footnotes if "fell back" in line]


def test_the_title_says_whose_probabilities_were_scored_unless_the_recogniser_s() -> None:
    summary = summary_of(three_planners())
    assert "readout" not in benchmark_table(summary).title
    assert "readout belief, 9 episodes" in benchmark_table(replace(summary, readout="belief")).title


@pytest.mark.parametrize("width", range(90, 240, 7))
def test_no_cell_is_cut_off_in_a_terminal_of_any_width(width: int) -> None:
    records = {name: flown(episodes) for name, episodes in three_planners().items()}
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(render_summary(summary_of(records, on_ideal=three_planners())))
    assert "…" not in console.export_text()


def test_config_says_which_weights_a_planner_had() -> None:
    assert planner_config(NoAct()) == PlannerConfig("no-act", False, "planners.heuristic.NoAct", None)
    assert planner_config(Oracle()) == PlannerConfig("oracle", True, "planners.oracle.Oracle", None)
    learned = planner_config(untrained_agent("il-ppo/0"))
    assert learned == PlannerConfig("il-ppo/0", False, "planners.agent.Agent", "of il-ppo/0")


def test_a_folder_that_holds_another_run_is_refused(tmp_path: Path) -> None:
    out = tmp_path / "run"
    check_out(out, asdict(CONFIG_OF_RUN))
    write_run(out, CONFIG_OF_RUN, three_planners(), None)
    check_out(out, asdict(CONFIG_OF_RUN))
    with pytest.raises(UsageError, match=r"another run, which differs in seed \(seed was 0, now 1\)"):
        check_out(out, asdict(replace(CONFIG_OF_RUN, seed=1)))
    (out / CONFIG).write_text("{")
    with pytest.raises(UsageError, match="expected the JSON of a run"):
        check_out(out, asdict(CONFIG_OF_RUN))
    (out / CONFIG).unlink()
    with pytest.raises(UsageError, match=r"without config\.json"):
        check_out(out, asdict(CONFIG_OF_RUN))


def test_a_file_where_a_folder_is_expected_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="expected a folder"):
        check_out(tmp_path / "file" / "run", asdict(CONFIG_OF_RUN))


def test_a_file_that_fails_halfway_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "file.json"
    write_text(path, ["old"])

    def broken():  # type: ignore[no-untyped-def]
        yield "ne"
        raise RuntimeError

    with pytest.raises(RuntimeError):
        write_text(path, broken())
    assert path.read_text() == "old"
    assert [file.name for file in tmp_path.iterdir()] == ["file.json"]
