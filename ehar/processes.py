"""Worker processes: how many by default, and a pool that ends with the process that made it, however that ends."""

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
    """Return in how many processes a command runs by default."""
    return os.cpu_count() or 1


def check_workers(workers: int) -> None:
    """Raise a UsageError unless there is a worker."""
    if workers < 1:
        raise UsageError(f"workers: expected at least 1, got {workers}")


@contextmanager
def worker_pool(
    count: int, initializer: Callable[..., None] | None = None, initargs: tuple[Any, ...] = ()
) -> Iterator[ProcessPoolExecutor]:
    """Hold a pool of spawned processes; what has not finished when it is left by an error is not waited for.

    Args:
        count: of processes.
        initializer: called once in each.
        initargs: what with.

    Raises:
        ModelError: a process has ended by itself.
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
        raise ModelError("a worker process has ended: expected it to finish; was there too little memory?") from error
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()


def payload(what: Any, name: str) -> bytes:
    """Return something as bytes for a worker process; classes of a user's own file, or of a notebook, arrive too.

    Args:
        what: to send.
        name: of it, for errors.

    Raises:
        UsageError: it holds what cannot be sent.
    """
    import cloudpickle  # here, as `ehar --help` does not wait for it

    try:
        return bytes(cloudpickle.dumps(what))
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise UsageError(
            f"{name} cannot be sent to a worker process: {reason}; expected no open files, locks or generators in it, "
            "or --workers 1"
        ) from error


def call(sent: bytes, *arguments: Any) -> Any:
    """Call, in a worker process, a function that was sent as bytes of (function, its first argument)."""
    import cloudpickle  # here, as `ehar --help` does not wait for it

    function, first = cloudpickle.loads(sent)
    return function(first, *arguments)


def _start_worker(initializer: Callable[..., None] | None, initargs: tuple[Any, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent hears Ctrl-C too, and ends its workers
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if initializer is not None:
        initializer(*initargs)


def _end_with_parent() -> None:
    """Wait for the parent; without it, a training would go on beside the one that is started in its place."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)
