"""What processes draw ahead is what one draws by itself, in order."""

import os
from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest
import torch

from recognition.training.draw_ahead import draw_ahead


def scaled(held: float, asked: int) -> tuple[int, float, int]:
    if asked < 0:
        raise ValueError("expected no negative number")
    return os.getpid(), held * asked, torch.get_num_threads()


def test_draws_come_in_the_order_in_which_they_are_asked_for() -> None:
    drawn = list(draw_ahead(scaled, 0.5, iter(range(7)), processes=2, ahead=3))
    assert [value for _, value, _ in drawn] == [0.5 * number for number in range(7)]
    assert os.getpid() not in {process for process, _, _ in drawn}
    assert {threads for _, _, threads in drawn} == {1}  # so they do not wait for each other


def test_only_so_many_are_drawn_ahead_and_nobody_need_ask_for_all() -> None:
    asked: list[int] = []

    def counted() -> Iterator[int]:
        for number in range(100):
            asked.append(number)
            yield number

    with closing(draw_ahead(scaled, 1.0, counted(), processes=1, ahead=4)) as drawn:
        assert [next(drawn)[1] for _ in range(3)] == [0.0, 1.0, 2.0]
    assert len(asked) == 7


def test_what_fails_in_a_process_fails_here() -> None:
    drawn = draw_ahead(scaled, 1.0, [1, -1, 2], processes=1, ahead=1)
    assert next(drawn)[1] == 1.0
    with pytest.raises(ValueError, match="expected no negative number"):
        next(drawn)


def test_arrays_arrive_whole() -> None:
    (drawn,) = draw_ahead(np.multiply, np.float32(2), [np.arange(5, dtype=np.float32)], processes=1, ahead=1)
    np.testing.assert_array_equal(drawn, 2 * np.arange(5))
