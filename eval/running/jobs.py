"""Runs planners over episodes in jobs of one planner and one chunk, here or in worker processes.

A job computes the same numbers for any number of workers: its chunk, its seeds and its single torch thread do not
depend on where it runs. On a GPU a job has several chunks in lockstep; each keeps its noise and its planner's random
numbers, so that only rounding differs.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import Future, as_completed
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import cloudpickle

from ehar.motion import Motion
from ehar.planner import Planner
from ehar.processes import payload, worker_pool
from ehar.rollout import Batch, Record
from ehar.runner import Runner
from eval.records.episodes import EpisodeRecords, join_records, record_episodes
from eval.records.flights import flights_of
from eval.records.solves import Solves, join_solves, solves_of
from eval.running.episodes import Episodes
from eval.running.progress import Reporter
from eval.running.side_by_side import SideBySide

if TYPE_CHECKING:
    from planners.value.belief import BeliefModel


@dataclass(frozen=True, eq=False)
class Workload:
    """All that jobs share: a job adds its planner and the index of its first chunk.

    Args:
        runner: runs all planners.
        episodes: the episodes that all planners run.
        belief: gives the scored probabilities in place of the recogniser; planners act the same with it.
        together: number of chunks that run in lockstep.
    """

    runner: Runner
    episodes: Episodes
    belief: "BeliefModel | None" = None
    together: int = 1

    def roll(self, planner: Planner, batch: Batch, chunk: int, motion: Motion) -> Record:
        """Run one planner over a batch; the record has the scored probabilities.

        Args:
            planner: decides where to look from.
            batch: the episodes.
            chunk: index of the chunk, which decides the planner's generator.
            motion: carries the camera.
        """
        from recognition.torch_threads import one_torch_thread  # imported here: torch takes seconds

        with one_torch_thread():
            record = self.runner.roll(planner, batch, self.episodes.planner_rng(planner.name, chunk), motion)
            if self.belief is not None:
                from planners.value.belief import readout  # imported here: it brings scipy, too slow for `ehar --help`

                record = replace(record, log_probs=readout(self.belief, record.log_probs, record.viewpoints))
        return record


class PlannerRun(NamedTuple):
    """The records of one planner in all chunks, or in those that were finished when the run was interrupted."""

    records: EpisodeRecords
    plan_seconds: float
    chunks: int
    solves: Solves | None = None  # only of a planner that counts its plans

    @property
    def step_ms(self) -> float:
        """Planning time of one frame of one episode [ms]; the last frame needs no plan."""
        steps = len(self.records) * max(self.records.predicted.shape[1] - 1, 1)
        return float(1000 * self.plan_seconds / steps)


class _Job(NamedTuple):
    planner: int
    chunk: int  # the first one


class _Done(NamedTuple):
    records: EpisodeRecords
    plan_seconds: float
    solves: Solves | None
    chunks: int


class Interrupted(KeyboardInterrupt):
    """The user stopped the run; `runs` holds the chunks that each planner had finished."""

    def __init__(self, runs: dict[str, PlannerRun]) -> None:
        """Keep what was finished."""
        super().__init__("nothing was written")
        self.runs = runs


def run_planners(
    workload: Workload, planners: Sequence[Planner], *, workers: int, reporter: Reporter
) -> dict[str, PlannerRun]:
    """Run every planner over all episodes.

    Raises:
        EpisodeError: a planner broke its contract.
        Interrupted: Ctrl-C; it carries what was finished.
    """
    jobs = [
        _Job(planner, chunk)
        for planner in range(len(planners))
        for chunk in range(0, workload.episodes.chunks, workload.together)
    ]
    done: dict[_Job, _Done] = {}
    reporter.begin(len(jobs))
    try:
        run = (
            _run_here(workload, planners, jobs) if workers == 1 else _run_in_workers(workload, planners, jobs, workers)
        )
        for job, result in run:
            done[job] = result
            reporter.advance(planners[job.planner].name)
    except KeyboardInterrupt:
        raise Interrupted(_join(planners, done)) from None
    finally:
        reporter.end()
    return _join(planners, done)


def _join(planners: Sequence[Planner], done: dict[_Job, _Done]) -> dict[str, PlannerRun]:
    """Return the finished chunks of each planner that has any, in order."""
    runs = {}
    for index, planner in enumerate(planners):
        pieces = [done[job] for job in sorted(done) if job.planner == index]
        if pieces:
            records = join_records([piece.records for piece in pieces])
            seconds, solves = (
                sum(piece.plan_seconds for piece in pieces),
                join_solves([piece.solves for piece in pieces]),
            )
            runs[planner.name] = PlannerRun(records, seconds, sum(piece.chunks for piece in pieces), solves)
    return runs


def _run_chunks(workload: Workload, planner: Planner, first: int) -> _Done:
    """Run one planner over the chunks of a job, and return its records."""
    together = range(first, min(first + workload.together, workload.episodes.chunks))
    parts = [workload.episodes.chunk(chunk) for chunk in together]
    planners, rolled = (planner,), planner
    if len(parts) > 1 and not planner.privileged:  # the truth is that of a whole batch, so its planner is one
        sent = payload(planner, f"planner {planner.name!r}")
        planners = tuple(cloudpickle.loads(sent) for _ in parts)
        generators = [workload.episodes.planner_rng(planner.name, chunk) for chunk in together]
        rolled = SideBySide(planners, [len(part) for part in parts], generators)
    motion = workload.runner.new_motion()
    record = workload.roll(rolled, workload.episodes.batches(together), first, motion)
    episodes = workload.episodes.chunk(first, len(parts))
    records = record_episodes(
        record,
        sequence=episodes.sequence_names,
        first=episodes.first,
        start=episodes.starts,
        label=episodes.labels,
        subjects=episodes.subjects,
        flight=flights_of(motion),
    )
    return _Done(records, record.plan_seconds, join_solves([solves_of(one) for one in planners]), len(parts))


def _run_here(workload: Workload, planners: Sequence[Planner], jobs: Sequence[_Job]) -> Iterator[tuple[_Job, _Done]]:
    """Run the jobs in this process."""
    for job in jobs:
        yield job, _run_chunks(workload, planners[job.planner], job.chunk)


def _run_in_workers(
    workload: Workload, planners: Sequence[Planner], jobs: Sequence[_Job], workers: int
) -> Iterator[tuple[_Job, _Done]]:
    """Run the jobs in worker processes; each process receives the workload once."""
    payloads = [payload(planner, f"planner {planner.name!r}") for planner in planners]
    everything = payload(workload, "the recogniser, the sensor or the motion")
    futures: dict[Future[_Done], _Job] = {}
    with worker_pool(min(workers, len(jobs)), _start_worker, sent=(everything,)) as pool:
        for job in jobs:
            futures[pool.submit(_run_in_worker, payloads[job.planner], job.chunk)] = job
        for future in as_completed(futures):
            yield futures[future], future.result()


_worker_workload: Workload


def _start_worker(sent: bytes) -> None:
    """Receive the workload, once in each process."""
    import torch

    global _worker_workload
    torch.set_num_threads(1)
    _worker_workload = cloudpickle.loads(sent)


def _run_in_worker(sent: bytes, chunk: int) -> _Done:
    """Unpickle a planner, and run it over one chunk."""
    return _run_chunks(_worker_workload, cloudpickle.loads(sent), chunk)
