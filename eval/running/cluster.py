"""A cluster of machines that run jobs, by Ray (https://docs.ray.io): an engine in place of worker processes.

Ray is an optional extra, so functions import it.
"""

import logging
import os
import pickle
import signal
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeVar, get_args

import cloudpickle

from ehar.errors import EharError, ModelError, UsageError
from ehar.processes import Engine, Processes, payload
from eval.records.config import installed_versions

if TYPE_CHECKING:
    from ray import ObjectRef

Task = TypeVar("Task")
Batch = TypeVar("Batch")
Result = TypeVar("Result")

EngineName = Literal["processes", "ray"]
AHEAD = 512  # jobs that are handed to Ray before they can run: it asks for more machines by what waits
LOST = 10  # times that a job begins anew because its machine or its process has ended, before the run ends
HEARD_EVERY, SILENT = 5.0, 30.0  # [s] the head is asked whether it is there; Ray would end this process after a minute


@dataclass(frozen=True)
class Cluster:
    """Machines that Ray knows.

    Args:
        address: address of a running cluster, or auto for the one that this machine belongs to; None starts Ray here.
        workers: processes, if Ray is started here; a running cluster gives all of its cores.

    Raises:
        UsageError: Ray is not installed.
    """

    address: str | None = None
    workers: int = 1

    def __post_init__(self) -> None:
        """Check that there is a Ray, and have its words about machines in its logs only, not amid a table."""
        os.environ.setdefault("RAY_DEDUP_LOGS_SKIP_REGEX", ".")  # it is read when Ray is imported
        try:
            import ray  # noqa: F401  # imported where it is needed: it is large, and optional
        except ImportError as error:
            raise UsageError("engine ray: Ray is not installed: pip install -e '.[cluster]'") from error

    def each_batch(
        self,
        function: Callable[[Task, Batch], Result],
        task: Task,
        batches: Sequence[Batch],
        follow: Callable[[Batch, Result], Sequence[Batch]] | None = None,
    ) -> Generator[tuple[Batch, Result], None, None]:
        """Call `function(task, batch)` for each batch, as `ehar.processes.Engine` says.

        The task goes to each machine once. A batch whose machine or process ends begins anew elsewhere. A batch may
        call this method too: it holds no core while it waits.

        Raises:
            UsageError: the task cannot be sent, there is no room for it, no cluster answers, or a machine has other
                versions of packages.
            ModelError: a batch began anew too often, or the head of the cluster has ended.
        """
        if not batches:
            return
        import ray

        sent, versions = payload((function, task), "the recogniser, the sensor or the motion"), installed_versions()
        with self._connected():
            shared = _shared(sent)
            run = ray.remote(num_cpus=1, max_retries=LOST)(_call_shared)
            waiting = deque(batches)
            pending: dict[ObjectRef[bytes], Batch] = {}
            head = _Head(ray.get_runtime_context().gcs_address)
            try:
                while waiting or pending:
                    while waiting and len(pending) < AHEAD:
                        batch = waiting.popleft()
                        pending[run.remote([shared], versions, batch)] = batch
                    head.check()
                    for done in ray.wait(list(pending), timeout=HEARD_EVERY)[0]:
                        batch, result = pending.pop(done), _result_of(done)
                        yield batch, result
                        waiting.extend(follow(batch, result) if follow else ())
            finally:
                for left in pending:  # of one who stops, or fails, in a cluster that goes on
                    ray.cancel(left)

    @contextmanager
    def _connected(self) -> Iterator[None]:
        """Be connected to the cluster; a connection that is there is used, and stays."""
        import ray

        if ray.is_initialized():
            yield
            return
        if self.address is not None:
            _check_answers(self.address)
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # Ray would tell its makers about its use
        terminate = signal.getsignal(signal.SIGTERM)
        try:
            ray.init(
                self.address or "local",
                num_cpus=None if self.address else self.workers,
                include_dashboard=None if self.address else False,
                log_to_driver=False,
                logging_level=logging.ERROR,
            )
        except (OSError, ValueError, RuntimeError) as error:
            reason, where = " ".join(str(error).split()), f"address {self.address}" if self.address else "engine ray"
            raise UsageError(f"{where}: expected a Ray cluster that answers, got: {reason}") from error
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, terminate)  # Ray puts its own in place of ours
        try:
            yield
        finally:
            ray.shutdown()


