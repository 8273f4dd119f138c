"""Worker processes: what is sent to them, and what is said when they cannot do their work."""

import multiprocessing
import os
import threading
from pathlib import Path

import pytest

from ehar.errors import ModelError, UsageError
from ehar.processes import call, check_workers, payload, worker_pool


def keep(folder: Path, text: str) -> None:
    (folder / str(os.getpid())).write_text(text)


def leave(*_: object) -> None:
    os._exit(3)


def test_at_least_one_worker_is_needed() -> None:
    check_workers(1)
    with pytest.raises(UsageError, match=r"^workers: expected at least 1, got 0$"):
        check_workers(0)


def test_a_function_of_a_notebook_can_be_sent() -> None:
    least = 3
    assert call(payload((lambda first, second: first + second + least, 4), "planner x"), 5) == 12


def test_what_cannot_be_sent_is_named() -> None:
    with pytest.raises(UsageError, match=r"^planner x cannot be sent to a worker process: TypeError: .*lock"):
        payload(threading.Lock(), "planner x")


def test_a_worker_is_another_process_and_gets_what_is_sent(tmp_path: Path) -> None:
    with worker_pool(1, keep, (tmp_path,), ("kept",)) as pool:
        process = pool.submit(os.getpid).result()
    assert process != os.getpid()
    assert (tmp_path / str(process)).read_text() == "kept"


def test_a_worker_that_ends_by_itself_is_an_error() -> None:
    with pytest.raises(ModelError, match=r"^a worker process has ended: expected it to finish"), worker_pool(1) as pool:
        pool.submit(leave).result()


def test_workers_that_cannot_start_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ehar.processes._start_worker", leave)
    with pytest.raises(UsageError, match=r"^workers: no worker process could start; in a script, "):
        with worker_pool(1) as pool:
            pool.submit(os.getpid).result()


def test_a_script_that_a_worker_imports_ends_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(multiprocessing.current_process(), "_inheriting", True, raising=False)
    with pytest.raises(SystemExit):
        check_workers(2)
