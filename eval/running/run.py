"""A run of the benchmark, in memory or in a folder: its configuration, records and summary."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ehar.conditions import Conditions
from ehar.errors import DataError, EharError, UsageError
from ehar.files import json_text, write_text
from ehar.track import IDEAL
from eval.records.config import CONFIG, RunConfig, read_config
from eval.records.episode_lines import episode_lines, read_episodes, stored_episodes
from eval.records.episodes import EpisodeRecords
from eval.records.flights import held_flight
from eval.records.one_by_one import OneByOne
from eval.records.run_files import EPISODES, SUMMARY, TABLE, check_out
from eval.scores.answers import episodes_only
from eval.scores.closing import closing_sentences
from eval.scores.metrics import ACC_AT, mean_acc, path_length, right_at
from eval.scores.resampling.training_seeds import curves, first_trainings
from eval.scores.seed_accuracy import pool_seeds
from eval.scores.streams.activities import activities
from eval.scores.summary import Summary, read_summary

if TYPE_CHECKING:
    import pandas

    from eval.render.tables import Table

Held = TypeVar("Held")


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """A run of the benchmark. It prints as its table, in a notebook as HTML.

    Args:
        config: its configuration.
        records: records of each planner, by record name; arrays start with N episodes.
        class_names: K class names.
        made: the summary; None reads it from the folder.
        directory: folder that the run was read from; None for a run in memory.
    """

    config: RunConfig
    records: Mapping[str, EpisodeRecords]
    class_names: tuple[str, ...] | None = None
    made: Summary | None = None
    directory: Path | None = None

    @cached_property
    def summary(self) -> Summary:
        """The results of each planner.

        Raises:
            UsageError: the folder has no summary.json, for example because the run was interrupted.
            DataError: summary.json does not belong to the records.
        """
        if self.made is not None:
            return self.made
        return read_summary(self.folder / SUMMARY, self.config, self.records)

    @property
    def folder(self) -> Path:
        """The folder that the run was read from.

        Raises:
            UsageError: the run is only in memory.
        """
        if self.directory is None:
            raise UsageError("expected a run in a folder, this one is in memory: save it, or give the benchmark `out`")
        return self.directory

    @property
    def conditions(self) -> Conditions:
        """The conditions of the run, with names in place of objects."""
        return self.config.conditions

    @cached_property
    def of_streams(self) -> bool:
        """Whether one activity follows another in an episode."""
        return next(iter(self.records.values())).of_streams if self.records else False

    @property
    def scored(self) -> Mapping[str, EpisodeRecords]:
        """The records that accuracies are taken of, by record name: of streams, an episode for each activity."""
        if not self.of_streams:
            return self.records
        return OneByOne(list(self.records), lambda name: activities(self.records[name]))

    @property
    def flown(self) -> bool:
        """Whether a vehicle carried the cameras."""
        return self.config.vehicle is not None or self.conditions.track != IDEAL

    def episodes(self, name: str) -> EpisodeRecords:
        """Return the records of a planner, with all its training seeds together.

        Raises:
            UsageError: the run has no such planner.
        """
        pooled = pool_seeds(self.records)
        held = {**dict.fromkeys(pooled, pooled), **dict.fromkeys(self.records, self.records)}
        return self._of(held, name)[name]

    def check_planners(self, names: Iterable[str]) -> None:
        """Check that these are planners, and not single trainings of some.

        Raises:
            UsageError: one did not run, or is a training.
        """
        whole = tuple(first_trainings(self.records))
        for name in names:
            self.episodes(name)  # names the planners of the run if this is none of them
            if name not in whole:
                raise UsageError(
                    f"{self.directory}: {name} is one training; expected a planner with all its own: {', '.join(whole)}"
                )

    def record_name(self, name: str) -> str:
        """Return the record name of a planner; with several trainings, that of the first.

        Raises:
            UsageError: the run has no such planner.
        """
        return self._of({**first_trainings(self.records), **{record: record for record in self.records}}, name)

    def tables(self) -> "list[Table]":
        """Return the summary's tables; of streams, also how soon activities are recognised."""
        from eval.scores.streams.table import stream_table  # imported here: it brings rich

        tables, fps = self.summary.tables(), self.conditions.fps
        if not self.of_streams or not fps:
            return tables
        episodes = len(next(iter(self.records.values())))
        return [*tables, stream_table(pool_seeds(self.records), fps, episodes)]

    def save(self, folder: str | Path, *, tables: Sequence["Table"] | None = None) -> Path:
        """Write config.json, episodes.jsonl, summary.json, the accuracy curve and last table.md; return the folder.

        Args:
            folder: where to.
            tables: of table.md; None means the run's own.

        Raises:
            UsageError: the folder cannot be written to, or holds another run.
        """
        from eval.render.figures import draw_accuracy  # matplotlib takes a second to import
        from eval.render.tables import markdown

        out, classes = Path(folder), len(class_names(self, lambda _: None))
        check_out(out, self.config.to_json())
        write_records(out, self.config, self.records, self.summary)
        privileged = {planner.name for planner in self.summary.planners if planner.privileged}
        watched = "activity" if self.of_streams else "episode"
        draw_accuracy(curves(self.scored), privileged, classes, self.config.title, out / "accuracy", watched)
        write_text(out / TABLE, [markdown(*(self.tables() if tables is None else tables))])
        return out

    def to_dataframe(self) -> "pandas.DataFrame":
        """Return one row per episode and planner: names, accuracy over the frames, and numbers that are recorded once.

        Raises:
            UsageError: the run is of streams, or pandas is not installed.
        """
        if self.of_streams:
            raise UsageError("a data frame has a row for each clip, this run is of streams: expected its `records`")
        try:
            import pandas  # imported here: few need it
        except ImportError as error:
            raise UsageError(
                "a data frame needs pandas, which is not installed: pip install -e '.[notebook]'"
            ) from error
        names = self.class_names
        return pandas.concat(
            [pandas.DataFrame(_columns(planner, episodes, names)) for planner, episodes in self.records.items()],
            ignore_index=True,
        )

    def __repr__(self) -> str:
        """Return a line: what ran, on what, how many episodes."""
        episodes = len(next(iter(self.records.values()), ()))
        planners = f"{len(self.records)} planner{'s' * (len(self.records) != 1)}"
        return f"Run({self.config.title}: {planners}, {episodes} episodes each)"

    def __str__(self) -> str:
        """Return the tables, and what was found and how sure it is."""
        from eval.render.tables import text  # imported here: it brings rich

        return f"{text(*self.tables())}\n{closing_sentences(self.summary)}\n"

    def _repr_html_(self) -> str:
        """Return the same for a notebook."""
        from eval.render.tables import html  # imported here: it brings rich

        return "".join(map(html, self.tables())) + f"<p>{escape(closing_sentences(self.summary))}</p>"

    def _of(self, named: Mapping[str, Held], name: str) -> Held:
        if name not in named:
            raise UsageError(
                f"{self.directory or 'this run'}: no planner {name!r}; expected one of: {', '.join(named)}"
            )
        return named[name]


