import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import mannwhitneyu, trim_mean

from ehar.arrays import IntArray
from eval.scores.resampling.statistics import resample_counts, two_stage_counts
from eval.scores.sequence_scores import (
    accuracy_by_sequence,
    interquartile_mean,
    probability_of_improvement,
    resampled_improvements,
    resampled_interquartile_means,
    wins,
)


def test_the_accuracy_of_a_sequence_is_over_all_its_episodes_and_frames() -> None:
    correct = np.array([[1, 1], [0, 0], [0, 1], [1, 1]], dtype=bool)
    np.testing.assert_allclose(accuracy_by_sequence(correct, np.array([1, 0, 1, 1])), [0, 5 / 6])


def test_equally_many_right_answers_are_a_tie_whichever_they_are() -> None:
    # 1/7 + 2/7 + 3/7 is not 6/7 + 0 + 0 in floating point.
    one = np.arange(7) < np.array([1, 2, 3])[:, None]
    other = np.arange(7) < np.array([6, 0, 0])[:, None]
    scores = [accuracy_by_sequence(correct, np.zeros(3, dtype=int))[None] for correct in (one, other)]
    assert probability_of_improvement(wins(*scores)) == 0.5


@given(seed=st.integers(0, 500), trainings=st.integers(1, 4), sequences=st.integers(1, 9))
def test_the_interquartile_mean_is_scipy_s_trimmed_mean(seed: int, trainings: int, sequences: int) -> None:
    scores = np.random.default_rng(seed).integers(0, 4, (trainings, sequences)) / 3
    assert interquartile_mean(scores) == pytest.approx(trim_mean(scores.ravel(), 0.25))


def counts_of(rng: np.random.Generator, sequences: int, resamples: int, people: bool) -> IntArray:
    """Return how often each sequence is drawn, (resamples, sequences): alone, or with those of a person."""
    if not people:
        return resample_counts(rng, sequences, resamples)
    return two_stage_counts(rng, np.array([0, 0, 0, 0, 1, 1, 2])[:sequences], resamples)


@pytest.mark.parametrize("trainings", [1, 3])
@pytest.mark.parametrize("people", [False, True])
def test_resampled_interquartile_means_equal_those_of_scores_repeated(trainings: int, people: bool) -> None:
    rng = np.random.default_rng(3)
    scores = rng.random((trainings, 7))
    resamples = 1100  # more than are computed at a time
    counts, draws = counts_of(rng, 7, resamples, people), resample_counts(rng, trainings, resamples)
    assert (len(np.unique(counts.sum(axis=1))) > 1) == people
    fast = resampled_interquartile_means(scores, counts, draws)
    for resample in (*range(20), *range(1090, 1100)):
        drawn = np.repeat(np.repeat(scores, counts[resample], axis=1), draws[resample], axis=0)
        assert fast[resample] == pytest.approx(trim_mean(drawn.ravel(), 0.25))


def test_the_probability_of_improvement_is_mann_and_whitney_s_in_each_sequence() -> None:
    rng = np.random.default_rng(4)
    one, other = rng.integers(0, 5, (4, 6)) / 4, rng.integers(0, 5, (3, 6)) / 4
    expected = [mannwhitneyu(one[:, s], other[:, s]).statistic / 12 for s in range(6)]
    assert probability_of_improvement(wins(one, other)) == pytest.approx(np.mean(expected))
    assert probability_of_improvement(wins(other, one)) == pytest.approx(1 - np.mean(expected))
    assert probability_of_improvement(wins(one, one)) == 0.5


@pytest.mark.parametrize("people", [False, True])
def test_resampled_improvements_equal_those_of_scores_repeated(people: bool) -> None:
    rng = np.random.default_rng(5)
    one, other = rng.integers(0, 5, (2, 6)) / 4, rng.integers(0, 5, (3, 6)) / 4
    counts = counts_of(rng, 6, 30, people)
    draws, others = (resample_counts(rng, size, 30) for size in (2, 3))
    fast = resampled_improvements(wins(one, other), counts, draws, others)
    for resample in range(30):
        drawn = [
            np.repeat(np.repeat(scores, counts[resample], axis=1), times[resample], axis=0)
            for scores, times in ((one, draws), (other, others))
        ]
        assert fast[resample] == pytest.approx(probability_of_improvement(wins(*drawn)))
