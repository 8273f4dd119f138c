"""Intervals cover other people: who is resampled, and how often intervals and corrected tests hold."""

import numpy as np
import pytest

from eval.scores.resampling.resamples import FEW, Basis, Resamples, resample_episodes
from eval.scores.resampling.statistics import RESAMPLES, interval, resample_counts


def drawn(subjects: list[list[int]], windows: int = 1) -> Resamples:
    """Return the resamples of one sequence for each row, in windows."""
    people = np.repeat(np.array(subjects), windows, axis=0)
    return resample_episodes(np.repeat(np.arange(len(subjects)).astype(str), windows), people)


def test_sequences_of_the_same_people_are_drawn_together_whatever_their_order() -> None:
    found = drawn([[1, 2], [2, 1], [3, 4], [5, 6], [3, 4]], windows=2)
    assert found.basis == Basis(sequences=5, groups=3, people=6, together=2)
    counts = found.counts[: found.full]
    assert counts.shape == (RESAMPLES, 5)
    assert (counts[:, :2].sum(axis=1) % 2 == 0).all() and (counts[:, [2, 4]].sum(axis=1) % 2 == 0).all()
    # Rows that draw people alone give all sequences of a couple alike.
    (alone,) = found.alone
    assert alone.units == 3
    rows = found.counts[alone.rows]
    assert (rows[:, 0] == rows[:, 1]).all() and (rows[:, 2] == rows[:, 4]).all() and (rows[:, 3] != rows[:, 2]).any()


@pytest.mark.parametrize("subjects", [[[-1], [-1], [-1]], [[1], [2], [-1]], [[4], [4], [4]]])
def test_without_two_sets_of_named_people_sequences_are_drawn_as_ever(subjects: list[list[int]]) -> None:
    found = drawn(subjects)
    assert not found.alone and not found.basis.of_people
    np.testing.assert_array_equal(found.counts, resample_counts(np.random.default_rng(0), 3))
    values = np.array([0.0, 0.5, 1.0])
    np.testing.assert_array_equal(found.interval(0.5, found.means(values)), interval(found.means(values)))


@pytest.mark.parametrize(
    ("subjects", "text", "few"),
    [
        ([[-1]] * 9, "9 sequences of people whom the data do not name", True),
        ([[3]] * 9, "9 sequences of one person", True),
        ([[3, 4]] * 9, "9 sequences of one couple", True),
        ([[1], [2], [1]], "2 people", True),
        ([[1], [2], [3], [4], [5]], "5 people", False),
        ([[1, 2], [3, 4], [5, 6], [7, 8]], "4 couples", True),
        ([[1, 2], [3, 4], [5, 6], [7, 8], [9, 10]], "5 couples", False),
        ([[1, 2], [1, 3], [2, 3], [1, 4], [4, 5], [3, 5]], "6 couples, formed by 5 people", False),
        ([[1, 2], [1, 3], [2, 3], [1, 4], [2, 4], [3, 4]], "6 couples, formed by 4 people", True),
        ([[1, 2, 3], [4, 5, 6]], "2 groups of people", True),
    ],
)
def test_a_table_is_told_who_its_intervals_rest_on(subjects: list[list[int]], text: str, few: bool) -> None:
    basis = drawn(subjects).basis
    assert (basis.text, basis.few) == (text, few)
    assert basis.text in basis.sentence
    assert ("do not cover other people" in basis.sentence) == (not basis.of_people)
    assert ("only" in basis.sentence) == (few and basis.of_people)


def test_without_intervals_nothing_is_drawn() -> None:
    found = resample_episodes(np.array(["a", "b"]), np.array([[1], [2]]), why_none="one class")
    assert (found.full, len(found.counts)) == (0, 0)
    assert np.isnan(found.interval(0.5, found.means(np.ones(2)))).all()


GROUPS, EACH, TIMES = 10, 5, 300


def ten_groups() -> Resamples:
    return drawn([[group] for group in range(GROUPS) for _ in range(EACH)])


def with_groups(rng: np.random.Generator, planners: int, effect: float) -> np.ndarray:
    """Return a number for each planner and sequence, (planners, 50), whose groups differ."""
    of_group = effect * rng.normal(size=(planners, GROUPS, 1))
    values: np.ndarray = (of_group + rng.normal(size=(planners, GROUPS, EACH))).reshape(planners, -1)
    return values


@pytest.mark.parametrize(("effect", "least"), [(1.0, 0.92), (0.3, 0.94), (0.0, 0.94)])
def test_intervals_cover_other_people_where_those_over_sequences_do_not(effect: float, least: float) -> None:
    rng = np.random.default_rng(1)
    resamples, sequences = ten_groups(), resample_counts(rng, GROUPS * EACH, 2000)
    values = with_groups(rng, TIMES, effect)  # each row is a study of its own; the true mean is 0
    ends = resamples.interval(values.mean(axis=1), resamples.means(values))
    covered = ((ends[:, 0] <= 0) & (ends[:, 1] >= 0)).mean()
    assert least <= covered
    naive = interval(values @ sequences.T / sequences.shape[1])
    naively = ((naive[:, 0] <= 0) & (naive[:, 1] >= 0)).mean()
    assert naively < 0.8 if effect == 1 else naively < covered


@pytest.mark.parametrize(("effect", "most"), [(1.0, 0.09), (0.3, 0.06)])
def test_one_table_of_ten_equal_planners_makes_a_false_claim_about_5_times_in_100(effect: float, most: float) -> None:
    rng = np.random.default_rng(2)
    resamples = ten_groups()
    wrong, uncorrected = 0, 0
    for _ in range(TIMES):
        values = with_groups(rng, 10, effect)
        differences = values[:1] - values[1:]  # of the first planner and each of the nine others
        resampled = resamples.means(differences)
        found = resamples.together(differences.mean(axis=1), resampled)
        wrong += bool((found.p < 0.05).any())
        uncorrected += bool((found.p_alone < 0.05).any())
    assert wrong / TIMES <= most
    assert wrong < uncorrected
    assert effect < 1 or uncorrected / TIMES > 0.15


def test_few_people_make_an_interval_wide_only_where_they_differ() -> None:
    rng = np.random.default_rng(3)
    four = drawn([[group] for group in range(4) for _ in range(14)])
    alike = rng.normal(size=56)
    differing = alike + np.repeat([-2.0, 2.0, -2.0, 2.0], 14)
    found = [four.widening(four.means(values)) for values in (alike - alike.mean(), differing)]
    assert found[0].of_interval < 1.25
    assert found[1].of_interval > 1.6 and found[1].freedom < 3.5
    assert FEW > 4
