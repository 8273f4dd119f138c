"""What a pair of planners differs in, and what is said where a bootstrap has nothing to tell."""

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from scipy.stats import mannwhitneyu, norm, trim_mean
from scipy.stats import t as student

from ehar.data.recordings import UNKNOWN_SUBJECT
from eval.records.episodes import EpisodeRecords
from eval.records.run_files import SUMMARY
from eval.render.figures import draw_accuracy
from eval.render.tables import Rendered, html, markdown
from eval.running.run import write_records
from eval.scores.planner_accuracy import draw_resamples
from eval.scores.resampling.resamples import Basis
from eval.scores.resampling.statistics import BOOTSTRAP_SEED, resample_counts
from eval.scores.resampling.training_seeds import curves, group_planners, seed_counts
from eval.scores.summary import Summary
from eval.studies.overview import difference_table, gap_table, read_overview
from tests.helpers.made_records import CONFIG_OF_RUN, make_records, summary_of


def planners() -> dict[str, EpisodeRecords]:
    """Return two trainings of il-ppo, nbv and no-act on 30 episodes of 15 sequences."""
    skills = {"no-act": 0.0, "nbv": 0.6, "il-ppo/0": 1.0, "il-ppo/1": 1.4, "oracle": 3.0}
    return {name: make_records(row, skill=skill, episodes=30) for row, (name, skill) in enumerate(skills.items())}


def of_one_sequence() -> dict[str, EpisodeRecords]:
    return {name: replace(records, sequence=("only",) * 30) for name, records in planners().items()}


def of_one_class() -> dict[str, EpisodeRecords]:
    zeros = np.zeros(30, dtype=int)
    return {
        name: replace(records, label=zeros, predicted=np.zeros_like(records.predicted))
        for name, records in planners().items()
    }


def test_a_difference_from_the_records_alone() -> None:
    records = planners()
    found = {(difference.planner, difference.other): difference for difference in summary_of(records).differences}
    assert list(found) == [("il-ppo", "no-act"), ("il-ppo", "nbv"), ("nbv", "no-act")]
    trainings = [records["il-ppo/0"].correct, records["il-ppo/1"].correct]
    nbv = records["nbv"].correct
    sequences, clusters = np.unique(records["nbv"].sequence, return_inverse=True)
    difference = found["il-ppo", "nbv"]

    by_sequence = [[correct[clusters == s].mean() for correct in trainings] for s in range(len(sequences))]
    chances = [
        mannwhitneyu(np.round(two, 9), np.round([nbv[clusters == s].mean()], 9)).statistic / 2
        for s, two in enumerate(by_sequence)
    ]
    assert difference.improvement == pytest.approx(np.mean(chances))
    assert (
        difference.improvement_ci95 is not None
        and difference.improvement_ci95[0] < difference.improvement < difference.improvement_ci95[1]
    )

    counts = resample_counts(np.random.default_rng(BOOTSTRAP_SEED), len(sequences))[:, clusters]
    (il_ppo,) = group_planners(name for name in records if name.startswith("il-ppo"))
    resamples = draw_resamples(list(records.values()), [il_ppo])
    draws = seed_counts(il_ppo, resamples)[: resamples.full]
    totals = counts.sum(axis=1)
    drawn = sum(draws[:, row] * (counts @ correct.mean(axis=1)) for row, correct in enumerate(trainings)) / 2
    differ = 100 * (drawn - counts @ nbv.mean(axis=1)) / totals
    # Of the variance between two trainings their draws see the half. The rest is that between sequences.
    between = (100 * np.diff([correct.mean() for correct in trainings]).item()) ** 2 / 4
    seen = differ.var()
    variance = seen - between / 2 + between
    freedom = variance**2 / between**2  # of Satterthwaite: two trainings leave one
    wider = np.sqrt(variance / seen) * student.ppf(0.975, freedom) / norm.ppf(0.975)
    ends = difference.acc_mean + wider * (np.percentile(differ, [2.5, 97.5]) - difference.acc_mean)
    assert difference.ci95 == pytest.approx(ends, rel=0.02)
    # Corrected: the largest distance in standard errors over all three pairs, in each resample.
    no_act = counts @ records["no-act"].correct.mean(axis=1)
    others = [100 * (pair - no_act) / totals for pair in (drawn, counts @ nbv.mean(axis=1))]
    estimates = [found[pair].acc_mean for pair in (("il-ppo", "nbv"), ("il-ppo", "no-act"), ("nbv", "no-act"))]
    largest = np.max([np.abs(r - e) / r.std(ddof=1) for r, e in zip([differ, *others], estimates, strict=True)], axis=0)
    alone, difference = others[1], found["nbv", "no-act"]  # of one training each
    error = alone.std(ddof=1)
    half = np.quantile(largest, 0.95) * error
    assert difference.ci95_corrected == pytest.approx(
        (difference.acc_mean - half, difference.acc_mean + half), rel=1e-3
    )
    assert difference.smallest == pytest.approx(half + 0.841621 * error, rel=1e-3)
    assert difference.p == pytest.approx(2 * norm.sf(abs(difference.acc_mean) / error))
    reached = (largest >= abs(difference.acc_mean) / error - 1e-9).sum()
    assert difference.p_corrected == pytest.approx((1 + reached) / (1 + len(largest)))
    assert difference.is_clear == (difference.p_corrected <= 0.05)


