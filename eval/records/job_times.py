"""What each job of a run took, in jobs.json: it decides no figure, and differs from run to run."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from ehar.files import json_text, read_json, write_text

JOB_TIMES = "jobs.json"


@dataclass(frozen=True)
class JobTime:
    """What a job took.

    Args:
        planner: record name of its planner.
        episodes: number of episodes.
        frames: number of frames of an episode.
        core_seconds: time of a core [s]; on a GPU that of the processor beside it.
        returned_bytes: size of its result, as it is sent back.
    """

    planner: str
    episodes: int
    frames: int
    core_seconds: float
    returned_bytes: int


@dataclass(frozen=True)
class _File:
    jobs: tuple[JobTime, ...]


def write_job_times(path: Path, jobs: Sequence[JobTime]) -> None:
    """Write the jobs of a run.

    Raises:
        UsageError: the file cannot be written.
    """
    write_text(path, [json_text(asdict(_File(tuple(jobs))))])


def read_job_times(folder: Path) -> tuple[JobTime, ...]:
    """Return the jobs of a run.

    Raises:
        EharError: there is no jobs.json, for example because the run is older than it; or it is malformed.
    """
    return read_json(folder / JOB_TIMES, _File, "the times of a run's jobs, as `ehar benchmark --out` writes them").jobs
