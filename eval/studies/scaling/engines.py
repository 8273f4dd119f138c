"""Engines side by side: the same benchmark by worker processes and by Ray on this machine, in turn."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import get_args

from ehar.conditions import Conditions
from ehar.errors import ModelError, UsageError
from ehar.processes import payload
from eval.records.job_times import JobTime, read_job_times
from eval.records.run_files import EPISODES
from eval.render.tables import Table
from eval.running.benchmark import benchmark
from eval.running.cluster import EngineName
from eval.running.episodes import cut_scenarios, random_starts
from eval.running.jobs import Workload
from eval.running.progress import ConsoleReporter, Reporter
from recognition.setting import load_setting

MOST = 1.3  # times that Ray may take of what processes take


@dataclass(frozen=True)
class EngineTimes:
    """What the same benchmark takes on each engine.

    Args:
        title: what ran.
        workers: number of processes.
        seconds: how long each round took [s], by engine.
        jobs: what each job of the last round took, by engine.
        sent_bytes: size of what all jobs share, sent once to each machine: data, recogniser, sensor, episodes.
    """

    title: str
    workers: int
    seconds: dict[str, tuple[float, ...]]
    jobs: dict[str, tuple[JobTime, ...]]
    sent_bytes: int

    @property
    def ratio(self) -> float:
        """How many times longer Ray takes, by the medians over the rounds."""
        processes, ray = (median(self.seconds[name]) for name in get_args(EngineName))
        return ray / processes

    def tables(self) -> list[Table]:
        """Return one table: a row for each engine."""
        rows, count = [], len(self.seconds["ray"])
        for name, seconds in self.seconds.items():
            jobs = self.jobs[name]
            work = sum(job.core_seconds for job in jobs)
            beside = self.workers * median(seconds) - work
            rows.append(
                (
                    name,
                    f"{median(seconds):.1f}",
                    f"{min(seconds):.1f} to {max(seconds):.1f}",
                    str(len(jobs)),
                    f"{work:.1f}",
                    f"{beside:.1f}",
                    f"{sum(job.returned_bytes for job in jobs) / len(jobs) / 1000:.0f}",
                )
            )
        return [
            Table(
                title=self.title,
                header=("engine", "seconds", "rounds", "jobs", "in jobs [core s]", "beside [core s]", "KB back a job"),
                rows=tuple(rows),
                footnotes=(
                    f"Ray / processes: {self.ratio:.2f} (aim: at most {MOST:g}). Medians over "
                    f"{count} round{'s' * (count > 1)} in turn, {self.workers} processes, from the call to the files, "
                    "Ray's own start included. Both wrote the same episodes, byte for byte.",
                    f"Sent once to each machine: {self.sent_bytes / 1e6:.1f} MB. Beside: what the processes were there "
                    "for while no job ran: start, transfers, summary, and waiting at the end.",
                ),
            )
        ]


def engines(
    planners: Sequence[str] | None = None,
    conditions: Conditions | None = None,
    *,
    rounds: int = 3,
    workers: int = 1,
    reporter: Reporter | None = None,
) -> EngineTimes:
    """Run the same benchmark by processes and by Ray, in turn, and say what each takes.

    Args:
        planners: names; None means all of ours that can run.
        conditions: conditions of the benchmark; None means the usual ones.
        rounds: how often each engine runs.
        workers: number of processes.
        reporter: is told of progress; None reports on standard error.

    Raises:
        UsageError: there are no rounds, or Ray is not installed.
        ModelError: the engines wrote different episodes.
        EharError: as `benchmark`.
    """
    if rounds < 1:
        raise UsageError(f"rounds: expected at least 1, got {rounds}")
    told, heard, count = conditions or Conditions(), reporter or ConsoleReporter(), workers
    seconds: dict[str, list[float]] = {name: [] for name in get_args(EngineName)}
    jobs: dict[str, tuple[JobTime, ...]] = {}
    with TemporaryDirectory(prefix="ehar-") as folder:
        for _ in range(rounds):
            for name in get_args(EngineName):
                out = Path(folder) / name
                begin = time.perf_counter()
                run = benchmark(planners, told, out=out, workers=count, engine=name, reporter=heard)
                seconds[name].append(time.perf_counter() - begin)
                jobs[name] = read_job_times(out)
        written = [(Path(folder) / name / EPISODES).read_bytes() for name in get_args(EngineName)]
    if written[0] != written[1]:
        raise ModelError("engines: expected the same episodes from processes and from Ray, got others")
    setting = load_setting(told)
    scenarios = cut_scenarios(setting.recordings, setting.sequences, setting.conditions.frames, lambda _: None)
    episodes = random_starts(scenarios, told.starts, told.seed, setting.world)
    return EngineTimes(
        title=f"Engines: {run.config.title}",
        workers=count,
        seconds={name: tuple(took) for name, took in seconds.items()},
        jobs=jobs,
        sent_bytes=len(payload(Workload(setting.runner, episodes), "the benchmark")),
    )