def test_a_planner_s_own_trainings_widen_intervals_as_student_s_t_of_their_number_does() -> None:
    # Every episode is alike, so only trainings vary: il gains 25, 50 and 75 points.
    base = make_records(0, episodes=60, people=6)

    def right(frames: int) -> EpisodeRecords:
        return replace(base, predicted=np.tile(base.label[:, None], 4) + (np.arange(4) >= frames))

    (difference,) = summary_of({"no-act": right(1), **{f"il/{seed}": right(2 + seed) for seed in range(3)}}).differences
    assert (difference.planner, difference.acc_mean) == ("il", pytest.approx(50))
    half = student.ppf(0.975, 2) * 25 / np.sqrt(3)
    assert difference.ci95_corrected is not None
    # Three trainings have seven different means, so a bootstrap of them is coarse, on the safe side.
    assert half <= difference.ci95_corrected[1] - 50 <= 1.3 * half
    assert not difference.is_clear


def test_people_are_resampled_where_the_records_name_them() -> None:
    # Of six people, nbv gets none, 1/4, 1/2, 1/2, 3/4 and all right; no-act gets 1/4 of each.
    frames = np.array([0, 1, 2, 2, 3, 4])[np.arange(60) // 2 % 6]
    base = make_records(0, episodes=60, people=6)
    records = {
        name: replace(base, predicted=base.label[:, None] + (np.arange(4) >= right[:, None]))
        for name, right in (("no-act", np.ones(60)), ("nbv", frames))
    }
    named = summary_of(records)
    unknown = summary_of(
        {name: replace(record, subjects=np.full((60, 1), UNKNOWN_SUBJECT)) for name, record in records.items()}
    )
    assert named.basis == Basis(sequences=30, groups=6, people=6, together=1)
    assert unknown.basis == Basis(sequences=30)
    (difference,), (over_sequences,) = named.differences, unknown.differences
    assert difference.acc_mean == over_sequences.acc_mean == 25
    assert over_sequences.is_clear and over_sequences.ci95_corrected is not None
    assert over_sequences.ci95_corrected == pytest.approx((25 - 11.8, 25 + 11.8), abs=1)
    # Student's t of 6 people: 25 -+ 2.571 x 35.4 / sqrt(6).
    assert not difference.is_clear and difference.ci95_corrected is not None
    assert difference.ci95_corrected == pytest.approx((25 - 37.1, 25 + 37.1), abs=3)
    for summary, said in ((named, "6 people and their 30 sequences"), (unknown, "do not cover other people")):
        assert all(said in "".join((table.notice, *table.footnotes)) for table in summary.tables())


def test_a_table_says_aloud_that_people_are_few() -> None:
    records = {name: make_records(row, skill=row, episodes=40, people=4) for row, name in enumerate(("no-act", "nbv"))}
    tables = summary_of(records).tables()
    said = "Intervals rest on only 4 people, who say little about other people."
    assert [table.notice for table in tables] == [said, said]
    assert f"\n\n**{said}**\n\n" in markdown(*tables) and f'<p class="notice">{said}</p>' in html(tables[0])
    console = Console(width=100, record=True, file=io.StringIO(), force_terminal=True)
    console.print(Rendered(tables[0]))
    assert said in console.export_text()


def test_the_interquartile_mean_counts_each_sequence_and_training_once() -> None:
    records = planners()
    _, clusters = np.unique(records["nbv"].sequence, return_inverse=True)
    agent = summary_of(records).planner("il-ppo")
    scores = [records[f"il-ppo/{seed}"].correct[clusters == s].mean() for seed in (0, 1) for s in range(15)]
    assert agent.acc_iqm == pytest.approx(100 * trim_mean(scores, 0.25))
    assert agent.acc_iqm_ci95 is not None and agent.acc_iqm_ci95[0] < agent.acc_iqm < agent.acc_iqm_ci95[1]


@pytest.mark.parametrize(("records", "reason"), [(of_one_sequence(), "one sequence"), (of_one_class(), "one class")])
def test_intervals_that_cannot_be_had_say_so(records: dict[str, EpisodeRecords], reason: str, tmp_path: Path) -> None:
    summary = summary_of(records)
    write_records(tmp_path, CONFIG_OF_RUN, records, summary)
    written = json.loads((tmp_path / SUMMARY).read_text())
    assert reason in written["no_intervals"]
    for part in (*written["planners"], *written["differences"]):
        absent = [name for name in part if "ci95" in name or name in ("smallest", "p", "p_corrected")]
        assert all(part[name] is None for name in absent)
    assert written["planners"][1]["acc_mean"] == pytest.approx(100 * records["nbv"].correct.mean())
    assert not any(difference.is_clear for difference in summary.differences)
    note = f"[-] No intervals: {summary.no_intervals}."
    of_planners, table = summary.tables()
    assert note in of_planners.footnotes
    assert note in table.footnotes and not table.bold
    assert table.rows[0][1].endswith(" [-]") and not [line for line in table.footnotes if "Smallest" in line]
    text = markdown(*summary.tables())
    assert f"{summary.planner('nbv').acc_mean:.1f} [-] |" in text
    assert "nan" not in text and "None" not in text
    Console(width=100, file=io.StringIO()).print(Rendered(*summary.tables()))
    draw_accuracy(curves(records), {"oracle"}, 3, CONFIG_OF_RUN.title, tmp_path / "accuracy")

    run = read_overview([tmp_path])
    assert any(reason in line for line in gap_table(run).footnotes)
    pairs = difference_table(run, "no-act")
    assert pairs.rows[0][1].endswith(" [-]") and not pairs.bold
    assert any(reason in line for line in pairs.footnotes)


def test_one_class_in_the_test_part_is_enough_where_planners_err() -> None:
    records = {name: replace(record, label=np.zeros(30, dtype=int)) for name, record in planners().items()}
    assert summary_of(records).no_intervals is None


def test_the_table_says_how_small_a_difference_would_show() -> None:
    summary = summary_of(planners())
    sizes = sorted(difference.smallest for difference in summary.differences if difference.smallest is not None)
    assert len(sizes) == 3
    expected = f"8 times in 10: {sizes[0]:.1f} to {sizes[-1]:.1f} points, depending on the pair."
    assert last_footnote(summary).endswith(expected)
    one = replace(summary, differences=summary.differences[:1])
    assert last_footnote(one).endswith(f"8 times in 10: {summary.differences[0].smallest:.1f} points.")


def last_footnote(summary: Summary) -> str:
    _, table = summary.tables()
    return table.footnotes[-1]
