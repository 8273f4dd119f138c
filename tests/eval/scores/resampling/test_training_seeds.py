import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from ehar.errors import DataError
from eval.records.episodes import EpisodeRecords
from eval.records.solves import Solves
from eval.render.figures import draw_accuracy
from eval.render.tables import Rendered, markdown
from eval.scores.differences import SUBJECTS, Difference
from eval.scores.metrics import ece, gap_closed, mean_acc, nll, path_length
from eval.scores.planner_accuracy import draw_resamples
from eval.scores.resampling.resamples import Basis, Resamples
from eval.scores.resampling.statistics import resample_counts, resampled_means
from eval.scores.resampling.training_seeds import (
    PlannerGroup,
    curves,
    families,
    group_planners,
    mean_over_seeds,
    record_name,
    resample_seeds,
    seed_counts,
    shared_record_name,
    split_record_name,
)
from eval.scores.summarise import summarise
from tests.helpers.made_records import CONFIG_OF_RUN, flown, make_records, summary_of


def with_correct(correct: list[list[int]]) -> EpisodeRecords:
    """Return records of as many sequences of one episode each as there are rows, right where a 1 stands."""
    base = make_records(0, episodes=len(correct), length=len(correct[0]))
    return replace(
        base,
        sequence=tuple(f"sequence {index}" for index in range(len(correct))),
        predicted=np.where(np.array(correct, dtype=bool), base.label[:, None], base.label[:, None] + 1),
    )


def trained(*seeds: int, name: str = "il-ppo", skill: float = 1.0) -> dict[str, EpisodeRecords]:
    return {record_name(name, seed): make_records(10 + seed, skill=skill + 0.3 * seed) for seed in seeds}


def drawn(counts: np.ndarray, clusters: np.ndarray, groups: Sequence[PlannerGroup]) -> Resamples:
    return Resamples(clusters, counts, (), Basis(counts.shape[1]), None).with_trainings(families(groups))


def ends() -> dict[str, EpisodeRecords]:
    return {"no-act": make_records(1), "oracle": make_records(3, skill=4.0)}


def test_record_names_are_a_name_and_a_seed() -> None:
    assert record_name("il-ppo", 12) == "il-ppo/12"
    for name in ("il-ppo", "il-ppo/", "/1", "il-ppo/x", "il-ppo/-1", "il-ppo/01", "il-ppo/1.0", "il-ppo/1\n"):
        assert split_record_name(name) == (name, None)
    assert split_record_name("il-ppo/0") == ("il-ppo", 0)
    assert split_record_name("a/b/10") == ("a/b", 10)
    assert shared_record_name("nbv", 2) == "nbv@2" and split_record_name("nbv@2") == ("nbv", 2)
    assert split_record_name("il/0@1") == ("il/0", 1)


def test_seeds_of_a_planner_are_grouped_in_ascending_order_where_the_first_appears() -> None:
    groups = group_planners(["no-act", "il-ppo/10", "il/0", "il-ppo/9"])
    assert [(group.name, group.seeds, group.rows) for group in groups] == [
        ("no-act", (), (0,)),
        ("il-ppo", (9, 10), (3, 1)),
        ("il", (0,), (2,)),
    ]
    assert groups[1].records == ("il-ppo/9", "il-ppo/10")


def test_a_planner_with_and_without_seed_is_refused() -> None:
    with pytest.raises(DataError, match=r"'il': expected every record name with a training seed.*got il/0, il"):
        group_planners(["il/0", "no-act", "il"])


def test_two_seeds_and_three_sequences_by_hand() -> None:
    records = {
        "no-act": with_correct([[0, 0], [0, 0], [0, 1]]),
        "il-ppo/0": with_correct([[1, 1], [0, 1], [0, 0]]),
        "il-ppo/1": with_correct([[1, 1], [1, 1], [0, 1]]),
        "oracle": with_correct([[1, 1], [1, 1], [1, 1]]),
    }
    summary = summary_of(records)
    assert [planner.name for planner in summary.planners] == ["no-act", "il-ppo", "oracle"]
    agent = summary.planner("il-ppo")
    # Seed 0 is right in 3 of 6 frames, seed 1 in 5 of 6.
    assert agent.training_seeds == (0, 1)
    assert agent.acc_mean == pytest.approx(100 * 4 / 6)
    assert agent.acc_mean_seed_sd == pytest.approx(100 * (2 / 6) / np.sqrt(2))
    assert agent.acc["10"] == pytest.approx(50)  # first frame: 1 and 2 of 3
    assert agent.acc["100"] == pytest.approx(100 * 5 / 6)
    assert agent.gap_closed == pytest.approx((4 / 6 - 1 / 6) / (1 - 1 / 6))
    assert agent.acc_mean_ci95 is not None and agent.acc_mean_ci95[0] < 100 / 6 and agent.acc_mean_ci95[1] == 100
    assert (summary.planner("no-act").training_seeds, summary.planner("no-act").acc_mean_seed_sd) == ((), None)
    assert summary.to_json()["planners"][1]["training_seeds"] == (0, 1)