def write_records(out: Path, config: RunConfig, records: Mapping[str, EpisodeRecords], summary: Summary | None) -> None:
    """Write a run; without a summary, which is written last, it counts as incomplete."""
    (out / SUMMARY).unlink(missing_ok=True)
    write_text(out / CONFIG, [json_text(config.to_json())])
    write_text(out / EPISODES, episode_lines(records))
    if summary is not None:
        write_text(out / SUMMARY, [json_text(summary.to_json())])


def _columns(planner: str, episodes: EpisodeRecords, class_names: tuple[str, ...] | None) -> dict[str, Any]:
    """Return the columns of a data frame."""
    named = np.array(class_names, dtype=object) if class_names is not None else None
    last = episodes.predicted[:, -1]
    return {
        "planner": planner,
        "sequence": list(episodes.sequence),
        "first_frame": episodes.first,
        "label": episodes.label if named is None else named[episodes.label],
        "predicted": last if named is None else named[last],
        "acc_mean": 100 * mean_acc(episodes.correct),
        **{f"right_at_{percent}": right_at(episodes.correct, percent) for percent in ACC_AT},
        "true_probability": episodes.true_probability[:, -1],
        "path_length_m": path_length(episodes.viewpoint),
        "start_distance_m": episodes.start[:, 0],
        "start_azimuth_deg": np.degrees(episodes.start[:, 1]),
        "start_polar_deg": np.degrees(episodes.start[:, 2]),
        **({} if episodes.flight is None else held_flight(episodes.flight)),
        **({} if episodes.contacts is None else vars(episodes.contacts)),
    }


