"""The figures of a run, and the pairs that are compared."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ehar.errors import DataError
from eval.records.episodes import episode_lines, read_episodes
from eval.records.run_files import EPISODES, SUMMARY
from eval.render.tables import markdown
from eval.running.run import write_records
from tests.helpers.made_records import CONFIG_OF_RUN, flown, make_records, summary_of, three_planners


def test_every_number_of_the_summary_can_be_recomputed_from_the_file(tmp_path: Path) -> None:
    records = three_planners()
    summary = summary_of(records)
    write_records(tmp_path, CONFIG_OF_RUN, records, summary)
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
    table = summary.tables()[0]
    assert table.rows[1][8] == "-"
    assert table.footnotes == ("Gap closed needs both no-act and oracle among the planners.",)


def test_planners_that_ran_other_episodes_are_not_compared() -> None:
    records = three_planners()
    records["mine"] = replace(records["mine"], first=records["mine"].first + 1)
    with pytest.raises(DataError, match="'mine': expected the same 9 episodes"):
        summary_of(records)


def test_what_flights_demanded_is_written_and_summarised_on_flight_tracks_only(tmp_path: Path) -> None:
    records = {"no-act": flown(make_records(1)), "mine": flown(make_records(2), seed=5)}
    summary = summary_of(records)
    write_records(tmp_path, CONFIG_OF_RUN, records, summary)
    back = read_episodes(tmp_path / EPISODES)
    assert summary_of(back).to_json() == summary.to_json()
    rows = [json.loads(line) for line in (tmp_path / EPISODES).read_text().splitlines()]
    mine = summary.to_json()["planners"][1]
    of = {
        key: [row[key] for row in rows if row["planner"] == "mine"] for key in ("peak_speed", "effort", "limit_share")
    }
    assert mine["peak_speed"] == max(of["peak_speed"])
    assert (mine["effort"], mine["limit_share"]) == pytest.approx((np.mean(of["effort"]), np.mean(of["limit_share"])))
    assert "peak [m/s]" in summary.tables()[0].header
    on_grid = summary_of(three_planners())
    assert not {"peak [m/s]", "kept % [95 %]"} & set(on_grid.tables()[0].header)
    assert "peak_speed" not in next(iter(episode_lines(three_planners())))


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
    assert "kept % [95 %]" in summary.tables()[0].header
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
    assert "| twin | +0.0 [0.0, 0.0] |" in markdown(*summary.tables())
    assert summary.to_json()["differences"][0]["other"] == "no-act"
