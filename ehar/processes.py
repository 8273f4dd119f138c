"""Worker processes: their default number, and a pool that always ends with its parent process."""

import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import wait
from multiprocessing.synchronize import Event
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ehar.errors import ModelError, UsageError


def cores() -> int:
    """Return the default number of processes of a command."""
    return os.cpu_count() or 1


def check_workers(workers: int) -> None:
    """Raise a UsageError unless there is a worker."""
    leave_if_imported_again()
    if workers < 1:
        raise UsageError(f"workers: expected at least 1, got {workers}")


def leave_if_imported_again() -> None:
    """End this process if it is a worker that is only about to start, and imports the script for that.

    Without `if __name__ == "__main__":` the script would start all of its work again in each worker, these would start
    workers too, and none would ever answer. `worker_pool` says what to do about it, in the process that began it all.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):  # what multiprocessing itself goes by
        raise SystemExit(1)


@contextmanager
def worker_pool(
    count: int,
    initializer: Callable[..., None] | None = None,
    initargs: tuple[Any, ...] = (),
    sent: tuple[Any, ...] = (),
) -> Iterator[ProcessPoolExecutor]:
    """Open a pool of spawned processes; after an error it does not wait for unfinished jobs.

    Args:
        count: of processes.
        initializer: called once in each.
        initargs: what with: little, as the pipe that carries it waits for ever for a process that cannot start.
        sent: what else with, of any size, but pickled: through a file.

    Raises:
        UsageError: no process could start, as when a script lacks `if __name__ == "__main__":`.
        ModelError: a process has ended by itself.
    """
    leave_if_imported_again()
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    started = context.Event()
    folder = TemporaryDirectory(prefix="ehar-")
    file = Path(folder.name) / "sent"
    file.write_bytes(pickle.dumps(sent))
    pool = ProcessPoolExecutor(
        count, mp_context=context, initializer=_start_worker, initargs=(started, initializer, initargs, file)
    )
    try:
        yield pool
        pool.shutdown()
    except BrokenProcessPool as error:
        if not started.is_set():
            raise UsageError(
                "workers: no worker process could start; in a script, each one imports the script first, "
                'so put what it runs under `if __name__ == "__main__":`, or set workers to 1'
            ) from None
        raise ModelError("a worker process has ended: expected it to finish; was there too little memory?") from error
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()
        folder.cleanup()


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


def _start_worker(
    started: Event, initializer: Callable[..., None] | None, initargs: tuple[Any, ...], file: Path
) -> None:
    started.set()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent hears Ctrl-C too, and ends its workers
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if initializer is not None:
        initializer(*initargs, *pickle.loads(file.read_bytes()))


def _end_with_parent() -> None:
    """End this process when its parent ends; otherwise a training would go on beside the one that replaces it."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)
