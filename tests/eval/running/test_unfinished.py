"""A run that is stopped, however it is stopped, goes on when it is called again, and ends in the same bytes."""

import errno
import json
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Mapping
from functools import cache
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ehar.arrays import FloatArray
from ehar.data.motion_file import save_motion
from ehar.errors import ModelError, UsageError
from ehar.files import write_text
from eval.cli.main import main
from eval.records import code
from eval.records.config import CONFIG, SCHEMA, UNFINISHED
from eval.records.job_times import JOB_TIMES, read_job_times
from eval.records.run_files import EPISODES, SUMMARY, TABLE
from eval.running import unfinished
from eval.running.episodes import CHUNK
from eval.running.jobs import Job
from eval.running.run import read_run
from eval.running.unfinished import UnfinishedRun
from planners.heuristic import NoAct
from tests.helpers.fakes import tiny_data
from tests.helpers.made_records import CONFIG_OF_RUN
from tests.helpers.processes import descendants, needs_proc, still_running
from tests.helpers.tiny_benchmarks import Log, but_times, bytes_of, run

pytestmark = pytest.mark.usefixtures("fake_weights", "same_times")
PLANNERS = ["no-act", "towards", "random", "oracle"]
JOBS = 4 * 160 // CHUNK
KILLS = 20
OWN_PLANNER = """
import os, signal
from pathlib import Path
from ehar.planner import Planner

class Fatal(Planner):
    name = "fatal"

    def act(self, observation):
        told = Path(__file__).with_name("killed")
        if not told.exists():
            told.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return observation.viewpoint
"""
TURNING = """
from beside_turn import TURN
from ehar.planner import Planner

class Turning(Planner):
    name = "turning"

    def act(self, observation):
        return observation.viewpoint + [0, TURN, 0]
"""


