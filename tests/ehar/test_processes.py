"""Worker processes: what is sent to them, and what is said when they cannot do their work."""

import multiprocessing
import os
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from ehar.errors import ModelError, UsageError
from ehar.processes import (
    THREADS,
    Processes,
    call,
    check_workers,
    computed_ahead,
    payload,
    thread_share,
    worker_pool,
)

pytestmark = pytest.mark.usefixtures("spawned_workers")


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


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_batches_may_follow_others_when_their_results_are_taken(workers: int) -> None:
    taken: list[int] = []

    def follow(batch: int, result: int) -> list[int]:
        assert taken[-1] == result == batch + 100
        return [batch + 2] if batch < 5 else []

    for batch, result in Processes(workers).each_batch(int.__add__, 100, [1, 2], follow):
        assert result == 100 + batch
        taken.append(result)
    assert sorted(taken) == [101, 102, 103, 104, 105, 106]


def scaled(held: float, asked: int) -> tuple[int, float]:
    if asked < 0:
        raise ValueError("expected no negative number")
    return os.getpid(), held * asked


def test_what_is_computed_ahead_comes_in_order_from_other_processes() -> None:
    results = list(computed_ahead(scaled, 0.5, iter(range(7)), workers=2, ahead=3))
    assert [value for _, value in results] == [0.5 * number for number in range(7)]
    assert os.getpid() not in {process for process, _ in results}


def test_only_so_much_is_computed_ahead_and_nobody_need_ask_for_all() -> None:
    asked: list[int] = []

    def counted() -> Iterator[int]:
        for number in range(100):
            asked.append(number)
            yield number

    with closing(computed_ahead(scaled, 1.0, counted(), workers=1, ahead=4)) as results:
        assert [next(results)[1] for _ in range(3)] == [0.0, 1.0, 2.0]
    assert len(asked) == 7


def test_what_fails_ahead_fails_when_it_is_asked_for() -> None:
    results = computed_ahead(scaled, 1.0, [1, -1, 2], workers=1, ahead=1)
    assert next(results)[1] == 1.0
    with pytest.raises(ValueError, match="expected no negative number"):
        next(results)


def told_threads(_: object, nested: int) -> list[str]:
    found = [os.environ[name] for name in THREADS]
    within = list(Processes(2).each_batch(told_threads, None, [0, 0])) if nested else []
    return found + [threads for _, told in within for threads in told]


@pytest.mark.slow
def test_each_process_uses_its_share_of_the_threads_and_shares_it_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "5")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    (_, first), (_, second) = sorted(Processes(2).each_batch(told_threads, None, [0, 1]))
    assert first == ["2"] * 3 and second == ["2"] * 3 + ["1"] * 6
    assert os.environ["OMP_NUM_THREADS"] == "5" and "MKL_NUM_THREADS" not in os.environ
    with thread_share(16):
        assert os.environ["OMP_NUM_THREADS"] == "1"


def test_what_cannot_be_sent_is_named() -> None:
    with pytest.raises(
        UsageError, match=r"^planner x cannot be sent to a worker process: TypeError: .*lock.*--workers 1$"
    ):
        payload(threading.Lock(), "planner x")
    with pytest.raises(UsageError, match=r"^the data or the sensor cannot be sent .* or --device cpu$"):
        next(computed_ahead(scaled, threading.Lock(), [1], workers=1, ahead=1))


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
