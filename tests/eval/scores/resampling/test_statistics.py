import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm
from scipy.stats import t as student

from eval.scores.metrics import gap_closed
from eval.scores.resampling.statistics import (
    Variance,
    Widening,
    interval,
    pair,
    resample_counts,
    resampled_means,
    simultaneous,
    two_stage_counts,
    why_no_intervals,
    widening,
)


def test_every_resample_draws_as_many_clusters_as_there_are() -> None:
    counts = resample_counts(np.random.default_rng(0), 7, 200)
    assert counts.shape == (200, 7)
    assert (counts.sum(axis=1) == 7).all()
    np.testing.assert_allclose(counts.mean(axis=0), 1, atol=0.25)


def test_means_weigh_clusters_by_their_episodes() -> None:
    values, clusters = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 2.0]]), np.array([0, 0, 1])
    counts = np.array([[1, 1], [2, 0], [0, 2]])
    np.testing.assert_allclose(resampled_means(values, clusters, counts), [[1 / 3, 1 / 2, 0], [1, 1 / 2, 2]])


@given(seed=st.integers(0, 1000), clusters=st.integers(1, 6))
def test_means_equal_those_of_the_episodes_repeated(seed: int, clusters: int) -> None:
    rng = np.random.default_rng(seed)
    cluster = np.concatenate([np.arange(clusters), rng.integers(0, clusters, 5)])
    values = rng.random(len(cluster))
    counts = resample_counts(rng, clusters, 4)
    expected = [np.repeat(values, row[cluster]).mean() for row in counts]
    np.testing.assert_allclose(resampled_means(values, cluster, counts), expected)


def test_intervals_cover_the_true_mean_about_95_times_in_100() -> None:
    rng = np.random.default_rng(1)
    covered = 0
    for _ in range(200):
        # 40 sequences of 3 windows that share most of their luck.
        values = np.repeat(rng.normal(size=40), 3) + 0.1 * rng.normal(size=120)
        counts = resample_counts(rng, 40, 500)
        low, high = interval(resampled_means(values, np.repeat(np.arange(40), 3), counts))
        covered += bool(low <= 0 <= high)
    assert 178 <= covered <= 199


def test_an_interval_leaves_out_as_much_at_each_end() -> None:
    np.testing.assert_allclose(interval(np.arange(1001.0)), [25, 975])
    np.testing.assert_allclose(interval(np.append(np.arange(1001.0), np.nan)), [25, 975])


def test_planners_are_compared_on_the_same_resamples() -> None:
    rng = np.random.default_rng(2)
    hard = rng.random(50)
    resampled = resampled_means(np.stack([hard, hard + 0.1]), np.arange(50), resample_counts(rng, 50, 500))
    np.testing.assert_allclose(interval(resampled[1] - resampled[0]), [0.1, 0.1])
    assert np.diff(interval(resampled[0])) > 0.1


def test_resamples_without_a_gap_are_left_out_of_its_interval() -> None:
    no_act, oracle = np.array([0.5, 0.5, 0.5]), np.array([0.6, 0.5, 0.7])
    ends = interval(gap_closed(np.array([[0.55, 0.9, 0.6], [0.5, 0.5, 0.5]]), no_act, oracle))
    np.testing.assert_allclose(ends, [[0.5, 0.5], [0, 0]])
    assert np.isnan(interval(gap_closed(oracle, no_act, no_act))).all()


def many_units(pairs: int) -> Widening:
    return Widening(np.ones(pairs), np.full(pairs, np.inf))


def test_people_are_drawn_first_and_their_sequences_within_them() -> None:
    groups = np.array([0, 1, 1, 1, 0, 2])
    counts = two_stage_counts(np.random.default_rng(0), groups, 40_000)
    of_group = np.stack([counts[:, groups == group].sum(axis=1) for group in range(3)], axis=1)
    # A group that is drawn k times gives k times as many sequences as it has.
    times = of_group / [2, 3, 1]
    assert (times == times.round()).all() and (times.sum(axis=1) == 3).all()
    np.testing.assert_allclose(times.var(axis=0), 3 * 1 / 3 * 2 / 3, atol=0.05)
    # Given that, each of its sequences is as likely as the others, and they are drawn with replacement.
    twice = counts[times[:, 1] == 2][:, groups == 1]
    np.testing.assert_allclose(twice.mean(axis=0), 2, atol=0.05)
    np.testing.assert_allclose(twice.var(axis=0), 6 * 1 / 3 * 2 / 3, atol=0.05)


def test_few_units_widen_an_interval_as_student_s_t_does() -> None:
    # All variance lies between 4 people: the bootstrap's is 3/4 of the true one, and has 3 degrees of freedom.
    total = np.array([2.0, 2.0])
    wide = widening(total, [Variance(np.array([2.0, 0.0]), 4)])
    np.testing.assert_allclose(wide.factor, [np.sqrt(4 / 3), 1])
    np.testing.assert_allclose(wide.freedom, [3, np.inf])
    np.testing.assert_allclose(wide.of_interval, [np.sqrt(4 / 3) * student.ppf(0.975, 3) / norm.ppf(0.975), 1])
    # By hand: 1 of 2 lies between 5 people, half as much between 3 trainings; (5/4 + 3/4 + 1/2)^2 / (25/64 + 9/32).
    mixed = widening(np.array([2.0]), [Variance(np.array([1.0]), 5), Variance(np.array([0.5]), 3)])
    assert mixed.factor == pytest.approx(np.sqrt(2.5 / 2))
    assert mixed.freedom == pytest.approx(2.5**2 / (25 / 64 + 9 / 32))
    assert widening(np.zeros(1), [Variance(np.zeros(1), 3)]).of_interval == pytest.approx(1)


