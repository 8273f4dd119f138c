"""The figures of a run, and the pairs that are compared."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ehar.errors import DataError, UsageError
from ehar.files import json_text
from eval.records.config import PlannerConfig, RunConfig
from eval.records.episode_lines import episode_lines, read_episodes
from eval.records.episodes import EpisodeRecords
from eval.records.flights import COSTS
from eval.records.run_files import EPISODES, SUMMARY
from eval.records.solves import Solves
from eval.render.tables import markdown
from eval.running.run import write_records
from eval.scores.summary import Summary, read_summary
from tests.helpers.made_records import (
    CONFIG_OF_RUN,
    config_of_run,
    flown,
    make_records,
    make_stream_records,
    summary_of,
    three_planners,
)


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
    conditions = ["data", "sensor", "views", "track", "readout", "episodes", "no_intervals", "basis"]
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
        "ece_late",
        "path_length_m",
        "step_ms",
        "accuracy_kept",
        "accuracy_kept_ci95",
        "tracking_error_median",
        "tracking_error_p95",
        "peak_speed",
        "peak_acceleration",
        "peak_jerk",
        "effort",
        "limit_share",
        "solves",
        "fallback_share",
    ]
    assert all(written["planners"][0][name] is None for name in list(written["planners"][0])[16:])
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
    figures = {
        key: [row[key] for row in rows if row["planner"] == "mine"] for key in ("peak_speed", "effort", "limit_share")
    }
    assert mine["peak_speed"] == max(figures["peak_speed"])
    assert (mine["effort"], mine["limit_share"]) == pytest.approx(
        (np.mean(figures["effort"]), np.mean(figures["limit_share"]))
    )
    assert "peak [m/s]" in summary.tables()[0].header
    costs = {key: np.array([row[key] for row in rows if row["planner"] == "mine"]) for key in COSTS}
    assert (mine["distance"], mine["energy"]) == pytest.approx((costs["distance"].mean(), costs["energy"].mean()))
    assert mine["noise"] == pytest.approx(10 * np.log10((10 ** (costs["noise"] / 10)).mean()))
    headers = ("flown [m]", "energy [kJ]", "noise [dB(A)]")
    shown = dict(zip(summary.tables()[0].header, summary.tables()[0].rows[1], strict=True))
    assert [shown[header] for header in headers] == [
        f"{mine['distance']:.1f}",
        f"{mine['energy'] / 1000:.2f}",
        f"{mine['noise']:.1f}",
    ]
    on_grid = summary_of(three_planners())
    assert not {"peak [m/s]", "kept % [95 %]", *headers} & set(on_grid.tables()[0].header)
    assert "peak_speed" not in next(iter(episode_lines(three_planners())))


def test_the_gap_of_a_flight_reaches_up_to_the_oracle_of_the_ideal_track() -> None:
    on_ideal = {"no-act": make_records(1), "oracle": make_records(2, skill=3.0)}
    records = {"no-act": on_ideal["no-act"], "mine": make_records(3, skill=1.0), "oracle": make_records(4, skill=0.5)}
    low, mine, high = (r.correct.mean() for r in (records["no-act"], records["mine"], on_ideal["oracle"]))
    closed = summary_of(records, on_ideal=on_ideal).planner("mine").gap_closed
    assert closed == pytest.approx((mine - low) / (high - low))
    alone = summary_of(records).planner("mine").gap_closed
    assert alone != pytest.approx(closed)


def test_the_table_says_whose_gap_it_is_if_no_oracle_flew() -> None:
    on_ideal = {"no-act": make_records(1), "oracle": make_records(2, skill=3.0)}
    records = {"no-act": flown(make_records(1)), "mine": flown(make_records(3, skill=1.0))}
    note = "Gap closed reaches up to the oracle of the run on the ideal track."
    assert note in summary_of(records, on_ideal=on_ideal).tables()[0].footnotes
    assert note not in summary_of(records).tables()[0].footnotes
    assert note not in summary_of(three_planners()).tables()[0].footnotes


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


def test_accuracy_kept_in_streams_is_that_of_their_activities() -> None:
    labels = np.tile([-1, 0, 0, 0, 0, -1, 1, 1, 1, 1, -1], (3, 1))
    late, later, soon = labels.copy(), labels.copy(), labels.copy()
    late[:, [1, 2, 6, 7]] = 2  # half of each activity is wrong, in flight a quarter, and on the grid nothing
    later[:, [1, 6]] = 2
    later[:, [0, 5, 10]] = 2  # between activities nothing is counted
    on_ideal = {"no-act": make_stream_records(labels, late), "mine": make_stream_records(labels, soon)}
    flying = {"no-act": on_ideal["no-act"], "mine": make_stream_records(labels, later)}
    assert summary_of(flying, on_ideal=on_ideal).planner("mine").accuracy_kept == pytest.approx(0.5)
    other = {name: make_stream_records(np.roll(labels, 1), np.roll(late, 1)) for name in flying}
    with pytest.raises(DataError, match="'no-act on the ideal track': expected the same 6 episodes"):
        summary_of(flying, on_ideal=other)


def test_flights_are_compared_with_the_same_episodes_only() -> None:
    records = three_planners()
    other = {name: replace(episodes, start=episodes.start + 1) for name, episodes in records.items()}
    with pytest.raises(DataError, match="'no-act on the ideal track': expected the same 9 episodes"):
        summary_of(records, on_ideal=other)


def test_nbv_is_compared_in_pairs_with_every_planner_that_is_not_privileged() -> None:
    records = three_planners()
    records["nbv"] = make_records(4, skill=2.0)
    records["twin"] = records["nbv"]
    summary = summary_of(records)
    assert [(difference.planner, difference.other) for difference in summary.differences] == [
        ("nbv", name) for name in ("no-act", "mine", "twin")
    ]
    to_no_act, _, to_twin = summary.differences
    assert to_no_act.acc_mean == pytest.approx(summary.planner("nbv").acc_mean - summary.planner("no-act").acc_mean)
    assert to_no_act.ci95[0] < to_no_act.acc_mean < to_no_act.ci95[1]
    assert (to_twin.acc_mean, to_twin.ci95) == (0, (0, 0)), "a pair shares its resamples"
    assert "| twin | +0.0 [0.0, 0.0] |" in markdown(*summary.tables())
    assert summary.to_json()["differences"][0]["other"] == "no-act"


def test_without_a_planner_of_interest_all_are_compared_with_a_camera_that_stays() -> None:
    records = three_planners() | {"twin": make_records(3, skill=1.0)}
    (mine, twin) = summary_of(records).differences
    assert [(mine.planner, mine.other), (twin.planner, twin.other)] == [("mine", "no-act"), ("twin", "no-act")]
    del records["no-act"]
    assert summary_of(records).differences == ()


def test_your_own_planner_is_compared_with_every_other() -> None:
    records = three_planners() | {"nbv": make_records(4, skill=2.0)}
    own = PlannerConfig("mine", False, "./mine.py:Mine", source_sha256="0" * 64)
    found = summary_of(records, replace(config_of_run(length=4), planners=(own,))).differences
    assert [(difference.planner, difference.other) for difference in found] == [
        ("mine", "no-act"),
        ("mine", "nbv"),
        ("nbv", "no-act"),
    ]


def full_summary() -> tuple[dict[str, EpisodeRecords], Summary]:
    """Return records, and a summary in which every field has a value: flights, kept accuracy, plans, differences."""
    records = {name: flown(episodes) for name, episodes in three_planners().items()}
    records |= {"nbv/0": flown(make_records(4, skill=2.0)), "nbv/1": flown(make_records(5, skill=2.0))}
    solves = dict.fromkeys(records) | {"nbv/0": Solves({"optimal": 3}, 0), "nbv/1": Solves({"infeasible": 1}, 1)}
    return records, summary_of(records, on_ideal=three_planners(), solves=solves)


@pytest.mark.parametrize("whole", [True, False])
def test_a_summary_read_back_is_the_one_written(tmp_path: Path, whole: bool) -> None:
    records, summary = full_summary() if whole else (three_planners(), summary_of(three_planners()))
    write_records(tmp_path, summary.config, records, summary)
    back = read_summary(tmp_path / SUMMARY, summary.config, records)
    assert back == summary
    assert str(back) == str(summary)
    assert json_text(back.to_json()) == (tmp_path / SUMMARY).read_text()


PLANNERS = "no-act, mine, oracle, nbv"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "expected the JSON of a finished run of ehar benchmark"),
        ("{", "expected the JSON of a finished run of ehar benchmark"),
        ("[]", "expected the JSON object of a finished run of ehar benchmark, got []"),
        (b"\xff", "expected the JSON of a finished run of ehar benchmark"),
        ({"planners": None}, "planners: expected a list, got null"),
        ({"planners": [1]}, "planners[0]: expected an object, got 1"),
        ({"planners": []}, f"expected the planners of the records, {PLANNERS}, got none"),
        ({"episodes": "nine"}, "episodes: expected a whole number, got 'nine'"),
        ({"differences": [{}]}, "differences[0]: missing planner"),
        ({"no_intervals": 3}, "no_intervals: expected text, got 3"),
        ({"basis": {}}, "basis: missing sequences"),
    ],
)
def test_a_damaged_summary_is_named_in_one_line(tmp_path: Path, content: Any, message: str) -> None:
    records, summary = full_summary()
    held = json_text({**summary.to_json(), **content}) if isinstance(content, dict) else content
    assert message in refused(tmp_path / SUMMARY, held, records, summary.config)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "other"}, f"expected the planners of the records, {PLANNERS}, got no-act, mine, oracle, other"),
        ({"name": None}, "planners[3]: name: expected text, got null"),
        ({"acc": {"10": 1.0}}, "planners[3]: acc: missing 30, 50, 70, 90, 100; expected 10, 30, 50, 70, 90, 100"),
        ({"acc_mean": "high"}, "planners[3]: acc_mean: expected a number, got 'high'"),
        ({"acc_mean": float("nan")}, "planners[3]: acc_mean: expected a finite number, got nan"),
        ({"acc_mean_ci95": [1.0]}, "planners[3]: acc_mean_ci95: expected 2 items, got"),
        ({"training_seeds": [0.5]}, "planners[3]: training_seeds[0]: expected a whole number, got 0.5"),
        ({"peak_speed": None}, "planners[3]: flight.peak_speed: expected a number, got null"),
        ({"solves": {"optimal": "all"}}, "planners[3]: solves.counts.optimal: expected a whole number, got 'all'"),
        ({"fallback_share": None}, "planners[3]: solves.fallbacks: expected a whole number, got null"),
        ({"fallback_share": float("nan")}, "planners[3]: solves.fallbacks: expected a whole number, got nan"),
        ({"fallback_share": 1.5}, "planners[3]: solves.fallbacks: expected a whole number, got 1.5"),
        ({"fallback_share": float("inf")}, "planners[3]: solves.fallbacks: expected a whole number, got inf"),
    ],
)
def test_a_damaged_planner_of_a_summary_is_named_in_one_line(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    records, summary = full_summary()
    held = summary.to_json()
    held["planners"][3] |= changes
    assert message in refused(tmp_path / SUMMARY, json.dumps(held), records, summary.config)


def refused(path: Path, content: str | bytes, records: dict[str, EpisodeRecords], config: RunConfig) -> str:
    """Return the one line with which such a file is refused."""
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(DataError) as error:
        read_summary(path, config, records)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)
    return str(error.value)


def test_a_summary_that_is_missing_or_a_folder_is_named(tmp_path: Path) -> None:
    records, summary = full_summary()
    with pytest.raises(
        UsageError, match=r"summary\.json: expected a finished run of ehar benchmark, got: No such file"
    ):
        read_summary(tmp_path / SUMMARY, summary.config, records)
    with pytest.raises(UsageError, match="expected a finished run of ehar benchmark, got: Is a directory"):
        read_summary(tmp_path, summary.config, records)


def test_a_planner_that_did_not_run_is_named_with_those_that_did() -> None:
    with pytest.raises(UsageError, match=r"no planner 'nope' in this run; expected one of: no-act, mine, oracle$"):
        summary_of(three_planners()).planner("nope")


def test_the_lead_is_the_most_accurate_planner_without_the_truth() -> None:
    _, summary = full_summary()
    rivals = {name: summary.planner(name).acc_mean for name in ("mine", "nbv")}
    assert summary.lead == max(rivals, key=lambda name: rivals[name])
    assert summary_of({"no-act": make_records(1)}).lead is None