def engine_of(engine: str, address: str | None, workers: int) -> Engine:
    """Return the engine of a name.

    Raises:
        UsageError: the engine is unknown, has no address, or is not installed.
    """
    if engine not in get_args(EngineName):
        raise UsageError(f"unknown engine {engine!r}; expected {' or '.join(get_args(EngineName))}")
    if engine == "ray":
        return Cluster(address, workers)
    if address is not None:
        raise UsageError(f"address {address}: expected none with engine {engine}; engine ray has one")
    return Processes(workers)


def _check_answers(address: str) -> None:
    """Raise a UsageError if nothing listens at an address HOST:PORT, as Ray itself waits there for minutes."""
    if not address.rpartition(":")[2].isdigit():
        return  # auto, or what Ray refuses at once
    wrong = _wrong_at(address)
    if wrong:
        raise UsageError(f"address {address}: expected a Ray cluster that answers, got: {wrong}")


def _wrong_at(address: str) -> str:
    """Return why nothing listens at an address HOST:PORT; nothing if something does."""
    host, _, port = address.rpartition(":")
    try:
        socket.create_connection((host, int(port)), timeout=HEARD_EVERY).close()
    except OSError as error:
        return error.strerror or str(error)
    return ""


class _Head:
    """The process that all machines of a cluster hang on."""

    def __init__(self, address: str) -> None:
        """Begin with a head that answers at HOST:PORT."""
        self.address = address
        self.heard = time.monotonic()

    def check(self) -> None:
        """Raise a ModelError if it has been silent for long; Ray itself would end this process, in its own words."""
        silent = time.monotonic() - self.heard
        if silent < HEARD_EVERY:
            return
        wrong = _wrong_at(self.address)
        if not wrong:
            self.heard = time.monotonic()
        elif silent > SILENT:
            raise ModelError(
                f"engine ray: expected the head of the cluster at {self.address} to go on, got: {wrong}, for "
                f"{silent:.0f} s; what is done is kept, and the same command goes on"
            )


def _shared(sent: bytes) -> "ObjectRef[bytes]":
    """Put what all batches share where machines fetch it.

    Raises:
        UsageError: there is no room for it.
    """
    import ray
    from ray.exceptions import RayError

    try:
        return ray.put(sent)
    except RayError as error:
        raise UsageError(
            f"engine ray: {len(sent) / 1e6:.0f} MB for all jobs cannot be put where machines fetch them: "
            f"{type(error).__name__}; is the memory or the disk full?"
        ) from error


def _result_of(done: "ObjectRef[Any]") -> Any:
    """Return what a batch returned, or raise the error that it raised."""
    import ray
    from ray.exceptions import RayError, RayTaskError

    try:
        return pickle.loads(ray.get(done))
    except RayTaskError as error:
        if isinstance(error.cause, EharError):
            raise error.cause from None
        raise
    except RayError as error:
        raise ModelError(
            f"a job's process or machine has ended {LOST + 1} times: expected it to finish; was there too little "
            f"memory? ({type(error).__name__})"
        ) from error


_received: dict[str, tuple[Callable[[Any, Any], Any], Any]] = {}


def _call_shared(shared: "list[ObjectRef[bytes]]", versions: Mapping[str, str], batch: Any) -> bytes:
    """Call the shared function on a machine of the cluster; each process unpickles it once.

    Returns:
        the result, pickled: what Ray itself unpickles are arrays that cannot be written to.

    Raises:
        UsageError: this machine has other versions of packages, so results could differ.
    """
    import ray

    name = shared[0].hex()
    if name not in _received:
        _check_versions(versions)
        _received.clear()
        _received[name] = cloudpickle.loads(ray.get(shared[0]))
    function, task = _received[name]
    return pickle.dumps(function(task, batch))


def _check_versions(wanted: Mapping[str, str]) -> None:
    """Raise a UsageError if this machine has other versions of packages that decide numbers."""
    found = installed_versions()
    for name, version in wanted.items():
        if found.get(name) != version:
            raise UsageError(
                f"engine ray: machine {socket.gethostname()} has {name} {found.get(name)}, expected {version}, as on "
                "the machine that began the run"
            )
