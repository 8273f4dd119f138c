"""The Pareto front: the planners that no other beats at the price they have."""

import numpy as np

from ehar.arrays import BoolArray, FloatArray


def pareto_front(cost: FloatArray, value: FloatArray) -> BoolArray:
    """Return which of n choices are not dominated, (n,): none is as good in both and better in one.

    Args:
        cost: (n,), of which less is better.
        value: (n,), of which more is better.
    """
    as_good = (cost[:, None] <= cost) & (value[:, None] >= value)  # [other, choice]
    better = (cost[:, None] < cost) | (value[:, None] > value)
    beaten: BoolArray = np.asarray((as_good & better).any(axis=0))
    return ~beaten