def test_one_difference_alone_needs_no_correction_for_others() -> None:
    resampled = np.random.default_rng(3).normal(2, 1, size=(1, 10_000))
    found = simultaneous(np.array([2.0]), resampled, many_units(1))
    np.testing.assert_allclose(found.ends, [[2 - 1.96, 2 + 1.96]], atol=0.08)
    np.testing.assert_allclose([found.p, found.p_alone], 2 * norm.sf(2), atol=0.006)
    np.testing.assert_allclose(found.smallest, 2.80, atol=0.08)


def test_independent_differences_are_corrected_for_their_number_and_equal_ones_not_at_all() -> None:
    rng = np.random.default_rng(4)
    apart = simultaneous(np.zeros(8), rng.normal(size=(8, 20_000)), many_units(8))
    critical = norm.isf((1 - 0.95 ** (1 / 8)) / 2)  # Sidak's, exact where they are independent
    np.testing.assert_allclose(apart.ends[:, 1], critical, atol=0.06)
    same = simultaneous(np.zeros(8), np.repeat(rng.normal(size=(1, 20_000)), 8, axis=0), many_units(8))
    np.testing.assert_allclose(same.ends[:, 1], norm.isf(0.025), atol=0.06)


@given(seed=st.integers(0, 1000), freedom=st.sampled_from([1.5, 4.0, np.inf]))
def test_a_corrected_interval_excludes_zero_where_its_p_value_is_below_5_percent(seed: int, freedom: float) -> None:
    rng = np.random.default_rng(seed)
    estimates = rng.normal(0, 3, size=5)
    wider = Widening(rng.uniform(1, 1.2, 5), np.full(5, freedom))
    found = simultaneous(estimates, estimates[:, None] + rng.normal(size=(5, 999)), wider)
    excludes = (found.ends[:, 0] > 0) | (found.ends[:, 1] < 0)
    assert (excludes == (found.p <= 0.05)).all()
    assert (found.p >= found.p_alone).all()


@pytest.mark.parametrize("people", [2, 3, 4])
@pytest.mark.parametrize("pairs", [1, 3])
def test_a_correction_never_makes_an_interval_narrower_where_people_are_few(people: int, pairs: int) -> None:
    rng = np.random.default_rng(people)
    values = rng.normal(size=(pairs, people))
    counts = resample_counts(rng, people)
    resampled = values @ counts.T / people
    error = resampled.std(axis=1, ddof=1)
    wider = Widening(np.full(pairs, np.sqrt(people / (people - 1))), np.full(pairs, people - 1.0))
    found = simultaneous(values.mean(axis=1), resampled, wider)
    alone = wider.factor * error * student.ppf(0.975, people - 1)
    assert (np.ptp(found.ends, axis=1) / 2 >= alone * (1 - 1e-9)).all()
    assert (found.p >= found.p_alone).all()


def test_differences_that_never_vary_are_certain_and_take_no_part_in_the_correction() -> None:
    rng = np.random.default_rng(5)
    resampled = np.stack([np.zeros(5000), np.full(5000, 3.0), rng.normal(1, 1, 5000)])
    found = simultaneous(np.array([0.0, 3.0, 1.0]), resampled, many_units(3))
    assert found.ends[:2].tolist() == [[0, 0], [3, 3]]
    assert found.p[:2].tolist() == found.p_alone[:2].tolist() == [1, 0]
    assert np.isnan(found.smallest[:2]).all()
    np.testing.assert_allclose(found.ends[2], [1 - 1.96, 1 + 1.96], atol=0.1)


def test_a_difference_of_the_smallest_size_shows_8_times_in_10() -> None:
    rng = np.random.default_rng(6)
    true = 2.8016 / np.sqrt(60)  # (1.9600 + 0.8416) standard errors, sequences as different as sd 1
    shown, smallest = 0, []
    for _ in range(300):
        values = true + rng.normal(size=60)
        resampled = resampled_means(values, np.arange(60), resample_counts(rng, 60, 400))
        found = simultaneous(values.mean(keepdims=True), resampled[None], many_units(1))
        shown += bool(found.ends[0, 0] > 0)
        smallest.append(found.smallest[0])
    assert 0.72 < shown / 300 < 0.88
    assert np.mean(smallest) == pytest.approx(true, rel=0.03)


def test_without_resamples_there_is_no_interval() -> None:
    ends = interval(np.empty((3, 0)))
    assert ends.shape == (3, 2)
    assert np.isnan(ends).all()
    assert pair(ends[0]) is None
    assert pair(np.array([1.0, 2.0])) == (1.0, 2.0)


def test_one_sequence_or_one_class_has_no_intervals() -> None:
    assert why_no_intervals(2, 2) is None
    assert "one sequence" in str(why_no_intervals(1, 2))
    assert "one class" in str(why_no_intervals(2, 1))
