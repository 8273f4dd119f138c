"""Scaling: how long commands take on one machine and on many, and from where on more machines do not help."""

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean

from ehar.conditions import Conditions
from ehar.errors import EharError, UsageError
from eval.records.config import read_config
from eval.records.job_times import JobTime, read_job_times
from eval.render.tables import Table
from eval.running.cost import Steps, duration, step_seconds
from eval.running.training import TrainAllConfig
from eval.studies.scaling.commands import Asked, needs_of, read_commands
from eval.studies.scaling.costs import Costs, Work, rates_of, sum_of
from recognition.setting import load_recordings_of

LINK = 125e6  # [bytes/s] of a network of 1 Gbit/s, between the first machine and all others together
SENT, BACK = 16.3e6, 109e3  # [bytes] to each machine for a benchmark, and back from a job; measured on solo


@dataclass(frozen=True)
class Times:
    """How long everything takes on some machines [s].

    Args:
        machines: their number.
        shared: all work, shared out to all cores.
        chain: the longest chain of commands that wait for each other.
        transfers: what goes to all machines and back, over one link.
    """

    machines: int
    shared: Steps
    chain: Steps
    transfers: float

    @property
    def predicted(self) -> Steps:
        """From the work or the chain, whichever takes longer, to both one after the other, and the transfers."""
        most = self.shared.most + self.chain.most + self.transfers
        return Steps(max(self.shared.least, self.chain.least), most)


@dataclass(frozen=True)
class Scaling:
    """How commands scale.

    Args:
        jobs: what each job of finished runs took.
        works: the kind of each command, and what it takes, None if nobody knows; None where no commands were given.
        times: how long all of them take on some machines.
        cores: cores of a machine.
        costs: what steps and frames take.
    """

    jobs: tuple[JobTime, ...]
    works: tuple[tuple[str, Work | None], ...] | None
    times: tuple[Times, ...]
    cores: int
    costs: Costs

    @property
    def stops_at(self) -> tuple[float, float]:
        """The numbers of cores from which on the longest chain takes longer than the work that is shared out.

        One if trainings stop as soon as they may, and one if they go on to the end, the lower one first.
        """
        last = self.times[-1]
        found = [
            last.machines * self.cores * share / chain for share, chain in zip(last.shared, last.chain, strict=True)
        ]
        return min(found), max(found)

    def tables(self) -> list[Table]:
        """Return what jobs took, what the commands take, and how long that is on some machines."""
        tables = [self._of_jobs()] if self.jobs else []
        if self.works is not None:
            tables.append(self._of_commands())
        return [*tables, self._of_machines()] if any(work for _, work in self.works or ()) else tables

    def _of_jobs(self) -> Table:
        rows = []
        for name in dict.fromkeys(job.planner for job in self.jobs):
            own = [job for job in self.jobs if job.planner == name]
            seconds = [job.core_seconds for job in own]
            frames = sum(job.episodes * job.frames for job in own) / 1000
            back = mean(job.returned_bytes for job in own) / 1000
            rows.append(
                (
                    name,
                    str(len(own)),
                    f"{mean(seconds):.2f}",
                    f"{max(seconds):.2f}",
                    f"{sum(seconds) / frames:.3f}",
                    f"{back:.0f}",
                )
            )
        return Table(
            title="What jobs took",
            header=("planner", "jobs", "core s a job", "longest", "core s a thousand frames", "KB back a job"),
            rows=tuple(rows),
            footnotes=(
                "A job is a planner on 32 episodes, on a GPU on 512. Time of a core, so it holds on a machine that "
                "does more.",
            ),
        )

    def _of_commands(self) -> Table:
        works, rows = self.works or (), []
        for kind in (*dict.fromkeys(kind for kind, _ in works), None):
            some = [work for name, work in works if kind in (name, None)]
            known = [work for work in some if work is not None]
            total = sum_of([work.total for work in known])
            rows.append((kind or "all", str(len(known)), str(len(some) - len(known) or ""), str(total)))
        footnotes = (
            f"A step of a recogniser's training takes {self.costs.step:.2f} s of a core here. From the least, if "
            "trainings stop as soon as they may, to the most. One that was stopped counts as a whole.",
            "Not counted: what asks for a GPU or other widths, studies that train, and what has no data here.",
        )
        return Table(
            title="What is left" if works else "Nothing is left",
            header=("command", "counted", "not counted", "time of one core"),
            rows=tuple(rows),
            footnotes=footnotes if works else (),
        )

    def _of_machines(self) -> Table:
        few, many = map(math.ceil, self.stops_at)
        return Table(
            title=f"How long it takes, on machines of {self.cores} cores",
            header=("machines", "cores", "work shared out", "longest chain", "transfers", "together"),
            rows=tuple(
                (
                    str(one.machines),
                    str(one.machines * self.cores),
                    str(one.shared),
                    str(one.chain),
                    duration(one.transfers),
                    str(one.predicted),
                )
                for one in self.times
            ),
            footnotes=(
                "Together: from the longer of work shared out and longest chain, at the least, to both one after the "
                "other and the transfers, at the most. Chain: commands that wait for each other, and what of each one "
                "core has to do.",
                f"From {few} to {many} cores on, by how long trainings go on, the longest chain takes longer than the "
                "work shared out: more cores do not help.",
            ),
        )


