"""The finished jobs of a run that is not finished, on disk: a run that was killed goes on from them."""

import fcntl
import hashlib
import os
import pickle
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from ehar.errors import DataError, EharError, EpisodeError, UsageError
from ehar.files import json_text, read_json, write_text
from eval.records.code import code_sha256
from eval.records.config import CONFIG, UNFINISHED, RunConfig
from eval.records.episode_lines import episode_lines, read_episodes
from eval.records.job_times import JOB_TIMES, JobTime, write_job_times
from eval.records.run_files import SUMMARY, TABLE
from eval.records.solves import Solves
from eval.running.jobs import Done, Job
from eval.running.run import Run

CODE = "code"  # holds the hash of the code that ran the jobs


@dataclass(frozen=True)
class _Told:
    """What the JSON of a job says beside its episodes.

    Args:
        plan_seconds: time in the planner [s].
        solves: counts of its plans; None for a planner that does not count.
        episodes_sha256: hash of its episodes' file.
        time: what it took.
    """

    plan_seconds: float
    solves: Solves | None
    episodes_sha256: str
    time: JobTime


@dataclass(frozen=True)
class UnfinishedRun:
    """A folder `unfinished` in that of a run: its config.json, the hash of the code, and two files for each done job.

    `3-12.jsonl` has the episodes of planner 3 in chunk 12, counted from 0, as episodes.jsonl has them. `3-12.json` has
    the rest, and the hash of the episodes. It is written last, so a job that has both is whole. A job whose files are
    damaged counts as not done.

    Args:
        out: folder of the run.
        config: configuration of the run.
    """

    out: Path
    config: RunConfig

    @property
    def folder(self) -> Path:
        """The folder of the finished jobs."""
        return self.out / UNFINISHED

    @contextmanager
    def opened(self, jobs: Sequence[Job], *, anew: bool, note: Callable[[str], None]) -> Iterator[None]:
        """Hold the folder for this process; the system gives it back however the process ends.

        If a planner, a sensor or a motion breaks its contract, the folder is removed: the same run would break again.

        Args:
            jobs: all jobs of the run.
            anew: whether to forget the jobs that are done; those of other code are forgotten as well.
            note: is told how many jobs are done, or forgotten.

        Raises:
            UsageError: the folder cannot be written to, or another process holds it.
            KeyboardInterrupt: Ctrl-C; it says what is kept.
        """
        with self._locked():
            code, done = self.folder / CODE, sum(job in self for job in jobs)
            ours = code.exists() and code.read_text(encoding="utf-8") == code_sha256()
            if done and not ours and not anew:
                note(f"{self.out}: begins anew; {done} of {len(jobs)} jobs were done by other code")
            if anew or not ours or not (self.folder / CONFIG).exists():  # nobody knows whose jobs those without one are
                for path in self.folder.glob("*-*.json*"):
                    path.unlink()
            write_text(self.folder / CONFIG, [json_text(self.config.to_json())])
            write_text(code, [code_sha256()])
            done = sum(job in self for job in jobs)
            if done:
                note(f"{self.out}: goes on; {done} of {len(jobs)} jobs are done")
            try:
                yield
            except KeyboardInterrupt:
                done = sum(job in self for job in jobs)
                if not done:
                    self._remove()
                kept = f"{done} of {len(jobs)} jobs are in {self.folder}; the same command goes on"
                raise KeyboardInterrupt(kept if done else "nothing was written") from None
            except EpisodeError:
                self._remove()
                raise

    def finish(self, run: Run, jobs: Sequence[Job]) -> None:
        """Write a run, and what its jobs took, to its folder, and remove this one.

        All files are written here first, so a process that is killed leaves no half of a file beside them.

        Raises:
            UsageError: a file cannot be written.
        """
        whole = self.folder / "whole"
        shutil.rmtree(whole, ignore_errors=True)
        run.save(whole)
        write_job_times(whole / JOB_TIMES, [self._told(job).time for job in jobs])
        try:
            # The configuration goes first: files without one are taken for somebody else's. A run counts as whole by
            # its summary, and as done by its table: they go last, and those of before are removed.
            for name in (TABLE, SUMMARY):
                (self.out / name).unlink(missing_ok=True)
            order = {CONFIG: 0, SUMMARY: 2, TABLE: 3}
            for path in sorted(whole.iterdir(), key=lambda path: order.get(path.name, 1)):
                path.replace(self.out / path.name)
        except OSError as error:
            raise UsageError(f"{self.out}: cannot be written: {error.strerror}") from error
        self._remove()

    def __contains__(self, job: object) -> bool:
        """Return whether a job is done, and its files are whole."""
        if not isinstance(job, Job):
            return False
        try:
            return self._told(job).episodes_sha256 == _sha256(self._episodes(job))
        except (EharError, OSError):
            return False

    def __setitem__(self, job: Job, done: Done) -> None:
        """Keep the result of a job.

        Raises:
            UsageError: it cannot be written, for example because the disk is full.
        """
        path = self._episodes(job)
        write_text(path, episode_lines({self._planner(job): done.records}))
        episodes, frames = done.records.predicted.shape
        took = JobTime(self._planner(job), episodes, frames, done.core_seconds, len(pickle.dumps(done)))
        told = _Told(done.plan_seconds, done.solves, _sha256(path), took)
        write_text(path.with_suffix(".json"), [json_text(asdict(told))])

    def __getitem__(self, job: Job) -> Done:
        """Return the result of a job that is done.

        Raises:
            EharError: its files are missing or damaged.
        """
        told, path = self._told(job), self._episodes(job)
        records = read_episodes(path)
        if list(records) != [self._planner(job)]:
            raise DataError(f"{path}: expected episodes of {self._planner(job)}, got those of {', '.join(records)}")
        return Done(records[self._planner(job)], told.plan_seconds, told.solves, told.time.core_seconds)

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Make the folder, and hold it: two processes would remove each other's files."""
        lock = self.folder / "lock"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            held = os.open(lock, os.O_CREAT | os.O_RDWR, 0o644)
        except OSError as error:
            raise UsageError(f"{lock}: cannot be written: {error.strerror}") from error
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(held)
            raise UsageError(f"{self.out}: expected one process to write this run, another one does already") from None
        except OSError:
            pass  # some network file systems have no locks
        try:
            yield
        finally:
            os.close(held)

    def _remove(self) -> None:
        """Remove the folder, and that of the run if nothing else is in it."""
        shutil.rmtree(self.folder, ignore_errors=True)
        with suppress(OSError):
            self.out.rmdir()

    def _planner(self, job: Job) -> str:
        return self.config.planners[job.planner].name

    def _episodes(self, job: Job) -> Path:
        return self.folder / f"{job.planner}-{job.chunk}.jsonl"

    def _told(self, job: Job) -> _Told:
        return read_json(self._episodes(job).with_suffix(".json"), _Told, "a finished job")


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
