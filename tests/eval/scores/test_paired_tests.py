from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from eval.scores.paired_tests import holm, mcnemar


def answers(wins: int, losses: int, ties: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Return who is right in each episode: both in as many ties, neither in as many more."""
    one = [1.0] * wins + [0.0] * losses + [1.0] * ties + [0.0] * ties
    other = [0.0] * wins + [1.0] * losses + [1.0] * ties + [0.0] * ties
    return np.array(one), np.array(other)


@given(wins=st.integers(0, 300), losses=st.integers(0, 300))
def test_mcnemar_is_the_exact_binomial_test_of_those_who_differ(wins: int, losses: int) -> None:
    found = mcnemar(*answers(wins, losses))
    assert (found.wins, found.losses) == (wins, losses)
    expected = 1.0 if wins + losses == 0 else binomtest(wins, wins + losses).pvalue
    assert found.p == pytest.approx(expected, rel=1e-9, abs=1e-300)


def test_mcnemar_by_hand() -> None:
    # 1 against 5: 2 (C(6, 0) + C(6, 1)) / 2^6.
    assert mcnemar(*answers(1, 5)).p == pytest.approx(14 / 64)
    assert mcnemar(*answers(5, 1)).p == pytest.approx(14 / 64)


def test_of_several_trainings_an_episode_counts_for_the_planner_whose_trainings_are_right_more_often() -> None:
    right = np.array([2 / 3, 1 / 3, 1.0, 0.0, 2 / 3])
    other = np.array([1 / 2, 1 / 2, 1.0, 1 / 2, 4 / 6])
    assert mcnemar(right, other)[:2] == (1, 2)


def test_holm_by_hand() -> None:
    np.testing.assert_allclose(holm(np.array([0.01, 0.04, 0.03, 0.005])), [0.03, 0.06, 0.06, 0.02])
    np.testing.assert_allclose(holm(np.array([0.03])), [0.03])
    np.testing.assert_allclose(holm(np.array([0.6, 0.5])), [1, 1])
    assert len(holm(np.array([]))) == 0


@given(st.lists(st.floats(0, 1), min_size=1, max_size=6))
def test_holm_closes_bonferroni_s_tests(p: list[float]) -> None:
    # A hypothesis falls where Bonferroni rejects every set of hypotheses that it is in.
    for index, adjusted in enumerate(holm(np.array(p))):
        sets = [of for size in range(1, len(p) + 1) for of in combinations(range(len(p)), size) if index in of]
        assert adjusted == pytest.approx(max(min(1, len(of) * min(p[i] for i in of)) for of in sets))