def test_the_nested_bootstrap_equals_a_slow_loop_over_the_same_draws() -> None:
    names = ["il/4", "no-act", "il-ppo/0", "il-ppo/1", "il-ppo/2", "il/1"]
    rng = np.random.default_rng(5)
    clusters = np.array([0, 0, 1, 2, 2, 2, 3])
    values = rng.random((len(names), len(clusters)))
    counts = resample_counts(rng, 4, 60)
    groups = group_planners(names)
    resamples = drawn(counts, clusters, groups)
    fast = resample_seeds(resampled_means(values, clusters, resamples.counts), groups, resamples)
    assert [group.name for group in groups] == ["il", "no-act", "il-ppo"]
    rows = {"il": [5, 0], "no-act": [1], "il-ppo": [2, 3, 4]}  # in ascending order of seeds
    for index, trainings in enumerate(rows.values()):
        draws = seed_counts(groups[index], resamples)
        for resample in range(60):
            pooled = []
            for training, times in zip(trainings, draws[resample], strict=True):
                for _ in range(times):
                    for sequence in range(4):
                        for _ in range(counts[resample, sequence]):
                            pooled += [values[training, e] for e in range(7) if clusters[e] == sequence]
            assert fast[index, resample] == pytest.approx(np.mean(pooled), abs=1e-12)


def test_the_interval_of_the_summary_is_that_of_the_slow_loop() -> None:
    records = {**ends(), **trained(0, 1, 2)}
    agent = summary_of(records).planner("il-ppo")
    groups = group_planners(records)
    resamples = draw_resamples(list(records.values()), groups)
    draws = seed_counts(groups[-1], resamples)
    accuracy = {name: mean_acc(episodes.correct) for name, episodes in records.items()}
    rows = len(resamples.counts)
    acc, closed, linear = np.empty((3, rows))
    assert agent.gap_closed is not None and agent.gap_closed_ci95 is not None
    for row in range(rows):
        weights = resamples.counts[row][resamples.clusters]
        low, high, *seeds = (
            np.average(accuracy[name], weights=weights)
            for name in ("no-act", "oracle", "il-ppo/0", "il-ppo/1", "il-ppo/2")
        )
        acc[row] = np.average(seeds, weights=draws[row])
        closed[row] = gap_closed(acc[row], low, high)
        linear[row] = acc[row] - low - agent.gap_closed * (high - low)
    np.testing.assert_allclose(agent.acc_mean_ci95, 100 * resamples.interval(agent.acc_mean / 100, acc))
    np.testing.assert_allclose(agent.gap_closed_ci95, resamples.interval(agent.gap_closed, closed, linear=linear))


def test_draws_of_seeds_are_fair_and_independent_between_planners() -> None:
    il, ppo = group_planners([record_name(name, seed) for name in ("il", "ppo") for seed in range(5)])
    resamples = drawn(np.ones((4000, 2), dtype=np.int64), np.arange(2), (il, ppo))
    one, other = (seed_counts(group, resamples)[: resamples.full] for group in (il, ppo))
    assert (one.sum(axis=1) == 5).all()
    np.testing.assert_allclose(one.mean(axis=0), 1, atol=0.05)
    np.testing.assert_allclose(one.var(axis=0), 0.8, atol=0.1)  # of a binomial, 5 draws of chance 1 / 5
    assert abs(np.corrcoef(one[:, 0], other[:, 0])[0, 1]) < 0.05
    alone = drawn(np.ones((4000, 2), dtype=np.int64), np.arange(2), (il,))
    np.testing.assert_array_equal(one, seed_counts(il, alone)[: alone.full])  # whoever else is in the run