def read_run(directory: str | Path) -> Run:
    """Read a run of `ehar benchmark`, of clips or of streams.

    Raises:
        UsageError: the folder holds no such run, one of another schema, or one that was stopped.
        DataError: the files cannot be read, the run is incomplete, or planners ran different episodes.
    """
    directory = Path(directory)
    return _checked(directory, read_config(directory), read_episodes(directory / EPISODES))


def stored_run(directory: str | Path) -> Run:
    """Read a run whose records stay on disk: each planner's are read when they are asked for, and only the last held.

    Raises:
        EharError: as in `read_run`.
    """
    directory = Path(directory)
    return _checked(directory, read_config(directory), stored_episodes(directory / EPISODES))


def _checked(directory: Path, config: RunConfig, records: Mapping[str, EpisodeRecords]) -> Run:
    """Return a run, if it is finished and planners ran the same episodes; each planner's records are read once."""
    first, counts, other = None, dict[str, int](), None
    for name in records:
        episodes = records[name]
        if first is None:
            first = replace(episodes_only(episodes), predicted=np.empty(episodes.predicted.shape, dtype=np.int8))
        counts[name] = len(episodes)
        if other is None and not first.same_episodes(episodes):
            other = name
    reason = why_incomplete(directory, config, counts)
    if reason is not None:
        raise DataError(f"{directory}: expected a finished run, this one is incomplete: {reason}")
    if other is not None:
        whose = next(iter(counts))
        raise DataError(
            f"{directory}: expected the same episodes for every planner, those of {other} are not {whose}'s"
        )
    return Run(config, records, directory=directory)


def read_run_of_clips(directory: str | Path) -> Run:
    """Read a run for what has a meaning in clips only; the arguments are those of `read_run`.

    Raises:
        UsageError: as in `read_run`, or the run is of streams.
        DataError: as in `read_run`.
    """
    run = read_run(directory)
    if run.of_streams:
        raise UsageError(
            f"{directory}: expected a run of clips, got one of streams, which ehar report, replay, verify, "
            "compare, study analyse, decide, folds, overview and trainings take"
        )
    return run


def why_incomplete(directory: Path, config: RunConfig, counts: Mapping[str, int]) -> str | None:
    """Return what an incomplete run lacks, from the number of each planner's episodes; None for a finished run."""
    absent = [planner.name for planner in config.planners if planner.name not in counts]
    if absent or not counts:
        return f"no episodes of {', '.join(absent) or 'any planner'}"
    most = max(counts.values())
    for name, count in counts.items():
        if count < most:
            return f"{name} has {count} of {most} episodes"
    return None if (directory / SUMMARY).is_file() else f"no {SUMMARY}"


def class_names(run: Run, note: Callable[[str], None], source: str | Path | None = None) -> tuple[str, ...]:
    """Return the names of the run's classes; if its data cannot be read, return numbers and note why.

    Args:
        run: the run.
        note: is told the reason.
        source: path of the run's data; None takes the path in config.json.

    Raises:
        EharError: the data at `source` cannot be read.
    """
    from ehar.data.any_source import load_recordings  # imported here: it brings scipy

    if run.class_names is not None:
        return run.class_names
    conditions = run.conditions
    place = conditions.data if source is None else source
    try:
        data = load_recordings(str(place), fps=conditions.fps)
        reason = None if data.sha256 in run.config.data_hashes else f"{place}: not the data of the run"
    except EharError as error:
        if source is not None:
            raise
        reason = str(error)
    if reason is None:
        return data.class_names
    note(f"classes are numbered, as their names cannot be read: {reason}")
    # a class may be answered and never shown
    last = max(int(named.max()) for held in run.records.values() for named in (held.label, held.predicted))
    return tuple(f"class {label}" for label in range(last + 1))
