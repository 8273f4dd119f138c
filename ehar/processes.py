"""Worker processes: their default number, a pool that always ends with its parent, an engine of them, work ahead."""

import multiprocessing
import os
import pickle
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor
from concurrent.futures import wait as wait_for
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from mmap import ACCESS_READ, mmap
from multiprocessing.connection import wait
from multiprocessing.reduction import DupFd
from multiprocessing.synchronize import Event
from tempfile import TemporaryFile, gettempdir
from typing import Any, Protocol, TypeVar

from ehar.errors import ModelError, UsageError

Task = TypeVar("Task")
Batch = TypeVar("Batch")
Result = TypeVar("Result")


def cores() -> int:
    """Return the default number of processes of a command."""
    return os.cpu_count() or 1


THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # libraries read them when they are loaded


@contextmanager
def thread_share(count: int) -> Iterator[None]:
    """Let each of `count` processes that start meanwhile use its share of this one's threads, and at least one.

    Otherwise the linear algebra of each would use all cores, and they would wait for each other. A process that starts
    others shares out what it was given.
    """
    before = {name: os.environ.get(name) for name in THREADS}
    told = before["OMP_NUM_THREADS"] or ""
    mine = int(told) if told.isdigit() and int(told) else cores()
    os.environ.update(dict.fromkeys(THREADS, str(max(mine // count, 1))))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def check_workers(workers: int) -> None:
    """Raise a UsageError unless there is at least one worker."""
    leave_if_imported_again()
    if workers < 1:
        raise UsageError(f"workers: expected at least 1, got {workers}")


def leave_if_imported_again() -> None:
    """End this process if it is a worker that is starting, and is importing the script to do so.

    A script without `if __name__ == "__main__":` would start all of its work again in each worker. These would start
    workers too, and no worker would ever answer. `worker_pool` then raises a UsageError in the first process.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):  # multiprocessing itself checks this flag
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
        count: number of processes.
        initializer: called once in each process.
        initargs: its first arguments. They have to be small: if a process cannot start, their pipe blocks forever.
        sent: its other arguments, of any size; they are pickled to a file without a name, which nobody has to remove.

    Raises:
        UsageError: no process could start, for example because a script lacks `if __name__ == "__main__":`; or there
            is no room for what is sent.
        ModelError: a process has ended by itself.
    """
    leave_if_imported_again()
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    started = context.Event()
    try:
        file = TemporaryFile()
        pickle.dump(sent, file)
        file.flush()
    except OSError as error:
        raise UsageError(f"{gettempdir()}: cannot be written: {error.strerror}") from error
    told = (started, initializer, initargs, _Sent(file.fileno()))
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=_start_worker, initargs=told)
    try:
        with thread_share(count):
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
        file.close()


@dataclass(frozen=True)
class _Sent:
    """A file that a worker inherits from its parent.

    Args:
        descriptor: number of the open file.
    """

    descriptor: int

    def __reduce__(self) -> tuple[Callable[[Any], "_Sent"], tuple[Any]]:
        """Hand the open file to a worker that is starting."""
        return _inherited, (DupFd(self.descriptor),)

    def read(self) -> Any:
        """Return what it holds; all processes share one position in it, so none may use that."""
        with mmap(self.descriptor, 0, access=ACCESS_READ) as content:
            return pickle.loads(content)


def _inherited(handed: Any) -> _Sent:
    return _Sent(handed.detach())


def payload(what: Any, name: str, otherwise: str = "--workers 1") -> bytes:
    """Return an object as bytes for a worker process; its class may be from a user's file or a notebook.

    Args:
        what: the object to send.
        name: its name in errors.
        otherwise: the option without which nothing would be sent, for the error.

    Raises:
        UsageError: the object cannot be pickled.
    """
    import cloudpickle  # here, as `ehar --help` does not wait for it

    try:
        return bytes(cloudpickle.dumps(what))
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise UsageError(
            f"{name} cannot be sent to a worker process: {reason}; expected no open files, locks or generators in it, "
            f"or {otherwise}"
        ) from error


def call(sent: bytes, *arguments: Any) -> Any:
    """Call a function in a worker process; `sent` is the bytes of (function, its first argument)."""
    import cloudpickle  # here, as `ehar --help` does not wait for it

    function, first = cloudpickle.loads(sent)
    return function(first, *arguments)


class Engine(Protocol):
    """Where batches of a task run: in processes of this machine, or on a cluster."""

    def each_batch(
        self,
        function: Callable[[Task, Batch], Result],
        task: Task,
        batches: Sequence[Batch],
        follow: Callable[[Batch, Result], Sequence[Batch]] | None = None,
    ) -> Generator[tuple[Batch, Result], None, None]:
        """Call `function(task, batch)` for each batch, and yield (batch, result) when it is done, in any order.

        Args:
            function: computes a result that depends on the task and the batch only.
            task: what all batches share; it is sent once.
            batches: the batches that can begin at once.
            follow: returns the batches that can begin after one; it is called when the caller has taken its result.
        """
        ...


@dataclass(frozen=True)
class Processes:
    """Worker processes of this machine; a single one is this process itself.

    Args:
        workers: number of processes.
    """

    workers: int = 1

    def each_batch(
        self,
        function: Callable[[Task, Batch], Result],
        task: Task,
        batches: Sequence[Batch],
        follow: Callable[[Batch, Result], Sequence[Batch]] | None = None,
    ) -> Generator[tuple[Batch, Result], None, None]:
        """Call `function(task, batch)` for each batch, as `Engine` says. Each process receives the task once.

        Raises:
            UsageError: the task cannot be sent to workers, or none could start.
            ModelError: a worker has ended by itself.
        """
        waiting = deque(batches)
        if self.workers == 1 or (len(waiting) < 2 and follow is None):
            while waiting:
                batch = waiting.popleft()
                result = function(task, batch)
                yield batch, result
                waiting.extend(follow(batch, result) if follow else ())
            return
        sent = payload((function, task), "the recogniser, the sensor or the motion")
        count = self.workers if follow else min(self.workers, len(waiting))
        with worker_pool(count, _receive, sent=(sent,)) as pool:
            running: dict[Future[Result], Batch] = {}
            while waiting or running:
                while waiting and len(running) < 2 * count:  # a few wait there, so that no process waits for this one
                    batch = waiting.popleft()
                    running[pool.submit(_call_received, batch)] = batch
                for future in wait_for(running, return_when=FIRST_COMPLETED).done:
                    batch, result = running.pop(future), future.result()
                    yield batch, result
                    waiting.extend(follow(batch, result) if follow else ())


def computed_ahead(
    function: Callable[[Task, Batch], Result], task: Task, batches: Iterable[Batch], *, workers: int, ahead: int
) -> Generator[Result, None, None]:
    """Yield `function(task, batch)` for each batch, in order; processes compute ahead what a GPU asks for next.

    Close it, if not all are asked for.

    Args:
        function: computes a result that depends on the task and the batch only.
        task: what all batches share; it is sent once to each process.
        batches: the batches.
        workers: number of processes.
        ahead: how many results are computed before they are asked for.

    Raises:
        UsageError: the task cannot be sent to workers, or none could start.
        ModelError: a worker has ended by itself.
    """
    sent = payload((function, task), "the data or the sensor", otherwise="--device cpu")
    with worker_pool(workers, _receive, sent=(sent,)) as pool:
        computed: deque[Future[Result]] = deque()
        for batch in batches:
            computed.append(pool.submit(_call_received, batch))
            if len(computed) > ahead:
                yield computed.popleft().result()
        while computed:
            yield computed.popleft().result()


_received: tuple[Callable[[Any, Any], Any], Any]


def _receive(sent: bytes) -> None:
    """Receive a function and its task, once in each process."""
    import cloudpickle  # here, as `ehar --help` does not wait for it

    global _received
    _received = cloudpickle.loads(sent)


def _call_received(batch: Any) -> Any:
    function, task = _received
    return function(task, batch)


def _start_worker(
    started: Event, initializer: Callable[..., None] | None, initargs: tuple[Any, ...], sent: _Sent
) -> None:
    started.set()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent receives Ctrl-C too, and ends its workers
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if initializer is not None:
        initializer(*initargs, *sent.read())


def _end_with_parent() -> None:
    """End this process when its parent ends; otherwise a stopped training would run on beside its successor."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)
