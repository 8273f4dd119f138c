import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from eval.metrics import gap_closed
from eval.statistics import interval, resample_counts, resampled_means


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
