"""Running planners over episodes, one (planner, chunk) after another, here or in worker processes.

Whatever the number of workers, a job computes the same numbers: its chunk, its seeds and its single torch thread
do not depend on where it runs.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import Future, as_completed
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import cloudpickle

from ehar.flight.vehicle import Vehicle
from ehar.motion import GridMotion, Motion
from ehar.planner import Context, Planner
from ehar.processes import worker_pool
from ehar.recogniser import Recogniser
from ehar.rollout import Record, rollout
from ehar.sensors.sensor import Sensor
from eval.records.episodes import EpisodeRecords, join_records, record_episodes
from eval.records.flights import record_flights
from eval.records.solves import Solves, join_solves, solves_of
from eval.running.episodes import Episodes
from eval.running.progress import Reporter
from eval.running.tracks import track_name

if TYPE_CHECKING:
    from ehar.flight.motion import FlightMotion
    from planners.value.belief import BeliefModel


@dataclass(frozen=True, eq=False)
class World:
    """All that a job needs beside its planner and its chunk's index.

    Args:
        episodes: which all planners run.
        recogniser: which all planners see with.
        sensor: which all planners see through.
        vehicle: what carries the camera; None is the ideal track.
        belief: what is scored, in place of the recogniser's own words; planners act the same with it.
    """

    episodes: Episodes
    recogniser: Recogniser
    sensor: Sensor
    vehicle: Vehicle | None = None
    belief: "BeliefModel | None" = None

    def new_motion(self) -> "GridMotion | FlightMotion":
        """Return a new body that moves on the grid, or flies as the vehicle does."""
        if self.vehicle is None:
            return GridMotion()
        from ehar.flight.motion import FlightMotion  # here, as it brings Ruckig, which `ehar --help` does not wait for

        return FlightMotion(vehicle=self.vehicle)


class PlannerRun(NamedTuple):
    """What one planner did in all chunks, or in those that were finished when the run was interrupted."""

    records: EpisodeRecords
    plan_seconds: float
    chunks: int
    solves: Solves | None = None  # of a planner that counts its plans

    @property
    def step_ms(self) -> float:
        """Planning time of one frame of one episode [ms]; the last frame is not planned upon."""
        steps = len(self.records) * max(self.records.predicted.shape[1] - 1, 1)
        return float(1000 * self.plan_seconds / steps)


class _Job(NamedTuple):
    planner: int
    chunk: int


class _Done(NamedTuple):
    records: EpisodeRecords
    plan_seconds: float
    solves: Solves | None


class Interrupted(KeyboardInterrupt):
    """The user stopped the run; `runs` is what each planner had finished by then."""

    def __init__(self, runs: dict[str, PlannerRun]) -> None:
        """Keep what was finished."""
        super().__init__("nothing was written")
        self.runs = runs


def run_planners(
    world: World, planners: Sequence[Planner], *, workers: int, reporter: Reporter
) -> dict[str, PlannerRun]:
    """Run every planner over all episodes.

    Raises:
        EpisodeError: a planner broke its contract.
        Interrupted: Ctrl-C; it carries what was finished.
    """
    jobs = [_Job(planner, chunk) for planner in range(len(planners)) for chunk in range(world.episodes.chunks)]
    done: dict[_Job, _Done] = {}
    reporter.begin(len(jobs))
    try:
        run = _run_here(world, planners, jobs) if workers == 1 else _run_in_workers(world, planners, jobs, workers)
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
            runs[planner.name] = PlannerRun(records, seconds, len(pieces), solves)
    return runs


def roll_chunk(world: World, planner: Planner, chunk: int, motion: Motion) -> Record:
    """Run one planner, carried by a new motion of the world's, over one chunk; what is scored is in the record."""
    from recognition.torch_threads import one_torch_thread  # here, as torch takes seconds to import

    batch = world.episodes.batch(chunk)
    data = world.episodes.scenarios.data
    context = Context(
        episodes=len(batch.labels),
        length=world.episodes.scenarios.length,
        frame_time=1 / data.fps,
        class_names=data.class_names,
        skeleton=data.skeleton,
        workspace=motion.workspace,
        track=track_name(world.vehicle),
        rng=world.episodes.planner_rng(planner.name, chunk),
        vehicle=world.vehicle,
    )
    with one_torch_thread():
        record = rollout(planner, batch, world.recogniser, world.sensor, motion, context)
        if world.belief is not None:
            from planners.value.belief import readout  # here, as it brings scipy, which `ehar --help` does not wait for

            record = replace(record, log_probs=readout(world.belief, record.log_probs, record.viewpoints))
    return record


def _run_chunk(world: World, planner: Planner, chunk: int) -> _Done:
    """Run one planner over one chunk, and keep what is recorded."""
    episodes = world.episodes.chunk(chunk)
    motion = world.new_motion()
    record = roll_chunk(world, planner, chunk, motion)
    records = record_episodes(
        record,
        sequence=episodes.sequence_names,
        first=episodes.first,
        start=episodes.starts,
        label=episodes.labels,
        flight=None if isinstance(motion, GridMotion) else record_flights(motion.telemetry),
    )
    return _Done(records, record.plan_seconds, solves_of(planner))


def _run_here(world: World, planners: Sequence[Planner], jobs: Sequence[_Job]) -> Iterator[tuple[_Job, _Done]]:
    """Run the jobs in this process."""
    for job in jobs:
        yield job, _run_chunk(world, planners[job.planner], job.chunk)


def _run_in_workers(
    world: World, planners: Sequence[Planner], jobs: Sequence[_Job], workers: int
) -> Iterator[tuple[_Job, _Done]]:
    """Run the jobs in processes of their own, each of which is handed the world once."""
    # cloudpickle, so that planners and recognisers defined in a notebook or a script arrive too.
    payloads = [cloudpickle.dumps(planner) for planner in planners]
    futures: dict[Future[_Done], _Job] = {}
    with worker_pool(min(workers, len(jobs)), _start_worker, (cloudpickle.dumps(world),)) as pool:
        for job in jobs:
            futures[pool.submit(_run_in_worker, payloads[job.planner], job.chunk)] = job
        for future in as_completed(futures):
            yield futures[future], future.result()


_worker_world: World


def _start_worker(payload: bytes) -> None:
    """Receive the world, once a process."""
    import torch

    global _worker_world
    torch.set_num_threads(1)
    _worker_world = cloudpickle.loads(payload)


def _run_in_worker(payload: bytes, chunk: int) -> _Done:
    """Run one planner, as pickled, over one chunk."""
    return _run_chunk(_worker_world, cloudpickle.loads(payload), chunk)
