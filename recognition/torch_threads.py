"""Threads of torch: as many as asked for, or one where numbers must be the same on any machine.

The order of a sum changes its digits.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import torch

from ehar.errors import UsageError

MOST_THREADS = 1024


def use_threads(threads: int) -> None:
    """Let torch use so many CPU threads; with 0, torch decides.

    Raises:
        UsageError: the number is below 0, or beyond any machine.
    """
    if not 0 <= threads <= MOST_THREADS:
        raise UsageError(f"--threads: got {threads}, expected 0 to {MOST_THREADS}")
    if threads:
        torch.set_num_threads(threads)


@contextmanager
def one_torch_thread() -> Iterator[None]:
    """Let torch use one thread, and then as many as before; this is also a decorator."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
