"""Worker processes: their default number, and a pool that always ends with its parent process."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import wait
from typing import Any

from ehar.errors import ModelError, UsageError


def cores() -> int:
    """Return the default number of processes of a command."""
    return os.cpu_count() or 1


def check_workers(workers: int) -> None:
    """Raise a UsageError unless there is at least one worker."""
    if workers < 1:
        raise UsageError(f"workers: expected at least 1, got {workers}")


@contextmanager
def worker_pool(
    count: int, initializer: Callable[..., None] | None = None, initargs: tuple[Any, ...] = ()
) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of spawned processes; after an error it does not wait for unfinished jobs.

    Args:
        count: number of processes.
        initializer: function that each process calls once at its start.
        initargs: arguments of `initializer`.

    Raises:
        ModelError: a process ended before its job was done.
    """
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        count,
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start_worker,
        initargs=(initializer, initargs),
    )
    try:
        yield pool
        pool.shutdown()
    except BrokenProcessPool as error:
        raise ModelError("expected all workers to finish, one ended early: was there too little memory?") from error
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()


def _start_worker(initializer: Callable[..., None] | None, initargs: tuple[Any, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent hears Ctrl-C too, and ends its workers
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if initializer is not None:
        initializer(*initargs)


def _end_with_parent() -> None:
    """End this process when its parent ends; otherwise a training would go on beside the one that replaces it."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)