@pytest.fixture
def same_times(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let each plan and job take a second, as only times differ between runs; draw no figure, which takes long."""
    seconds = count()
    monkeypatch.setattr(sys.modules["ehar.rollout"], "time", SimpleNamespace(perf_counter=lambda: float(next(seconds))))
    monkeypatch.setattr("eval.running.jobs.process_time", lambda: float(next(seconds)))
    monkeypatch.setattr("eval.render.figures.draw_accuracy", draw)


def draw(
    curves: Mapping[str, FloatArray], privileged: set[str], classes: int, title: str, stem: Path, watched: str
) -> None:
    write_text(stem.with_suffix(".svg"), [f"{title}: {name} {curve.tolist()}\n" for name, curve in curves.items()])


@cache
def whole_run() -> dict[str, bytes]:
    """Return the files of a run that was never stopped. Times are those of `same_times`, so each would be the same."""
    with TemporaryDirectory() as folder:
        out = Path(folder) / "never-stopped"
        run(PLANNERS, out=out)
        return bytes_of(out)


@pytest.fixture
def never_stopped(tmp_path: Path) -> dict[str, bytes]:
    """Return the files of a run that was never stopped, which are in a folder of the test too."""
    found = whole_run()
    assert list(found) == ["accuracy.svg", CONFIG, EPISODES, JOB_TIMES, SUMMARY, "table.md"]
    (tmp_path / "never-stopped").mkdir()
    for name, content in found.items():
        (tmp_path / "never-stopped" / name).write_bytes(content)
    return found


def stop(out: Path, *, after: int, workers: int = 1) -> KeyboardInterrupt:
    """Stop a run by Ctrl-C after so many jobs."""
    # What a shell starts in the background ignores Ctrl-C, these tests perhaps too.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with pytest.raises(KeyboardInterrupt) as interrupt:
        run(PLANNERS, out=out, reporter=Log(stop_after=after), workers=workers)
    return interrupt.value


@pytest.mark.slow
def test_a_run_that_is_killed_twenty_times_ends_in_the_same_bytes(
    tmp_path: Path, never_stopped: dict[str, bytes]
) -> None:
    rng, context = np.random.default_rng(0), multiprocessing.get_context("fork")
    begin = time.monotonic()
    run(PLANNERS, out=tmp_path / "timed")
    seconds, kills, went_on = time.monotonic() - begin, 0, 0
    out = tmp_path / "killed"
    while kills < KILLS:
        went_on += (out / UNFINISHED / "0-0.json").exists()
        process = context.Process(target=run, args=(PLANNERS,), kwargs={"out": out})
        process.start()
        process.join(rng.uniform(0, seconds))
        process.kill()
        process.join()
        kills += process.exitcode == -signal.SIGKILL
        if process.exitcode == 0:  # it was done before it was killed
            assert bytes_of(out) == never_stopped
            out = tmp_path / f"after-{kills}-kills"
    run(PLANNERS, out=out)
    assert bytes_of(out) == never_stopped
    assert went_on > 2


@pytest.mark.slow
@needs_proc
@pytest.mark.usefixtures("spawned_workers")
def test_workers_end_with_a_driver_that_is_killed_and_leave_no_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, never_stopped: dict[str, bytes]
) -> None:
    rng, context, out = np.random.default_rng(1), multiprocessing.get_context("fork"), tmp_path / "killed"
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    for most in (1, JOBS // 2):  # jobs that are done when it is killed, or a few more
        process = context.Process(target=run, args=(PLANNERS,), kwargs={"out": out, "workers": 2})
        process.start()
        assert process.pid is not None
        while process.is_alive() and len(list(out.glob(f"{UNFINISHED}/[0-9]*.json"))) < most:
            time.sleep(0.01)
        time.sleep(rng.uniform(0, 0.1))
        workers = descendants(process.pid)
        process.kill()
        process.join()
        assert process.exitcode == -signal.SIGKILL and len(workers) >= 2
        assert still_running(workers) == []
    assert list((tmp_path / "temporary").iterdir()) == []
    log = Log()
    run(PLANNERS, out=out, reporter=log)
    assert log.jobs <= JOBS // 2
    assert but_times(bytes_of(out)) == but_times(never_stopped)


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_what_is_done_is_not_run_again(tmp_path: Path, workers: int, never_stopped: dict[str, bytes]) -> None:
    out = tmp_path / "run"
    assert (
        str(stop(out, after=12, workers=workers))
        == f"12 of {JOBS} jobs are in {out}/unfinished; the same command goes on"
    )
    assert [path.name for path in out.iterdir()] == [UNFINISHED]
    log = Log()
    run(PLANNERS, out=out, reporter=log)
    assert log.notes == [f"{out}: goes on; 12 of {JOBS} jobs are done"]
    assert log.jobs == len(log.done) == JOBS - 12
    assert but_times(bytes_of(out)) == but_times(never_stopped)
    assert workers > 1 or bytes_of(out) == never_stopped


def test_what_other_code_did_is_run_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, never_stopped: dict[str, bytes]
) -> None:
    out, log = tmp_path / "run", Log()
    with monkeypatch.context() as before:
        before.setattr(unfinished, "code_sha256", lambda: "what the code was")
        stop(out, after=12)
    run(PLANNERS, out=out, reporter=log)
    assert log.notes == [f"{out}: begins anew; 12 of {JOBS} jobs were done by other code"]
    assert log.jobs == JOBS
    assert but_times(bytes_of(out)) == but_times(never_stopped)


def test_any_module_makes_other_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "package" / "inner").mkdir(parents=True)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(code, "PACKAGES", ("package",))
    found = set()
    for name, text in (("__init__", ""), ("inner/module", "x = 1"), ("inner/module", "x = 2"), ("other", "")):
        (tmp_path / "package" / f"{name}.py").write_text(text)
        found.add(code.code_sha256.__wrapped__())
    assert len(found) == 4


def test_a_run_that_is_stopped_before_a_job_is_done_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Log, "begin", lambda *_: os.kill(os.getpid(), signal.SIGINT))
    assert str(stop(tmp_path / "run", after=1)) == "nothing was written"
    assert not (tmp_path / "run").exists()


def test_it_is_kept_what_each_job_took(tmp_path: Path, never_stopped: dict[str, bytes]) -> None:
    jobs = read_job_times(tmp_path / "never-stopped")
    assert [job.planner for job in jobs] == [name for name in PLANNERS for _ in range(JOBS // 4)]
    assert {(job.episodes, job.frames) for job in jobs} == {(CHUNK, 10)}
    assert all(job.core_seconds >= 1 and job.returned_bytes > 32 * 10 * 50 for job in jobs)


def test_the_same_command_after_the_end_begins_anew(tmp_path: Path, never_stopped: dict[str, bytes]) -> None:
    log = Log()
    run(PLANNERS, out=tmp_path / "never-stopped", reporter=log)
    assert log.jobs == JOBS
    assert bytes_of(tmp_path / "never-stopped") == never_stopped


def test_a_job_whose_files_are_damaged_is_run_again(tmp_path: Path, never_stopped: dict[str, bytes]) -> None:
    out = tmp_path / "run"
    stop(out, after=12)
    held = out / UNFINISHED
    (held / "0-1.jsonl").write_bytes((held / "0-1.jsonl").read_bytes()[:-9])
    (held / "0-2.json").write_text("{")
    (held / "0-3.json").unlink()
    (held / "1-0.jsonl").unlink()
    log = Log()
    run(PLANNERS, out=out, reporter=log)
    assert log.done.count("no-act") == 3
    assert log.jobs == JOBS - 12 + 4
    assert bytes_of(out) == never_stopped


def test_a_file_that_a_killed_process_was_writing_is_left_out(tmp_path: Path, never_stopped: dict[str, bytes]) -> None:
    out = tmp_path / "run"
    stop(out, after=3)
    for name in (".0-3.123.jsonl", ".0-3.123.json", ".config.123.json", "whole/.summary.123.json"):
        write_text(out / UNFINISHED / name, ["{"])
    run(PLANNERS, out=out)
    assert bytes_of(out) == never_stopped


def test_another_run_is_refused_in_one_line(tmp_path: Path) -> None:
    out = tmp_path / "run"
    stop(out, after=1)
    folder = out / UNFINISHED
    with pytest.raises(UsageError, match=rf"holds another run.* in seed \(seed was 0, now 1\); remove {folder}, or"):
        run(PLANNERS, out=out, seed=1)
    with pytest.raises(UsageError, match=r"differs in planners \(planners\[1\]\.name was 'towards', now 'front'\)"):
        run(["no-act", "front", "random", "oracle"], out=out)
    held = json.loads((folder / CONFIG).read_text())
    write_text(folder / CONFIG, [json.dumps(held | {"versions": {**held["versions"], "numpy": "1.0"}})])
    with pytest.raises(UsageError, match=rf"versions \(versions\.numpy was '1\.0', now '{np.__version__}'\)") as error:
        run(PLANNERS, out=out)
    assert "\n" not in str(error.value)
    assert held["versions"]["ehar"].endswith(f"+{code.code_sha256()[:12]}")
    write_text(folder / CONFIG, [json.dumps(held | {"schema": SCHEMA - 1})])
    with pytest.raises(UsageError, match=f"holds a run of schema {SCHEMA - 1}, expected {SCHEMA}; remove "):
        run(PLANNERS, out=out)


def test_commands_that_read_runs_say_that_one_is_not_finished(tmp_path: Path) -> None:
    stop(tmp_path / "run", after=1)
    with pytest.raises(UsageError, match="expected a finished run, this one was stopped; the command that began it"):
        read_run(tmp_path / "run")


class Mine(NoAct):
    name = "mine"


def test_objects_in_place_of_names_begin_anew(tmp_path: Path) -> None:
    # Nobody can tell whether an object is the one that ran: its class may have changed in a notebook.
    for _ in range(2):
        log = Log(stop_after=2)
        with pytest.raises(KeyboardInterrupt, match=r"^2 of 10 jobs"):
            run(["no-act", Mine()], out=tmp_path / "run", reporter=log)
        assert (log.jobs, log.notes) == (10, [])


def test_jobs_without_a_configuration_are_run_again(tmp_path: Path, never_stopped: dict[str, bytes]) -> None:
    stop(tmp_path / "run", after=3)
    (tmp_path / "run" / UNFINISHED / CONFIG).unlink()
    log = Log()
    run(PLANNERS, out=tmp_path / "run", reporter=log)
    assert log.jobs == JOBS
    assert bytes_of(tmp_path / "run") == never_stopped


@pytest.mark.parametrize("written", [1, 12, 30, 2 * JOBS + 2, 2 * JOBS + 5, 2 * JOBS + 7])
def test_a_full_disk_ends_in_one_line_and_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, written: int, never_stopped: dict[str, bytes]
) -> None:
    out, files, replace = tmp_path / "run", count(), Path.replace

    def full(path: Path, target: Path) -> Path:
        if next(files) >= written:
            raise OSError(errno.ENOSPC, "No space left on device")
        return replace(path, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", full)
        with pytest.raises(UsageError, match=r"run.*: cannot be written: No space left on device$") as error:
            run(PLANNERS, out=out)
    assert "\n" not in str(error.value)
    assert not [path for path in out.rglob("*") if path.name.startswith(".")]
    log = Log()
    run(PLANNERS, out=out, reporter=log)
    assert log.jobs == max(JOBS - (written - 1) // 2, 0)
    assert bytes_of(out) == never_stopped


def test_a_run_that_ends_while_it_takes_the_place_of_another_does_not_pass_for_either(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(PLANNERS, out=tmp_path)
    move = Path.replace

    def full(path: Path, target: Path) -> Path:
        if path.name == EPISODES and path.parent.name == "whole":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return move(path, target)

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(UsageError, match="cannot be written: No space left on device"):
        run(PLANNERS, out=tmp_path)
    assert (tmp_path / EPISODES).is_file() and not (tmp_path / SUMMARY).exists() and not (tmp_path / TABLE).exists()


def test_a_folder_that_cannot_be_written_to_ends_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: Any) -> int:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr("eval.running.unfinished.os.open", refused)
    with pytest.raises(UsageError, match=r"unfinished/lock: cannot be written: Read-only file system$"):
        run(PLANNERS, out=tmp_path / "run")


def test_two_processes_do_not_write_the_same_run(tmp_path: Path) -> None:
    out = tmp_path / "run"
    other = UnfinishedRun(out, CONFIG_OF_RUN)
    with other.opened([Job(0, 0)], anew=False, note=lambda _: None):
        (other.folder / CONFIG).unlink()
        with pytest.raises(UsageError, match="run: expected one process to write this run, another one does already"):
            run(PLANNERS, out=out)
    run(PLANNERS, out=out)


@pytest.mark.slow
def test_a_worker_that_is_killed_loses_nothing_but_its_job(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN_PLANNER)
    told = ["no-act", "towards", f"{tmp_path}/own.py:Fatal"]
    with pytest.raises(ModelError, match=r"^a worker process has ended: expected it to finish") as error:
        run(told, out=tmp_path / "run", workers=2)
    assert "\n" not in str(error.value)
    log = Log()
    run(told, out=tmp_path / "run", reporter=log)
    assert log.jobs < 15
    run(told, out=tmp_path / "never-stopped")
    assert but_times(bytes_of(tmp_path / "run")) == but_times(bytes_of(tmp_path / "never-stopped"))


@pytest.mark.usefixtures("own_modules")
def test_a_module_beside_an_own_planner_that_has_changed_makes_another_run(tmp_path: Path) -> None:
    (tmp_path / "beside_turn.py").write_text("TURN = 0.1")
    (tmp_path / "turning.py").write_text(TURNING)
    told, out = [f"{tmp_path}/turning.py:Turning"], tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        run(told, out=out, reporter=Log(stop_after=2))
    (tmp_path / "beside_turn.py").write_text("TURN = -0.1")
    del sys.modules["beside_turn"]
    with pytest.raises(
        UsageError, match=r"holds another run.* in planners \(planners\[0\]\.source_sha256 was "
    ) as error:
        run(told, out=out)
    assert "\n" not in str(error.value)


def test_sigterm_counts_as_ctrl_c(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    data, out, advanced = tmp_path / "tiny.npz", tmp_path / "run", count(1)
    save_motion(data, tiny_data(sequences=20))

    def advance(*_: object) -> None:
        if next(advanced) == 2:
            os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr("eval.running.progress.ConsoleReporter.advance", advance)
    told = ["benchmark", "no-act", "oracle", "--data", str(data), "--length", "10", "--workers", "1"]
    with pytest.raises(SystemExit) as ended:
        main([*told, "--starts", "4", "--out", str(out)])
    assert ended.value.code == 130
    assert (
        f"ehar: interrupted: 2 of 6 jobs are in {out}/unfinished; the same command goes on\n" in capsys.readouterr().err
    )