def test_trainings_that_planners_share_are_drawn_together() -> None:
    names = [shared_record_name(name, training) for name in ("no-act", "nbv") for training in range(3)]
    no_act, nbv, il = group_planners([*names, "il/0", "il/1", "il/2"])
    resamples = drawn(np.ones((4000, 2), dtype=np.int64), np.arange(2), (no_act, nbv, il))
    assert (no_act.family, nbv.name, nbv.seeds, il.family) == ("@", "nbv", (0, 1, 2), "il")
    assert families((no_act, nbv, il)) == {"@": 3, "il": 3}
    assert families(group_planners(["nbv@0", "no-act"])) == {}  # a single one is not drawn
    np.testing.assert_array_equal(seed_counts(no_act, resamples), seed_counts(nbv, resamples))
    np.testing.assert_allclose(seed_counts(nbv, resamples)[:4000].var(axis=0), 2 / 3, atol=0.05)
    # A planner's own trainings are drawn by themselves, and each family has rows in which only it is drawn.
    own, shared = seed_counts(il, resamples), seed_counts(nbv, resamples)
    assert abs(np.corrcoef(own[:4000, 0], shared[:4000, 0])[0, 1]) < 0.05
    of_shared, of_own = resamples.alone
    assert (own[of_shared.rows] == 1).all() and (shared[of_shared.rows] != 1).any()
    assert (shared[of_own.rows] == 1).all() and (own[of_own.rows] != 1).any()


def test_the_gap_of_shared_trainings_reaches_up_to_the_oracle_of_each() -> None:
    shared = {
        shared_record_name(name, training): make_records(10 * row + training, skill=skill)
        for row, (name, skill) in enumerate({"no-act": 0.0, "nbv": 1.0, "oracle": 3.0}.items())
        for training in range(2)
    }
    summary = summarise(
        shared,
        CONFIG_OF_RUN,
        privileged={name: "oracle" in name for name in shared},
        step_ms=dict.fromkeys(shared, 0.0),
    )
    low, own, high = (
        np.mean([shared[shared_record_name(name, training)].correct.mean() for training in range(2)])
        for name in ("no-act", "nbv", "oracle")
    )
    assert summary.planner("nbv").gap_closed == pytest.approx((own - low) / (high - low))
    assert summary.planner("oracle").gap_closed == pytest.approx(1)


def test_seeds_widen_the_interval() -> None:
    # Two trainings, one always right and one never: sequences cannot tell, seeds can.
    records = {"il/0": with_correct([[1, 1]] * 4), "il/1": with_correct([[0, 0]] * 4)}
    assert summary_of(records).planner("il").acc_mean_ci95 == (0, 100)


@given(copies=st.integers(2, 6))
def test_seeds_that_are_identical_give_what_one_gives(copies: int) -> None:
    resampled = np.random.default_rng(0).random((1, 200))
    groups = group_planners([record_name("il", seed) for seed in range(copies)])
    resamples = drawn(np.ones((200, 2), dtype=np.int64), np.arange(2), groups)
    several = np.repeat(resampled, copies, axis=0)
    rows = np.pad(several, ((0, 0), (0, len(resamples.counts) - 200)), mode="edge")
    np.testing.assert_allclose(resample_seeds(rows, groups, resamples)[:, :200], resampled, rtol=1e-12)


def test_a_summary_of_identical_seeds_is_that_of_one() -> None:
    same = make_records(4, skill=1.5)
    one = summary_of({**ends(), "il-ppo": same})
    three = summary_of({**ends(), **{record_name("il-ppo", seed): same for seed in range(3)}})
    single, several = one.planner("il-ppo"), three.planner("il-ppo")
    assert several.acc_mean_seed_sd == pytest.approx(0, abs=1e-12)
    for field in ("acc", "acc_mean", "acc_mean_ci95", "gap_closed", "gap_closed_ci95", "metrics"):
        assert getattr(several, field) == pytest.approx(getattr(single, field), rel=1e-12)
    for before, after in zip(one.differences, three.differences, strict=True):
        assert after.ci95 == pytest.approx(before.ci95, rel=1e-9, abs=1e-9)


def test_one_seed_gives_the_numbers_of_a_planner_without() -> None:
    records = {**ends(), "other": make_records(7)}
    plain = summary_of({**records, "il-ppo": make_records(4)}).to_json()
    seeded = summary_of({**records, "il-ppo/7": make_records(4)}).to_json()
    agent = seeded["planners"][3]
    assert (agent["training_seeds"], agent["acc_mean_seed_sd"]) == ((7,), None)
    agent["training_seeds"] = ()
    assert seeded == plain


def test_the_order_of_seeds_and_who_else_runs_do_not_matter() -> None:
    forward, backward = summary_of({**ends(), **trained(0, 1, 2)}), summary_of({**ends(), **trained(2, 0, 1)})
    assert forward == backward
    more = summary_of({**trained(0, 1, name="il"), **ends(), **trained(0, 1, 2)})
    assert more.planner("il-ppo") == forward.planner("il-ppo")


