"""What a training learns from, drawn by processes before it is asked for: a GPU would wait for one that draws it."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, TypeVar

import torch

Held = TypeVar("Held")
Asked = TypeVar("Asked")
Drawn = TypeVar("Drawn")


def draw_ahead(
    draw: Callable[[Held, Asked], Drawn], held: Held, asked: Iterable[Asked], *, processes: int, ahead: int
) -> Iterator[Drawn]:
    """Yield what is drawn for each of `asked`, in their order.

    Args:
        draw: draws; a function of a module, as processes import it.
        held: what it draws from, such as data; it travels once to each process.
        asked: what decides a draw, such as its number.
        processes: number of processes.
        ahead: how many are drawn before they are asked for.
    """
    with ProcessPoolExecutor(processes, get_context("spawn"), initializer=_hold, initargs=(draw, held)) as pool:
        waiting: deque[Future[Drawn]] = deque()
        try:
            for each in asked:
                waiting.append(pool.submit(_draw, each))
                if len(waiting) > ahead:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:  # nobody asks for more
                future.cancel()


_held: list[Any] = []  # of a process: how it draws, and what from


def _hold(draw: Callable[[Any, Any], Any], held: Any) -> None:
    """Keep in a process what it draws from; processes that draw beside each other have one thread each."""
    torch.set_num_threads(1)
    _held[:] = [draw, held]


def _draw(asked: Any) -> Any:
    """Draw in a process."""
    draw, held = _held
    return draw(held, asked)
