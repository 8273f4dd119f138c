import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from eval.reports.figures import pareto_front


def test_what_costs_more_and_is_worth_no_more_is_not_on_the_front() -> None:
    front = pareto_front(np.array([0.0, 1.0, 2.0, 2.0, 3.0]), np.array([1.0, 5.0, 5.0, 7.0, 6.0]))
    assert front.tolist() == [True, True, False, True, False]


def test_equals_are_both_on_the_front_and_nothing_has_none() -> None:
    assert pareto_front(np.array([1.0, 1.0]), np.array([2.0, 2.0])).all()
    assert len(pareto_front(np.array([]), np.array([]))) == 0


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=1, max_size=9))
def test_it_is_what_a_loop_over_pairs_finds(points: list[tuple[int, int]]) -> None:
    cost, value = np.array(points, dtype=float).T
    expected = [
        not any(c <= cost[i] and v >= value[i] and (c < cost[i] or v > value[i]) for c, v in points)
        for i in range(len(points))
    ]
    assert pareto_front(cost, value).tolist() == expected
