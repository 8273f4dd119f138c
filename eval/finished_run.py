"""A finished run, read back from its folder: its conditions, its records, and the names of its classes."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, get_args, get_type_hints

import numpy as np

from ehar.errors import DataError, EharError, UsageError
from eval.records import EpisodeRecords, read_episodes
from eval.results import CONFIG, EPISODES
from eval.seed_accuracy import pool_seeds
from eval.tracks import IDEAL


@dataclass(frozen=True)
class RunConditions:
    """What config.json says of the episodes of a run, as in `eval.results.RunConfig`; what else it holds is left."""

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
        conditions: from config.json.
        records: of each planner, by the name that it ran under.
    """

    directory: Path
    conditions: RunConditions
    records: Mapping[str, EpisodeRecords]

    @property
    def flown(self) -> bool:
        """Whether a vehicle carried the cameras."""
        return self.conditions.track != IDEAL

    def episodes(self, name: str) -> EpisodeRecords:
        """Return the records of a planner, those of all its training seeds together.

        Raises:
            UsageError: it is not among the run's planners.
        """
        pooled = {**pool_seeds(self.records), **self.records}
        if name not in pooled:
            raise UsageError(f"{self.directory}: no planner {name!r}; expected one of: {', '.join(pooled)}")
        return pooled[name]


def read_run(directory: Path) -> FinishedRun:
    """Read a run of `ehar benchmark`.

    Raises:
        UsageError: the folder holds no such run.
        DataError: its files cannot be read, or planners ran different episodes, as in a run that was interrupted.
    """
    path = directory / CONFIG
    try:
        held = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"{path}: expected a finished run of ehar benchmark, got: {error.strerror}") from error
    except ValueError as error:
        raise DataError(f"{path}: expected the JSON of a run, got {error}") from error
    conditions = _conditions(path, held)
    records = read_episodes(directory / EPISODES)
    if not records:
        raise DataError(f"{directory / EPISODES}: expected the episodes of a run, got none")
    names = list(records)
    for name in names[1:]:
        if not same_episodes(records[names[0]], records[name]):
            raise DataError(
                f"{directory}: expected a finished run with the same episodes for every planner; those of {name} "
                f"({len(records[name])}) are not those of {names[0]} ({len(records[names[0]])})"
            )
    return FinishedRun(directory, conditions, records)


def same_episodes(one: EpisodeRecords, other: EpisodeRecords) -> bool:
    """Return whether records are of the same windows of the same sequences, from the same starts, in one order."""
    return (
        one.sequence == other.sequence
        and one.predicted.shape == other.predicted.shape
        and all(np.array_equal(getattr(one, key), getattr(other, key)) for key in ("first", "start", "label"))
    )


def class_names(run: FinishedRun, note: Callable[[str], None]) -> tuple[str, ...]:
    """Return the names of the run's classes; numbers, and a note why, where its data is not here any more."""
    from ehar.datasets.source import load_data

    conditions = run.conditions
    try:
        data = load_data(conditions.source, fps=conditions.fps)
        reason = None if data.sha256 == conditions.data_sha256 else f"{conditions.source}: not the data of the run"
    except EharError as error:
        reason = str(error)
    if reason is None:
        return data.class_names
    note(f"classes are numbered, as their names cannot be read: {reason}")
    return tuple(f"class {label}" for label in range(max(int(of.label.max()) for of in run.records.values()) + 1))


def _conditions(path: Path, held: Any) -> RunConditions:
    """Return the conditions in a parsed config.json."""
    hints = get_type_hints(RunConditions)
    names = [field.name for field in fields(RunConditions)]
    missing = [name for name in names if not isinstance(held, dict) or name not in held]
    if missing:
        raise UsageError(f"{path}: expected a run of ehar benchmark, its {', '.join(missing)} missing")
    for name in names:
        kinds = get_args(hints[name]) or (hints[name],)
        # A number may be written as a whole one.
        if not isinstance(held[name], (*kinds, int) if float in kinds else kinds):
            raise DataError(f"{path}: {name}: expected {hints[name]}, got {held[name]!r}")
    return RunConditions(**{name: held[name] for name in names})