def test_other_numbers_are_means_over_seeds() -> None:
    agents = {
        name: flown(replace(episodes, viewpoint=episodes.viewpoint * (1 + index / 10)), seed=index)
        for index, (name, episodes) in enumerate(trained(0, 1).items())
    }
    solves = [Solves({"optimal": 3}, 0), Solves({"optimal": 1, "infeasible": 2}, 2)]
    summary = summary_of(
        {"no-act": flown(make_records(1)), **agents},
        solves={"no-act": None, **dict(zip(agents, solves, strict=True))},
    )
    agent, pair = summary.planner("il-ppo"), list(agents.values())
    assert agent.metrics["nll"] == pytest.approx(np.mean([nll(record.true_probability) for record in pair]))
    assert agent.metrics["ece"] == pytest.approx(
        np.mean([ece(record.top_probability, record.correct) for record in pair])
    )
    assert agent.metrics["path_length_m"] == pytest.approx(
        np.mean([path_length(record.viewpoint).mean() for record in pair])
    )
    flights = [record.flight for record in pair if record.flight is not None]
    assert agent.flight is not None
    assert agent.flight.peak_speed == max(flight.peak_speed.max() for flight in flights)
    assert agent.flight.effort == pytest.approx(np.mean([flight.effort for flight in flights]))
    assert agent.solves == Solves({"infeasible": 2, "optimal": 4}, 2)
    assert summary.planner("no-act").solves is None


def test_planning_time_is_the_mean_over_seeds() -> None:
    records = {"no-act": make_records(1), **trained(0, 1)}
    summary = summarise(
        records,
        CONFIG_OF_RUN,
        privileged=dict.fromkeys(records, False),
        step_ms={"no-act": 0.0, "il-ppo/0": 1.0, "il-ppo/1": 4.0},
    )
    assert summary.planner("il-ppo").step_ms == 2.5


def test_accuracy_kept_compares_each_training_with_itself() -> None:
    on_ideal = {"no-act": make_records(1), **trained(0, 1, 2, skill=2.0)}
    # What flies is what flew on the ideal track: all is kept, whichever seeds are drawn.
    same = summary_of({"no-act": on_ideal["no-act"], **trained(0, 1, 2, skill=2.0)}, on_ideal=on_ideal)
    assert same.planner("il-ppo").accuracy_kept == pytest.approx(1)
    assert same.planner("il-ppo").accuracy_kept_ci95 == pytest.approx((1, 1))
    # Fewer seeds may fly than were run on the ideal track, where only those count.
    flying = trained(0, 1, skill=1.0)
    kept = summary_of({"no-act": on_ideal["no-act"], **flying}, on_ideal=on_ideal).planner("il-ppo").accuracy_kept
    low = on_ideal["no-act"].correct.mean()
    flew, ideal = (np.mean([runs[name].correct.mean() for name in flying]) for runs in (flying, on_ideal))
    assert kept == pytest.approx((flew - low) / (ideal - low))
    # One that was not run there leaves nothing to compare with.
    del on_ideal["il-ppo/1"]
    unknown = summary_of({"no-act": on_ideal["no-act"], **flying}, on_ideal=on_ideal).planner("il-ppo")
    assert (unknown.accuracy_kept, unknown.accuracy_kept_ci95) == (None, None)


def all_subjects() -> dict[str, EpisodeRecords]:
    """Return a run of every subject, listed in another order than theirs, beside others."""
    records = {**ends(), "ppo/0": make_records(5), "towards": make_records(6)}
    return {**records, "nbv": make_records(7, skill=2.0), **trained(0, 1, name="il"), **trained(0, 1, 2, skill=3.0)}


def test_subjects_are_compared_with_all_others_each_pair_once() -> None:
    summary = summary_of(all_subjects())
    pairs = [(difference.planner, difference.other) for difference in summary.differences]
    assert SUBJECTS == ("il-ppo", "dagger", "nbv", "il", "ppo")
    assert pairs == [
        *(("il-ppo", other) for other in ("no-act", "ppo", "towards", "nbv", "il")),
        *(("nbv", other) for other in ("no-act", "ppo", "towards", "il")),
        *(("il", other) for other in ("no-act", "ppo", "towards")),
        *(("ppo", other) for other in ("no-act", "towards")),
    ]
    for difference in summary.differences:
        expected = summary.planner(difference.planner).acc_mean - summary.planner(difference.other).acc_mean
        assert difference.acc_mean == pytest.approx(expected)
        assert difference.ci95[0] <= difference.acc_mean <= difference.ci95[1]
        assert difference.ci95_corrected[1] - difference.ci95_corrected[0] > difference.ci95[1] - difference.ci95[0]


