"""Runs planners over episodes in jobs of one planner and one chunk: here, in worker processes, or on a cluster.

A job computes the same numbers for any number of workers: its chunk, its seeds and its single torch thread do not
depend on where it runs. On a GPU a job has several chunks in lockstep; each keeps its noise and its planner's random
numbers, so that only rounding differs.
"""

from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property
from time import process_time
from typing import TYPE_CHECKING, NamedTuple, Protocol

import cloudpickle

from ehar.batch import Batch
from ehar.motion import Motion
from ehar.planner import Planner
from ehar.processes import Engine, Processes, payload
from ehar.rollout import Record
from ehar.runner import Runner
from eval.records.contacts import contacts_of
from eval.records.episodes import EpisodeRecords, join_records, record_episodes
from eval.records.flights import flights_of, tracking_of
from eval.records.one_by_one import OneByOne
from eval.records.solves import Solves, join_solves, solves_of
from eval.running.episodes import Episodes
from eval.running.progress import Reporter
from eval.running.side_by_side import SideBySide

if TYPE_CHECKING:
    from planners.value.belief.clips import BeliefModel
    from planners.value.belief.streams import StreamBeliefModel


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
    belief: "BeliefModel | StreamBeliefModel | None" = None
    together: int = 1

    @cached_property
    def followed(self) -> Episodes:
        """The episodes as they are run: in streams the centre keeps the limits of the vehicle that follows it."""
        return replace(self.episodes, scenarios=self.runner.followed(self.episodes.scenarios))

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
                # Imported here: it brings scipy, too slow for `ehar --help`.
                from planners.value.belief.recorded import read_belief

                said, seen_from, fps = record.log_probs, record.viewpoints, self.runner.data.fps
                record = replace(record, log_probs=read_belief(self.belief, said, seen_from, fps=fps))
        return record


class PlannerRun(NamedTuple):
    """The records of one planner in all chunks."""

    records: EpisodeRecords
    plan_seconds: float
    solves: Solves | None = None  # only of a planner that counts its plans

    @property
    def step_ms(self) -> float:
        """Planning time of one frame of one episode [ms]; the last frame needs no plan."""
        steps = len(self.records) * max(self.records.predicted.shape[1] - 1, 1)
        return float(1000 * self.plan_seconds / steps)


class Job(NamedTuple):
    """One planner on one chunk, by their numbers."""

    planner: int
    chunk: int  # the first one


class Done(NamedTuple):
    """The result of a job."""

    records: EpisodeRecords
    plan_seconds: float
    solves: Solves | None
    core_seconds: float = 0.0  # of a core, from the start viewpoints to the records


class FinishedJobs(Protocol):
    """Keeps the results of jobs, as a dict does; on disk they outlive the process."""

    def __contains__(self, job: object, /) -> bool:
        """Return whether a job is done."""
        ...

    def __setitem__(self, job: Job, done: Done, /) -> None:
        """Keep the result of a job."""
        ...

    def __getitem__(self, job: Job, /) -> Done:
        """Return the result of a job that is done."""
        ...


def jobs_of(planners: int, workload: Workload) -> list[Job]:
    """Return the jobs of so many planners on all episodes, in the order of the records."""
    firsts = range(0, workload.episodes.chunks, workload.together)
    return [Job(planner, first) for planner in range(planners) for first in firsts]


def run_planners(
    workload: Workload,
    planners: Sequence[Planner],
    *,
    engine: Engine,
    reporter: Reporter,
    finished: FinishedJobs | None = None,
) -> Mapping[str, PlannerRun]:
    """Run every planner over all episodes.

    Args:
        workload: what all jobs share.
        planners: the planners, with different names.
        engine: runs the jobs.
        reporter: is told of progress.
        finished: keeps results; the jobs that it has are not run again. None keeps them in memory.

    Returns:
        the runs of all planners. Those in `finished` stay there: each is read when it is asked for.

    Raises:
        EpisodeError: a planner broke its contract.
        UsageError: a result cannot be kept, or a planner cannot be sent to workers.
        ModelError: a worker, or the cluster, has ended.
        KeyboardInterrupt: Ctrl-C.
    """
    results: FinishedJobs = {} if finished is None else finished
    jobs = jobs_of(len(planners), workload)
    missing = [job for job in jobs if job not in results]
    reporter.begin(len(missing))
    try:
        if engine == Processes(1):
            run = _run_here(workload, planners, missing)
        else:
            sent = workload, [payload(planner, f"planner {planner.name!r}") for planner in planners]
            run = engine.each_batch(_run_sent, sent, missing)
        with closing(run):  # processes end before an error is passed on
            for job, result in run:
                results[job] = result
                reporter.advance(planners[job.planner].name)
    except KeyboardInterrupt:
        raise KeyboardInterrupt("nothing was written") from None  # who keeps finished jobs says so instead
    finally:
        reporter.end()
    numbers = {planner.name: number for number, planner in enumerate(planners)}
    runs = OneByOne(list(numbers), lambda name: _joined([results[job] for job in jobs if job.planner == numbers[name]]))
    return dict(runs) if finished is None else runs


def _joined(pieces: Sequence[Done]) -> PlannerRun:
    """Return the results of one planner in all chunks."""
    return PlannerRun(
        join_records([piece.records for piece in pieces]),
        sum(piece.plan_seconds for piece in pieces),
        join_solves([piece.solves for piece in pieces]),
    )


def _run_chunks(workload: Workload, planner: Planner, first: int) -> Done:
    """Run one planner over the chunks of a job, and return its records."""
    begin = process_time()
    together = range(first, min(first + workload.together, workload.episodes.chunks))
    parts = [workload.episodes.chunk(chunk) for chunk in together]
    planners, rolled = (planner,), planner
    if len(parts) > 1 and not planner.privileged:  # the truth is that of a whole batch, so its planner is one
        sent = payload(planner, f"planner {planner.name!r}")
        planners = tuple(cloudpickle.loads(sent) for _ in parts)
        generators = [workload.episodes.planner_rng(planner.name, chunk) for chunk in together]
        rolled = SideBySide(planners, [len(part) for part in parts], generators)
    motion = workload.runner.new_motion()
    batch = workload.followed.batches(together)
    record = workload.roll(rolled, batch, first, motion)
    episodes = workload.episodes.chunk(first, len(parts))
    records = record_episodes(
        record,
        sequence=episodes.sequence_names,
        first=episodes.first,
        start=episodes.starts,
        label=episodes.labels,
        subjects=episodes.subjects,
        flight=flights_of(motion),
        contacts=contacts_of(batch.surroundings, record.viewpoints),
        tracking_error=tracking_of(motion),
    )
    solves = join_solves([solves_of(one) for one in planners])
    return Done(records, record.plan_seconds, solves, process_time() - begin)


def _run_here(
    workload: Workload, planners: Sequence[Planner], jobs: Sequence[Job]
) -> Generator[tuple[Job, Done], None, None]:
    """Run the jobs in this process."""
    for job in jobs:
        yield job, _run_chunks(workload, planners[job.planner], job.chunk)


def _run_sent(sent: tuple[Workload, Sequence[bytes]], job: Job) -> Done:
    """Run a job in another process, with a fresh copy of its planner."""
    workload, planners = sent
    return _run_chunks(workload, cloudpickle.loads(planners[job.planner]), job.chunk)
