import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eval.scores.metrics import gap_closed
from eval.scores.statistics import (
    interval,
    pair,
    resample_counts,
    resampled_means,
    smallest_difference,
    why_no_intervals,
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


def test_a_difference_of_the_smallest_size_shows_8_times_in_10() -> None:
    rng = np.random.default_rng(6)
    true = 2.8016 / np.sqrt(60)  # (1.9600 + 0.8416) standard errors, sequences as different as sd 1
    shown, smallest = 0, []
    for _ in range(300):
        values = true + rng.normal(size=60)
        resampled = resampled_means(values, np.arange(60), resample_counts(rng, 60, 400))
        shown += bool(interval(resampled)[0] > 0)
        smallest.append(smallest_difference(resampled))
    assert 0.72 < shown / 300 < 0.88
    assert np.mean(np.array(smallest, dtype=float)) == pytest.approx(true, rel=0.03)


def test_the_smallest_difference_is_unknown_where_nothing_varies() -> None:
    assert smallest_difference(np.full(5, 0.1)) is None
    assert smallest_difference(np.array([])) is None
    assert smallest_difference(np.array([-1.0, 1.0])) == pytest.approx(2.8015852 * np.sqrt(2))


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