def cell_of(difference: Difference) -> str:
    assert difference.ci95_corrected is not None
    return f"{difference.acc_mean:+.1f} [{difference.ci95_corrected[0]:.1f}, {difference.ci95_corrected[1]:.1f}]"


def test_differences_are_a_matrix_with_clear_ones_in_bold() -> None:
    summary = summary_of(all_subjects())
    _, table = summary.tables()
    assert table.header == ("planner", "il-ppo", "nbv", "il", "ppo")
    assert [row[0] for row in table.rows] == ["no-act", "ppo", "towards", "nbv", "il"]
    cells = {(row[0], column): cell for row in table.rows for column, cell in zip(table.header, row, strict=True)}
    blank = {where for where, cell in cells.items() if not cell}
    assert blank == {("ppo", "ppo"), ("nbv", "nbv"), ("nbv", "il"), ("nbv", "ppo"), ("il", "il"), ("il", "ppo")}
    difference = next(
        difference
        for difference in summary.differences
        if (difference.planner, difference.other) == ("il-ppo", "no-act")
    )
    assert difference.is_clear
    assert cells["no-act", "il-ppo"] == cell_of(difference)
    clear = {
        (difference.other, difference.planner)
        for difference in summary.differences
        if difference.ci95_corrected[0] > 0 or difference.ci95_corrected[1] < 0
    }
    assert {(table.rows[row][0], table.header[column]) for row, column in table.bold} == clear
    assert 0 < len(clear) < len(summary.differences)
    text = markdown(table)
    assert text.count("| **") == len(clear)
    assert f"| **{cells['no-act', 'il-ppo']}** |" in text
    assert max(map(len, text.splitlines())) <= 160


def test_the_terminal_prints_clear_differences_in_bold() -> None:
    summary = summary_of(all_subjects())
    console = Console(width=160, record=True, file=io.StringIO(), force_terminal=True)
    console.print(Rendered(*summary.tables()))
    styled = console.export_text(styles=True)
    found = {(difference.planner, difference.other): difference for difference in summary.differences}
    for pair in (("il-ppo", "no-act"), ("ppo", "towards")):
        assert (f"\x1b[1m{cell_of(found[pair])}" in styled) == found[pair].is_clear
    assert {found["il-ppo", "no-act"].is_clear, found["ppo", "towards"].is_clear} == {True, False}


def test_the_table_says_how_far_seeds_lie_apart_and_how_many_there_are() -> None:
    summary = summary_of(all_subjects())
    table = summary.tables()[0]
    cells = {row[0]: row[table.header.index("mean acc [95 %]")] for row in table.rows}
    agent = summary.planner("il-ppo")
    assert agent.acc_mean_seed_sd is not None
    assert cells["il-ppo"].startswith(f"{agent.acc_mean:.1f} ± {agent.acc_mean_seed_sd:.1f} [")
    assert "±" not in cells["ppo"] + cells["nbv"]
    assert table.footnotes[0].startswith("Training seeds: il 2, il-ppo 3. ")
    assert table.footnotes[1].startswith("One training seed: ppo (0); ")
    assert not [note for note in summary_of(ends()).tables()[0].footnotes if "seed" in note]


def test_curves_are_means_over_seeds() -> None:
    records = {
        "no-act": with_correct([[0, 1], [0, 0]]),
        "il/0": with_correct([[1, 1], [0, 1]]),
        "il/1": with_correct([[0, 1], [0, 0]]),
    }
    drawn = curves(records)
    assert list(drawn) == ["no-act", "il"]
    np.testing.assert_allclose(drawn["no-act"], [0, 0.5])
    np.testing.assert_allclose(drawn["il"], [0.25, 0.75])


def test_the_figure_has_one_curve_a_planner(tmp_path: Path) -> None:
    records = all_subjects()
    draw_accuracy(curves(records), {"oracle"}, 3, CONFIG_OF_RUN.title, tmp_path / "accuracy")
    drawn = (tmp_path / "accuracy.svg").read_text()
    assert "il-ppo" in drawn
    assert "il-ppo/" not in drawn


def test_means_over_seeds_keep_further_axes() -> None:
    values = np.arange(12.0).reshape(3, 4)
    means = mean_over_seeds(values, group_planners(["il/1", "nbv", "il/0"]))
    np.testing.assert_allclose(means, [values[[0, 2]].mean(axis=0), values[1]])