def scaling(
    runs: Sequence[Path] = (),
    *,
    commands: Path | None = None,
    machines: Sequence[int] = (1, 4, 16, 64),
    cores: int = 16,
    step: float | None = None,
) -> Scaling:
    """Say what jobs took, and how long commands take on one machine and on many.

    Args:
        runs: folders of finished runs, whose jobs tell what planners take; without any, what was measured on solo.
        commands: file of commands, as `make -n` prints them; - reads standard input.
        machines: numbers of machines.
        cores: cores of each machine.
        step: time of one core for a step of a recogniser's training on one person [s]; None times one on solo.

    Raises:
        UsageError: there is neither a run nor a file of commands, or a number is too small.
        EharError: a run or a file cannot be read.
    """
    if not runs and commands is None:
        raise UsageError("scaling: expected a run, or --commands FILE, got neither")
    if cores < 1 or not machines or min(machines) < 1:
        raise UsageError(f"scaling: expected at least 1 machine and 1 core, got {list(machines)} and {cores}")
    if step is not None and not 0 < step < math.inf:
        raise UsageError(f"scaling: expected a step above 0 s, got {step:g}")
    told = {Path(run): (read_job_times(Path(run)), _persons(Path(run))) for run in runs}
    found = tuple(read_commands("" if commands is None else _text_of(commands)))
    if step is None:
        step = step_seconds(TrainAllConfig(conditions=Conditions(data="solo"), out=Path())) if found else 0.0
    costs = Costs(step, rates_of(told))
    works = tuple(costs.work_of(one) for one in found)
    return Scaling(
        jobs=tuple(job for jobs, _ in told.values() for job in jobs),
        works=None if commands is None else tuple((one.kind, work) for one, work in zip(found, works, strict=True)),
        times=tuple(_times(found, works, count, cores) for count in machines),
        cores=cores,
        costs=costs,
    )


def _text_of(commands: Path) -> str:
    try:
        return sys.stdin.read() if str(commands) == "-" else commands.read_text(encoding="utf-8")
    except OSError as error:
        raise UsageError(f"{commands}: expected commands, as `make -n` prints them, got {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UsageError(f"{commands}: expected commands as text in UTF-8, got {error}") from error


def _persons(run: Path) -> int:
    """Return the number of persons in a run's data; 1 if they are not there."""
    told = read_config(run).conditions
    try:
        return load_recordings_of(told).persons
    except EharError:
        return 1


def _times(commands: Sequence[Asked], works: Sequence[Work | None], machines: int, cores: int) -> Times:
    """Return how long commands take on some machines."""
    known: Mapping[int, Work] = {number: work for number, work in enumerate(works) if work is not None}
    ends: dict[int, Steps] = {}
    for number, needed in needs_of(commands).items():
        begin = [max((ends[one][at] for one in needed), default=0.0) for at in range(2)]
        work = known.get(number)
        if work is None:
            ends[number] = Steps(*begin)
            continue
        width = cores * (machines if work.anywhere else 1)
        ends[number] = Steps(
            *(begin[at] + work.alone[at] + (work.total[at] - work.alone[at]) / width for at in range(2))
        )
    total = sum_of([work.total for work in known.values()])
    chain = Steps(*(max((end[at] for end in ends.values()), default=0.0) for at in range(2)))
    jobs, sent = sum(work.jobs for work in known.values()), sum(work.anywhere for work in known.values())
    moved = machines * sent * SENT + jobs * BACK
    return Times(machines, Steps(*(part / (machines * cores) for part in total)), chain, moved / LINK)
