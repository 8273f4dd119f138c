"""A finished run, read back from its folder: its conditions, its records, and the names of its classes."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TypeVar

import numpy as np

from ehar.errors import DataError, EharError, UsageError
from eval.records.config import read_config
from eval.records.episodes import EpisodeRecords, read_episodes
from eval.records.run_files import EPISODES, SUMMARY, RunConfig
from eval.running.tracks import IDEAL
from eval.scores.seed_accuracy import pool_seeds
from eval.scores.training_seeds import first_trainings

Held = TypeVar("Held")


@dataclass(frozen=True)
class RunConditions:
    """What config.json says of the episodes of a run, as in `RunConfig`; what else it holds is left."""

    source: str
    data: str
    data_sha256: str
    models: str | None
    recogniser_sha256: str
    sensor: str
    views: str
    form: str
    track: str
    readout: str
    part: str
    starts: int
    seed: int
    length: int
    fps: float | None

    @property
    def title(self) -> str:
        """What a figure or a table of this run is headed with."""
        return f"{self.data}, {self.sensor} sensor, {self.views} views, {self.track} track" + (
            ", as believed" if self.readout == "belief" else ""
        )


@dataclass(frozen=True, eq=False)
class FinishedRun:
    """What a run's folder holds.

    Args:
        directory: the folder.
        config: from config.json.
        records: of each planner, by the name that it ran under.
    """

    directory: Path
    config: RunConfig
    records: Mapping[str, EpisodeRecords]

    @property
    def conditions(self) -> RunConditions:
        """What the configuration says of the episodes."""
        return RunConditions(**{field.name: getattr(self.config, field.name) for field in fields(RunConditions)})

    @property
    def flown(self) -> bool:
        """Whether a vehicle carried the cameras."""
        return self.conditions.track != IDEAL

    def episodes(self, name: str) -> EpisodeRecords:
        """Return the records of a planner, those of all its training seeds together.

        Raises:
            UsageError: it is not among the run's planners.
        """
        return self._of({**pool_seeds(self.records), **self.records}, name)

    def record_name(self, name: str) -> str:
        """Return the name of a planner's record, that of the first training where several go by this name.

        Raises:
            UsageError: it is not among the run's planners.
        """
        return self._of({**first_trainings(self.records), **{record: record for record in self.records}}, name)

    def _of(self, named: Mapping[str, Held], name: str) -> Held:
        if name not in named:
            raise UsageError(f"{self.directory}: no planner {name!r}; expected one of: {', '.join(named)}")
        return named[name]


def read_run(directory: Path) -> FinishedRun:
    """Read a run of `ehar benchmark`.

    Raises:
        UsageError: the folder holds no such run, or one of another schema.
        DataError: its files cannot be read, it is incomplete, as one that was interrupted, or planners ran different
            episodes.
    """
    config = read_config(directory)
    records = read_episodes(directory / EPISODES)
    reason = why_incomplete(directory, config, records)
    if reason is not None:
        raise DataError(f"{directory}: expected a finished run, this one is incomplete: {reason}")
    names = list(records)
    for name in names[1:]:
        if not same_episodes(records[names[0]], records[name]):
            raise DataError(
                f"{directory}: expected the same episodes for every planner, those of {name} are not {names[0]}'s"
            )
    return FinishedRun(directory, config, records)


def why_incomplete(directory: Path, config: RunConfig, records: Mapping[str, EpisodeRecords]) -> str | None:
    """Return what a run lacks, such as one that was interrupted; None where it was finished."""
    absent = [planner.name for planner in config.planners if planner.name not in records]
    if absent or not records:
        return f"no episodes of {', '.join(absent) or 'any planner'}"
    most = max(len(episodes) for episodes in records.values())
    for name, episodes in records.items():
        if len(episodes) < most:
            return f"{name} has {len(episodes)} of {most} episodes"
    return None if (directory / SUMMARY).is_file() else f"no {SUMMARY}"


def same_episodes(one: EpisodeRecords, other: EpisodeRecords) -> bool:
    """Return whether records are of the same windows of the same sequences, from the same starts, in one order."""
    return (
        one.sequence == other.sequence
        and one.predicted.shape == other.predicted.shape
        and all(np.array_equal(getattr(one, key), getattr(other, key)) for key in ("first", "start", "label"))
    )


def class_names(run: FinishedRun, note: Callable[[str], None], source: str | Path | None = None) -> tuple[str, ...]:
    """Return the names of the run's classes; numbers, and a note why, where its data is not here any more.

    Args:
        run: the run.
        note: told the reason.
        source: where its data lie now; None is where they lay.

    Raises:
        EharError: what was asked for by `source` cannot be read.
    """
    from ehar.data.source import load_data

    conditions = run.conditions
    place = conditions.source if source is None else source
    try:
        data = load_data(place, fps=conditions.fps)
        reason = None if data.sha256 == conditions.data_sha256 else f"{place}: not the data of the run"
    except EharError as error:
        if source is not None:
            raise
        reason = str(error)
    if reason is None:
        return data.class_names
    note(f"classes are numbered, as their names cannot be read: {reason}")
    return tuple(f"class {label}" for label in range(max(int(of.label.max()) for of in run.records.values()) + 1))
